"""Made-up tables without a contradiction, for tests that change a digit.

Two shapes, none of them that of a table in the papers: an invoice with sums along rows and down
columns, and distances and times of cars that share one speed.
"""

import tomllib

from reproduce.consistency import _relation as relation
from reproduce.consistency.report import audit
from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import PrintedNumber

# Names of units in pint that differ from those of the data files.
PINT = {"count": "", "mag": "", "px": "pixel"}


def finding(audit, name):
    """The finding on one relation."""
    return next(one for one in audit.findings if one.relation.name == name)


def printed_cell(address, text, unit="1"):
    """Return a printed cell from its digits and unit."""
    key, _, name = address.partition("#")
    number = PrintedNumber(text, unit == "count")
    return PrintedCell(key, name, name, number, key, unit, "derived")


def declared(text, cells, prefix=""):
    """Read relations from a text."""
    return relation.declared(tomllib.loads(text), cells, prefix)


def audited_table(name, cells, relations):
    """Audit cells by relations, or by a text of them."""
    inputs = declared(relations, cells) if isinstance(relations, str) else relations
    return audit(name, cells, inputs)
