"""Citations of the project, of its tables, cells, figures and posteriors, and of the papers."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Collection
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from pybtex.database import Entry, parse_file

from reproduce import version
from reproduce.judge.ledger import Record, record_of
from reproduce.locate import papers
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computation_for, panels, study
from reproduce.physics.validate import Text, checked
from reproduce.printed.cells import PAPERS, PrintedCell, library
from reproduce.version import AUTHORS, content_id
from reproduce.views import _keys as keys
from reproduce.views import _verdicts as verdicts
from reproduce.views._blocks import written
from reproduce.views._tex import in_tex

_FORMATS = ("bibtex", "ris", "csl", "text", "sentence")
# Field of BibTeX to its name in CSL.
_CSL_FIELDS = {
    "title": "title",
    "journal": "container-title",
    "volume": "volume",
    "number": "issue",
    "pages": "page",
    "doi": "DOI",
    "url": "URL",
    "note": "note",
    "version": "version",
    "swhid": "archive_location",
}
DEVELOPERS = " and ".join(AUTHORS)
_WHOLE = (
    "Pointing, reproduced: the printed numbers of two papers, recomputed and judged"
)


@checked
def cite(address: Text, form: Text = "bibtex") -> str:
    """Return the citation of an item, a cell or a supplementary table, and of its paper.

    Parameters
    ----------
    address : str
        Key, cell such as ``niu2024/table-3#scale.red``, or ``all`` for the whole project.
    form : {"bibtex", "ris", "csl", "text", "sentence"}
        Format of the citation. ``sentence`` is a sentence for a manuscript, without the entries of
        the list of references.

    Returns
    -------
    str
        The citation.

    Raises
    ------
    KeyError, ValueError
        If the address or the format is unknown.

    Examples
    --------
    >>> print(cite("niu2024/table-2#scale.red", "sentence").partition(" is")[0])
    The number printed in Table 2, scale factor, red, of Niu et al. (2024)
    """
    if address == "all":
        return _written(form, "", _WHOLE, PAPERS)
    key, _, name = address.partition("#")
    if name and key in library():
        record = record_of(library()[key][name].address)
        if form == "sentence":
            return statement(record, "sentence.txt")
        text = statement(record)
        return _written(form, address, text, [record.paper], mark(text))
    return cite_item(form, address)


def cite_item(form: str, key: str, changes: str = "") -> str:
    """Return the citation of an item or a supplementary table, with its changes."""
    paper, _, topic = key.partition("/")
    place = keys.place(key).partition(",")[0]
    relation = f"{place} to"
    if not place.startswith("Supplementary"):
        if not panels(key):
            keys.check_key(key)
        if place == "Text":
            place = f"the numbers quoted in the text ({topic})"
        relation = f"Reproduction of {place} of"
    return cite_related(form, paper, key, relation, keys.title(key), changes)


def cite_related(
    form: str, paper: str, name: str, relation: str, title: str, changes: str
) -> str:
    """Return the citation of an object with its relation to its paper, and of the paper.

    `name` is its key or the name of a posterior.
    """
    title = f"{relation} {_et_al(paper)}: {title}"
    title += f" (changed: {changes})" * bool(changes)
    return _written(form, name, title, [paper])


def in_words(cell: PrintedCell) -> str:
    """Return a cell in words, such as ``Table V, state 4, motion along Y``."""
    place, section = cell.place.split(", ", 1)
    # A single letter or a word in capitals stays.
    label = re.sub(r"(^|, )[A-Z](?=[a-z])", lambda first: first[0].lower(), cell.label)
    return f"{section if place == 'Text' else place}, {label}"


def identifiers(address: str) -> dict[str, str]:
    """Return the identifiers at Software Heritage of commit, data file and function.

    They are computed from the files of this package, and resolve if an archived repository
    contains the files. Cells and supplementary tables have a function.

    Examples
    --------
    >>> identifiers("niu2024/table-2#scale.red")["data"][:10]
    'swh:1:cnt:'
    """
    key, _, cell = address.partition("#")
    name = version.commit()
    found = {"commit": f"swh:1:rev:{name}"} if name else {}
    if key in library():
        folder = papers()[key.partition("/")[0]]
        found["data"] = content_id(folder / "printed" / f"{key}.toml")
    of_cell = computation_for(address) if cell else None
    if made := study(key) if key in catalogue("studies") else of_cell:
        lines, first = inspect.getsourcelines(made.function)
        file = content_id(Path(inspect.getfile(made.function)))
        found["function"] = f"{file};lines={first}-{first + len(lines) - 1}"
    return found


def statement(record: Record, template: str = "statement.txt") -> str:
    """Return the place, the printed value, the computed value and the verdict of a cell."""
    cell = record.printed_cell
    words = in_words(cell)
    return written(
        template,
        record=record,
        place=f"{words[:1].upper()}{words[1:]}, of {_et_al(record.paper)}",
        printed=verdicts.printed(cell),
        value=recomputed(record),
        verdicts=verdicts,
    )


def recomputed(record: Record) -> str:
    """Return the computed value of a result with its interval; empty without one."""
    shown = verdicts.texts(record)
    if not shown["computed"]:
        return ""
    what = "assumed" if "stand_in" in record.flags else "recomputed"
    ends = shown["allowed by rounded inputs"] or shown["predicted, central 99 %"]
    return f"{what} {shown['computed']}{ends and f' ({ends})'}"


def mark(statement: str) -> str:
    """Return the checksum of a statement on a cell."""
    return f"rp:{sha256(statement.encode()).hexdigest()[:12]}"


@cache
def _paper(key: str) -> Entry:
    return parse_file(papers()[key] / "references.bib").entries[key]


def _et_al(paper: str) -> str:
    source = _paper(paper)
    names = [str(person).partition(",")[0] for person in source.persons["author"]]
    authors = " and ".join(names) if len(names) < 3 else f"{names[0]} et al."
    return f"{authors} ({source.fields['year']})"


def _written(
    form: str, address: str, title: str, cited: Collection[str], mark: str = ""
) -> str:
    """Return the entry of an address of the book, and the entries of its papers."""
    keys.check_choice("format", form, _FORMATS)
    if form == "sentence":
        return written("related.txt", title=title)
    # A figure with panels is at its first panel.
    page = keys.element((*panels(address), address)[0])
    context = {
        "name": keys.element(address).removeprefix("figure-") or "pointing",
        "title": title,
        "page": page and f"/goto.html#{page}",
        "archived": identifiers(address),
        "mark": mark,
    }
    if form == "text":
        # `verify` reads the statement of a cell between the year and the name of the software.
        return "\n".join((written("citation.txt", **context), *map(_in_text, cited)))
    if form == "bibtex":
        context["title"] = in_tex(title.replace("^", r"\textasciicircum{}"))
    entries = [
        Entry.from_string(written("citation.bib", **context), "bibtex"),
        *map(_paper, cited),
    ]
    if form == "bibtex":
        return "\n".join(entry.to_string("bibtex") for entry in entries).strip()
    items = [*map(_csl, entries)]
    if form == "csl":
        return json.dumps(items, indent=2, ensure_ascii=False)
    return written("citation.ris", items=items)


@cache
def _in_text(key: str) -> str:
    """Return the citation of a paper as text, which is slow to write."""
    from pybtex.backends.plaintext import Backend
    from pybtex.style.formatting.unsrt import Style

    (entry,) = Style().format_entries([_paper(key)])
    return str(entry.text.render(Backend())).strip()


def _csl(entry: Entry) -> dict[str, Any]:
    """Return an entry as an item of the Citation Style Language."""
    fields = {key: re.sub("[{}]", "", text) for key, text in entry.fields.items()}
    people = []
    for person in entry.persons["author"]:
        family, _, given = re.sub("[{}]", "", str(person)).partition(", ")
        people.append(
            {"family": family, "given": given} if given else {"literal": family}
        )
    day = fields.get("date", fields["year"])
    item: dict[str, Any] = {
        "id": entry.key,
        "type": "article-journal" if entry.type == "article" else "software",
        "author": people,
        "issued": {"date-parts": [[*map(int, day.split("-"))]]},
    }
    if "commit" in fields:
        item["custom"] = {"commit": fields["commit"]}
    return item | {
        csl: fields[key] for key, csl in _CSL_FIELDS.items() if key in fields
    }
