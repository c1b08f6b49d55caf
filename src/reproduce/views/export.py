"""Exports through pandas, citations, and the toolbar of a page for both."""

from __future__ import annotations

import csv
import inspect
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from pybtex.database import BibliographyData, Entry, Person, parse_file
from pybtex.database.output.bibtex import Writer

from reproduce.judge.ledger import Ledger, Record, item_ledger
from reproduce.locate import data_folder, papers
from reproduce.papers.catalogue import catalogue, computation_for, drawings, studies
from reproduce.printed.cells import PAPERS, PrintedCell, anchor, find, library
from reproduce.version import (
    ADDRESS,
    AUTHORS,
    DOI,
    NAME,
    RELEASED,
    __version__,
    content_id,
    package_commit,
    software,
    version,
)
from reproduce.views import keys, verdicts
from reproduce.views.blocks import rendered
from reproduce.views.computed import whole_ledger
from reproduce.views.numbers import minus
from reproduce.views.tex import in_tex

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("csv", "json", "latex", "markdown")
# Endings of the files of each format.
_ENDINGS = {"csv": "csv", "json": "json", "latex": "tex", "markdown": "md"}
_COVARIANCE = "-covariance.csv"
# In LaTeX, longer texts have several lines, and wider tables of few rows are transposed.
_SENTENCE_CHARACTERS, _MAX_COLUMNS = 30, 7


def table_files(key: str) -> dict[str, str]:
    """Return the exports of a table: path below the root of the book to format."""
    path = f"tables/{anchor(key)}"
    found = {f"{path}.{ending}": form for form, ending in _ENDINGS.items()}
    if key in catalogue() and any(c.replicates for c in catalogue()[key].computations):
        found[f"{path}{_COVARIANCE}"] = "covariance"
    return found


def provenance_of(cited: str, setting: str = "") -> dict[str, str]:
    """Return the provenance of an export: software, citation and changes."""
    texts = {"software": software(), "citation": cited, "setting": setting}
    return {name: text for name, text in texts.items() if text}


def with_provenance(ledger: Ledger, address: str = "all") -> Ledger:
    """Return a ledger with its provenance."""
    return ledger.model_copy(update=provenance_of(citation(address, "text")))


def export_frame(
    frame: pd.DataFrame,
    form: str,
    provenance: Mapping[str, str] | None = None,
    address: str = "",
    caption: str = "",
    legend: str = "",
) -> str:
    """Write any DataFrame as csv, json, latex or markdown.

    Its provenance is a comment before the rows; in JSON it is next to the rows. In LaTeX the table
    of an address has a caption with citations. A legend is below it, also in Markdown.
    """
    _check_format(form, FORMATS)
    provenance = provenance or provenance_of(citation("all", "text"))
    comment = "".join(f"{name}: {text}\n" for name, text in provenance.items())
    if form == "csv":
        # Words are quoted, since an address contains the sign of a comment.
        return indent(comment, "# ") + str(
            frame.to_csv(index=False, quoting=csv.QUOTE_NONNUMERIC)
        )
    if form == "json":
        rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
        return json.dumps({**provenance, "rows": rows}, indent=2, ensure_ascii=False)
    lines = [[*frame.columns], *frame.to_numpy().tolist()]
    context = {"caption": caption, "address": address, "legend": legend}
    if form == "markdown":
        return rendered("table.md", lines=lines, comment=comment, **context)
    if len(frame) < _MAX_COLUMNS < len(frame.columns):
        lines = [list(column) for column in zip(*lines, strict=True)]
    texts = [
        [minus(f"{e:z.6g}" if isinstance(e, float) else str(e)) for e in line]
        for line in lines
    ]
    columns = [
        rf">{{\raggedright\arraybackslash}}p{{{2 / (1 + len(texts[0])):.2f}\linewidth}}"
        if max(map(len, column)) > _SENTENCE_CHARACTERS
        else "lr"[any(text.strip("−")[:1].isdigit() for text in column)]
        for _, *column in zip(*texts, strict=True)
    ]
    context["comment"] = comment
    context["entries"] = citation(address, "bibtex") if address else ""
    return in_tex(rendered("table.tex", lines=texts, columns=columns, **context))


def full_frame(records: Iterable[Record]) -> pd.DataFrame:
    """Return one row per cell, with every field of the ledger.

    Lists are words with blanks between them. An interval is two columns.
    """
    import pandas as pd

    rows = []
    for record in records:
        row = record.model_dump(exclude={"readings"})
        # These columns also exist without readings.
        row |= dict.fromkeys(_READINGS)
        if found := record.readings:
            closest = found.closest
            texts = verdicts.deciding(found), verdicts.choices_text(closest.choices)
            numbers = closest.computed, closest.probability
            values = (found.count, found.agreeing, *texts, *numbers)
            row |= zip(_READINGS, values, strict=True)
        for name in ("stands_for", "interval"):
            row[f"{name}_low"], row[f"{name}_high"] = row.pop(name) or (None, None)
        for name in ("flags", "equations", "seed", "inputs"):
            row[name] = " ".join(map(str, row[name] or ()))
        rows.append(row)
    return pd.DataFrame(rows)


_READINGS = (
    "readings",
    "agreeing",
    "agrees_if",
    "closest",
    "closest_computed",
    "closest_probability",
)
_CITATION_FORMATS = ("bibtex", "ris", "csl", "text", "sentence")
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
WHOLE = "Pointing, reproduced: the printed numbers of two papers, recomputed and judged"


def citation(address: str, form: str) -> str:
    """Return the citation of an item, a cell or a supplementary table, and of its paper.

    ``all`` is the whole project, with all papers.
    """
    if not isinstance(address, str):
        raise TypeError(
            f"address: expected text, such as 'niu2024/table-3', got {address!r}"
        )
    if address == "all":
        return _written("reproduce-pointing", WHOLE, form)
    key, _, name = address.partition("#")
    paper = key.partition("/")[0]
    if key in studies() or key in drawings():
        kind = "Study" if key in studies() else "Drawing"
        return cite_related(kind, key, paper, keys.title(key), form)
    keys.check_key(key)
    entry = f"reproduce-{anchor(address)}"
    if name:
        record = item_ledger(key).cell(library()[key][name].address)
        if form == "sentence":
            return _sentence_of(record)
        text = _statement_of(record)
        return _written(entry, text, form, paper, address, _mark(text))
    title = f"Reproduction of {_place(key)} of {_et_al(paper)}: {keys.title(key)}"
    return _written(entry, title, form, paper, key)


def cite(address: str, form: str = "bibtex") -> str:
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
    return citation(address, form)


def cite_related(kind: str, name: str, paper: str, title: str, form: str) -> str:
    """Return the citation of a posterior or a supplementary table, and of its paper."""
    names = {"Study": "Supplementary table to", "Drawing": "Supplementary figure to"}
    whole = f"{names.get(kind, f'{kind} of')} {_et_al(paper)}: {title}"
    return _written(
        f"reproduce-{kind.lower()}-{anchor(name)}", whole, form, paper, name
    )


def _place(key: str) -> str:
    """Return the place of an item in its paper."""
    place = keys.place(key).partition(",")[0]
    group = f"the numbers quoted in the text ({key.partition('/')[2]})"
    return group if place == "Text" else place


def in_words(cell: PrintedCell) -> str:
    """Return a cell in words, such as ``Table V, state 4, motion along Y``."""
    place, section = cell.place.split(", ", 1)
    parts = [
        part if part[:2].isupper() else part[:1].lower() + part[1:]
        for part in cell.label.split(", ")
    ]
    return ", ".join([section if place == "Text" else place, *parts])


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
    paper, _, item = key.partition("/")
    name = package_commit()
    found = {"commit": f"swh:1:rev:{name}"} if name else {}
    if key in library():
        path = papers()[paper] / "printed" / paper / f"{item}.toml"
        found["data"] = content_id(path)
    if made := computation_for(address) if cell else studies().get(key):
        function = inspect.unwrap(made.function)
        lines, first = inspect.getsourcelines(function)
        span = first, first + len(lines) - 1
        found["function"] = content_id(Path(inspect.getfile(function)), span)
    return found


def _statement_of(record: Record) -> str:
    """Return the place, the printed value, the computed value and the verdict of a cell."""
    cell, paper = find(record.cell)[0], record.key.partition("/")[0]
    words = in_words(cell)
    parts = [
        f"{words[:1].upper()}{words[1:]}, of {_et_al(paper)} [{record.cell}]: printed "
        f"{verdicts.printed(cell)}",
        recomputed(record),
    ]
    if record.verdict == "ambiguous" and (found := record.readings):
        parts.append(f"agrees with {found.agreeing} of {found.count} readings")
    # A citation has plain spaces before units.
    return " ".join(", ".join(filter(None, (*parts, record.verdict))).split())


def recomputed(record: Record) -> str:
    """Return the computed value of a result with its interval; empty without one."""
    shown = verdicts.texts(record)
    if not shown["computed"]:
        return ""
    what = "assumed" if "stand_in" in record.flags else "recomputed"
    ends = shown["allowed by rounded inputs"] or shown["predicted, central 99 %"]
    return f"{what} {shown['computed']}{ends and f' ({ends})'}"


def _sentence_of(record: Record) -> str:
    """Return sentences on a cell for a manuscript."""
    start, _, rest = _statement_of(record).partition(": printed ")
    return rendered(
        "sentence.txt",
        record=record,
        place=start.partition(" [")[0],
        printed=rest.split(", ")[0],
        value=recomputed(record).partition(" ")[2],
        source=_author_year(),
        verdicts=verdicts,
    )


def _author_year() -> str:
    """Return the reference to this package in a sentence."""
    return f"({DEVELOPERS}, {RELEASED[:4]}; {NAME} {__version__})"


def _mark(statement: str) -> str:
    """Return the checksum of a statement on a cell."""
    return f"rp:{sha256(statement.encode()).hexdigest()[:12]}"


def verify(citation: str) -> str:
    """Compare the citation of a cell with the statements of this package and of its releases.

    The mark of a citation is a checksum of its statement, which anyone can compute. It protects
    the statement against changes. It is no signature, so only statements that this package makes
    or that a stored release made are confirmed. Authors and addresses are not compared.

    Parameters
    ----------
    citation : str
        Citation of a cell from `cite` in the form ``text``, with the mark ``rp:...`` at its end.

    Returns
    -------
    str
        ``current`` if this package made the statement, or if a stored release made it and the
        computed value, to six digits, and the verdict are the same now.
        ``moved since VERSION: now ...`` if the stored release VERSION made the statement and the
        value or the verdict is another one now, with the reason for the present verdict.
        ``unknown: ...`` otherwise, with the reason: statement and mark do not belong together, or
        neither this package nor a release made the statement.

    Raises
    ------
    TypeError
        If the citation is not text.

    Examples
    --------
    >>> verify(cite("niu2024/table-2#scale.red", "text"))
    'current'
    """
    if not isinstance(citation, str):
        raise TypeError(
            f"citation: expected text, got {citation!r}. Use the form 'text' of `cite`"
        )
    text, _, rest = " ".join(citation.split()).partition(f". {NAME} ")
    # Authors and year are before the statement, except in citations of version 0.2.0.
    statement = re.sub(r"^[^\[(]* \(\d{4}\)\. ", "", text, count=1)
    source, _, rest = rest.partition(". ")
    marked = re.search(r"\brp:\w+", rest)
    if not marked or marked[0] != _mark(statement):
        return "unknown: its words and its mark do not belong together"
    named = re.search(r"(?:\[|^)(\S+#[^]\s]+)\]?: ", statement)
    address = named[1] if named else "it"
    key, _, name = address.partition("#")
    is_released = marked[0] in released().get(source, ())
    now = f"{address} is not a printed number"
    if key in library() and name in library()[key].by_name:
        record = item_ledger(key).cell(address)
        now = _statement_of(record)
        is_same = now == statement or (is_released and _agrees(statement, record))
        if is_same and (is_released or source == version()):
            return "current"
        now = f"{now}, for {record.reason or record.why}"
    if is_released:
        return f"moved since {source}: now {now}"
    return f"unknown: not stated by version {source}; now {now}"


def _agrees(statement: str, record: Record) -> bool:
    """Return whether a statement of version 0.2.0 has the verdict and the value of a record."""
    found = re.search(r"(?:recomputed|assumed) ([-−]?[\d.]+(?:e[-+]?\d+)?)", statement)
    stated = found and float(found[1].replace("−", "-"))
    value = record.computed
    same = stated == (None if value is None else float(f"{value:.6g}"))
    return same and statement.endswith(f", {record.verdict}")


@cache
def released() -> dict[str, list[str]]:
    """Return the marks of all statements of earlier releases, by version, day and commit."""
    text = (data_folder() / "last-release.toml").read_text(encoding="utf-8")
    marks: dict[str, list[str]] = tomllib.loads(text).get("marks", {})
    return marks


def marks() -> list[str]:
    """Return the marks of the present statements of all cells."""
    return [_mark(_statement_of(record)) for record in whole_ledger().records]


@cache
def _paper(key: str) -> Entry:
    return parse_file(str(papers()[key] / "references.bib")).entries[key]


def _et_al(paper: str) -> str:
    source = _paper(paper)
    names = [str(person).partition(",")[0] for person in source.persons["author"]]
    authors = " and ".join(names) if len(names) < 3 else f"{names[0]} et al."
    return f"{authors} ({source.fields['year']})"


def _written(
    name: str, title: str, form: str, paper: str = "", address: str = "", mark: str = ""
) -> str:
    """Return the entry of an address of the book, and the entries of its papers."""
    _check_format(form, _CITATION_FORMATS)
    if form == "sentence":
        return f"{title} {_author_year()}."
    page = f"/goto.html#{anchor(address)}" if address else ""
    permalink = ADDRESS and ADDRESS + page
    archived = identifiers(address)
    listed = ", ".join(f"{what} {one}" for what, one in archived.items())
    note = "" if permalink or not listed else f"Software Heritage: {listed}"
    # Braces keep a bibliography style from changing the case of names, and BibTeX from taking the
    # name of the group for a first and a last name.
    fields = {
        "title": f"{{{title}}}",
        "year": RELEASED[:4],
        "date": RELEASED,
        "version": __version__,
        "commit": package_commit(),
        "howpublished": software(),
        "note": ". ".join(filter(None, (note, mark))),
        "swhid": ", ".join(archived.values()),
        "doi": DOI,
        "url": permalink,
    }
    fields = {key: text for key, text in fields.items() if text}
    people = [Person(one if ", " in one else f"{{{one}}}") for one in AUTHORS]
    entries = {name: Entry("misc", fields=fields, persons={"author": people})}
    entries |= {key: _paper(key) for key in ([paper] if paper else PAPERS)}
    if form == "bibtex":
        return str(Writer().to_string(BibliographyData(entries))).strip()
    items = [_csl(key, entry) for key, entry in entries.items()]
    if form == "csl":
        return json.dumps(items, indent=2, ensure_ascii=False)
    if form == "ris":
        return rendered("citation.ris", items=items)
    # `verify` reads the statement of a cell between the year and the name of the software.
    doi = DOI and f"https://doi.org/{DOI}"
    start = f"{DEVELOPERS} ({RELEASED[:4]}). {title}"
    own = ". ".join(filter(None, (start, software(), note, permalink, doi, mark)))
    return "\n".join((own + "." * (not mark), *map(_in_text, [*entries][1:])))


@cache
def _in_text(key: str) -> str:
    """Return the citation of a paper as text, which is slow to write."""
    from pybtex.backends.plaintext import Backend
    from pybtex.style.formatting.unsrt import Style

    (entry,) = Style().format_entries(
        BibliographyData({key: _paper(key)}).entries.values()
    )
    return str(entry.text.render(Backend())).strip()


def _csl(name: str, entry: Entry) -> dict[str, Any]:
    """Return an entry as an item of the Citation Style Language."""
    fields = {key: re.sub("[{}]", "", text) for key, text in entry.fields.items()}
    people = []
    for person in entry.persons["author"]:
        family, _, given = re.sub("[{}]", "", str(person)).partition(", ")
        people.append(
            {"family": family, "given": given} if given else {"literal": family}
        )
    is_article = entry.type == "article"
    day = fields.get("date", fields["year"])
    item: dict[str, Any] = {
        "id": name,
        "type": "article-journal" if is_article else "software",
        "author": people,
        "issued": {"date-parts": [[*map(int, day.split("-"))]]},
    }
    if "commit" in fields:
        item["custom"] = {"commit": fields["commit"]}
    return item | {
        csl: fields[key] for key, csl in _CSL_FIELDS.items() if key in fields
    }


def _check_format(form: str, known: tuple[str, ...]) -> None:
    if form not in known:
        raise ValueError(f"format: expected one of {', '.join(known)}, got {form!r}")


def toolbar(
    key: str, anchor: str, files: Iterable[str], source: str, inputs: str = ""
) -> Markup:
    """Return the toolbar below a table or a figure of a page, with an anchor for each function.

    Its links lead to files below the root of the built book, ``#tables/KEY.csv``.

    Parameters
    ----------
    key : str
        Key of the table or figure.
    anchor : str
        Its anchor on the page.
    files : iterable of str
        Paths of its data and figures below the root of the book.
    source : str
        Text of the functions that compute it; empty if there are none.
    inputs : str
        Inputs of the computation, as HTML; empty if there are none.
    """
    citations = [citation(key, form) for form in ("bibtex", "text")]
    if key in library():
        cells = [citation(c.address, "text") for c in library()[key].cells]
        citations.append("\n".join(text.partition("\n")[0] for text in cells))
    return rendered(
        "bar",
        key=key,
        anchor=anchor,
        citations=citations,
        files=files,
        source=source,
        inputs=inputs,
    )
