"""Made-up tables without a contradiction, for tests that change a digit.

Two shapes, none of them that of a table in the papers: an invoice with sums along rows and down
columns, and distances and times of cars that share one speed.
"""

import tomllib
from decimal import Decimal

from reproduce.consistency import relation
from reproduce.consistency.report import audit
from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import PrintedNumber

# Names of units in pint that differ from those of the data files.
PINT = {
    "count": "",
    "1": "",
    "mag": "",
    "um": "micrometer",
    "mm^-2": "millimeter**-2",
    "Hz": "hertz",
}
PINT |= {"px": "pixel", "deg": "degree", "arcsec": "arcsecond", "1/K": "kelvin**-1"}


def finding(audit, name):
    """The finding on one relation."""
    return next(one for one in audit.findings if one.relation.name == name)


def printed_cell(address, text, unit="1", qualifier=None):
    """Return a printed cell from its digits and unit."""
    key, _, name = address.partition("#")
    number = PrintedNumber(text, unit == "count", qualifier)
    return PrintedCell(key, name, name, number, unit, "derived", key)


def declared(text, cells, prefix=""):
    """Read relations from a text."""
    return relation.declared(tomllib.loads(text), cells, prefix)


def audited_table(name, cells, relations):
    """Audit cells by relations, or by a text of them."""
    inputs = declared(relations, cells) if isinstance(relations, str) else relations
    return audit(name, cells, inputs)


def invoice():
    """Net plus tax is gross in each row; the last row is the sum of the others."""
    net = ["120.50", "87.25", "310.75", "46.10"]
    tax = ["22.90", "16.58", "59.04", "8.76"]
    rows = [[*pair] for pair in zip(net, tax, strict=True)]
    rows.append([str(sum(map(Decimal, column))) for column in (net, tax)])
    cells = {}
    for name, row in zip([*"1234", "sum"], rows, strict=True):
        columns = {"net": row[0], "tax": row[1], "gross": str(sum(map(Decimal, row)))}
        for column, text in columns.items():
            address = f"bill#{name}.{column}"
            cells[address] = printed_cell(address, text, "m")
    text = """
    [[relations.all]]
    name = "row-{r}"
    formula = "gross = net + tax"
    cells = "gross=bill#{r}.gross net=bill#{r}.net tax=bill#{r}.tax"
    each = { r = ["1", "2", "3", "4", "sum"] }
    kind = "arithmetic"
    source = "by name"
    [[relations.all]]
    name = "column-{c}"
    formula = "total = sum(part)"
    cells = "total=bill#sum.{c} part=bill#[1-4].{c}"
    each = { c = ["net", "tax", "gross"] }
    kind = "arithmetic"
    source = "by name"
    """
    return cells, declared(text, cells)


def race():
    """Six cars: distance is speed by time, with one unknown speed for all."""
    cells = {}
    for car, (time, distance) in enumerate(
        [
            ("12.41", "351.20"),
            ("17.93", "507.42"),
            ("23.08", "653.16"),
            ("29.65", "839.10"),
            ("34.02", "962.77"),
            ("41.77", "1182.09"),
        ],
        start=1,
    ):
        cells[f"race#{car}.time"] = printed_cell(f"race#{car}.time", time, "s")
        cells[f"race#{car}.distance"] = printed_cell(
            f"race#{car}.distance", distance, "m"
        )
    text = """
    [unknown]
    pace = { unit = "1", low = 1, high = 1000, label = "speed" }
    [[relations.all]]
    name = "car-{i}"
    formula = "distance / u.m = pace * time / u.s"
    cells = "distance=race#{i}.distance time=race#{i}.time"
    each = { i = "123456" }
    unknown = "pace"
    kind = "equation"
    source = "one speed"
    """
    return cells, declared(text, cells)


TABLES = {"invoice": invoice, "race": race}
