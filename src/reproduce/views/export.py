"""Exports through pandas, citations, and the toolbar of a page for both."""

from __future__ import annotations

import csv
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from hashlib import sha256
from textwrap import indent
from typing import TYPE_CHECKING, Any

from jinja2 import Environment
from markupsafe import Markup
from pybtex.database import BibliographyData, Entry, Person, parse_file

from reproduce.judge.ledger import Ledger, Record, reason, reply_state
from reproduce.locate import data_folder, papers
from reproduce.papers.catalogue import catalogue, drawings, studies
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.version import (
    ADDRESS,
    DOI,
    NAME,
    RELEASED,
    __version__,
    software,
    version,
)
from reproduce.views import keys, verdicts
from reproduce.views.blocks import Grid, plain
from reproduce.views.computed import item_ledger, whole_ledger
from reproduce.views.numbers import minus, powers

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("csv", "json", "latex", "markdown")
# Endings of the files of each format.
_ENDINGS = {"csv": "csv", "json": "json", "latex": "tex", "markdown": "md"}
_COVARIANCE = "-covariance.csv"


def export(part: Ledger, address: str, form: str, shown: Grid) -> str:
    """Return the records of an item or a cell in a format of other programs.

    JSON and CSV contain every field of each record. LaTeX and Markdown have the layout of `shown`.
    """
    if form == "json":
        return with_provenance(part, address).model_dump_json(indent=2)
    frame = full_frame(part.records)
    if form != "csv":
        import pandas as pd

        lines = [list(map(plain, line)) for line in (shown.head, *shown.rows)]
        frame = pd.DataFrame(lines[1:], columns=lines[0], dtype=str)
        frame.attrs["latex"] = {
            "caption": plain(shown.caption),
            "label": f"tab:{anchor(address.partition('#')[0])}",
            "column_format": "l" + "r" * (len(lines[0]) - 1),
        }
    return export_frame(frame, form, provenance_of(citation(address, "text")))


def table_files(key: str) -> dict[str, str]:
    """Return the exports of a table: path below the root of the book to format."""
    found = {
        f"tables/{anchor(key)}.{ending}": form for form, ending in _ENDINGS.items()
    }
    random = key in catalogue() and any(
        c.replicates for c in catalogue()[key].computations
    )
    return found | (
        {f"tables/{anchor(key)}{_COVARIANCE}": "covariance"} if random else {}
    )


def provenance_of(cited: str, setting: str = "") -> dict[str, str]:
    """Return the provenance of an export: software, citation and changes."""
    texts = {"software": software(), "citation": cited, "setting": setting}
    return {name: text for name, text in texts.items() if text}


def with_provenance(ledger: Ledger, address: str = "all") -> Ledger:
    """Return a ledger with the written reason of each verdict, and its provenance."""
    records = tuple(
        r.model_copy(update={"reason": reason(r.cell), "reply": reply_state(r.cell)})
        for r in ledger.records
    )
    return ledger.model_copy(
        update={"records": records} | provenance_of(citation(address, "text"))
    )


def export_frame(
    frame: pd.DataFrame, form: str, provenance: Mapping[str, str] | None = None
) -> str:
    """Write any DataFrame as csv, json, latex or markdown.

    Its provenance is a comment before the rows; in JSON it is next to the rows.
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
    if form == "latex":
        table = frame.to_latex(index=False, escape=True, **frame.attrs.get("latex", {}))
        return indent(comment, "% ") + in_tex(table)
    dashes = ["---"] * len(frame.columns)
    lines = [frame.columns, dashes, *frame.to_numpy()]
    # Other programs read numbers with a hyphen as the sign.
    texts = [
        " | ".join(str(cell).replace("|", "\\|").replace("−", "-") for cell in line)
        for line in lines
    ]
    return "\n".join([f"<!--\n{comment}-->\n", *(f"| {text} |" for text in texts)])


def in_tex(text: str) -> str:
    """Write signs of numbers and of units as LaTeX does.

    Examples
    --------
    >>> print(in_tex("-5e-5 µm"))
    $-$5\\,$\\times$\\,10$^{-}$$^{5}$ \\textmu{}m
    """
    return powers(minus(text)).translate(_TEX)


_TEX: dict[int, str] = str.maketrans(
    {
        "−": "$-$",
        "×": r"$\times$",
        "\u202f": r"\,",
        "″": "$''$",
        "µ": r"\textmu{}",
        "–": "--",
        "°": r"\textdegree{}",
        "σ": r"$\sigma$",
        "χ": r"$\chi$",
        "Δ": r"$\Delta$",
        "θ": r"$\theta$",
        "≈": r"$\approx$",
        "≥": r"$\geq$",
        "±": r"$\pm$",
        "⁻": "$^{-}$",
        **{sign: f"$^{{{digit}}}$" for digit, sign in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")},
    }
)


def full_frame(records: Iterable[Record]) -> pd.DataFrame:
    """Return one row per cell, with every field of the ledger and the reason.

    Lists are words with blanks between them. An interval is two columns.
    """
    import pandas as pd

    rows = []
    for record in records:
        row = record.model_dump(exclude={"readings"}) | {"reason": reason(record.cell)}
        row["reply"] = reply_state(record.cell)
        # These columns also exist without readings.
        row |= dict.fromkeys(_READINGS)
        if readings := record.readings:
            closest = readings.closest
            choices = verdicts.choices_text(closest.choices)
            numbers = closest.computed, closest.probability
            texts = (
                readings.count,
                readings.agreeing,
                verdicts.deciding(readings),
                choices,
            )
            row |= zip(_READINGS, (*texts, *numbers), strict=True)
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
_CITATION_FORMATS = ("bibtex", "ris", "csl", "text")
# Field of BibTeX to its name in CSL, and name in CSL to the tag of RIS.
_CSL_FIELDS = {
    "title": "title",
    "journal": "container-title",
    "volume": "volume",
    "number": "issue",
    "pages": "page",
    "doi": "DOI",
    "url": "URL",
    "note": "note",
}
_RIS_TAGS = {
    "title": "TI",
    "container-title": "JO",
    "volume": "VL",
    "issue": "IS",
    "page": "SP",
    "DOI": "DO",
    "URL": "UR",
    "note": "N1",
}
DEVELOPERS = "The reproduce-pointing developers"
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
        return _written("reproduce-pointing", WHOLE, "All printed numbers", form)
    key, _, name = address.partition("#")
    paper = key.partition("/")[0]
    if key in studies() or key in drawings():
        kind = "Study" if key in studies() else "Drawing"
        return cite_related(kind, key, paper, keys.title(key), form)
    keys.check_key(key)
    entry = f"reproduce-{anchor(address)}"
    if name:
        text = _statement_of(item_ledger(key).cell(library()[key][name].address))
        return _written(entry, text, _mark(text), form, paper, address)
    place = keys.place(key).partition(",")[0]
    if place == "Text":
        place = f"the numbers quoted in the text ({key.split('/')[1]})"
    title = f"Reproduction of {place} of {_et_al(paper)}: {keys.title(key)}"
    note = f"Item {key}, anchor {anchor(key)}"
    return _written(entry, title, note, form, paper, key)


def cite(address: str, form: str = "bibtex") -> str:
    """Return the citation of an item, a cell or a supplementary table, and of its paper.

    Parameters
    ----------
    address : str
        Key, cell such as ``niu2024/table-3#scale.red``, or ``all`` for the whole project.
    form : {"bibtex", "ris", "csl", "text"}
        Format of the citation.

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
    >>> print(cite("niu2024/table-3", "text").splitlines()[1].split(".")[0])
    Yanzhao Niu, Xinguo Wei, and Jian Li
    """
    return citation(address, form)


def cite_related(kind: str, name: str, paper: str, title: str, form: str) -> str:
    """Return the citation of a posterior or a supplementary table, and of its paper."""
    link = "of" if kind == "Posterior" else "beside"
    whole = f"{kind} {link} {_et_al(paper)}: {title}"
    entry = f"reproduce-{kind.lower()}-{anchor(name)}"
    return _written(entry, whole, f"{kind} {name}", form, paper, name)


def _statement_of(record: Record) -> str:
    """Return the printed value, the computed value to six digits and the verdict of a cell."""
    unit = "" if record.unit in {"", "1"} else f" {record.unit}"
    parts = [f"{record.cell}: printed {record.printed}{unit}"]
    if record.computed is not None and record.role == "result":
        what = "assumed" if "stand_in" in record.flags else "recomputed"
        ends = ", ".join(f"{end:.6g}" for end in record.interval or ())
        parts.append(f"{what} {record.computed:.6g}{ends and f' [{ends}]'}{unit}")
    if record.verdict == "ambiguous" and record.readings:
        parts.append(
            f"agrees with {record.readings.agreeing} of {record.readings.count} readings"
        )
    return ", ".join((*parts, record.verdict))


def _mark(statement: str) -> str:
    """Return the checksum of a statement on a cell."""
    return f"rp:{sha256(statement.encode()).hexdigest()[:12]}"


def verify(citation: str) -> str:
    """Compare the citation of a cell with the present statement of this package.

    The mark of a citation is a checksum of its statement, which anyone can compute. It protects
    the words against changes. It is no signature, so only statements that this package makes or
    that a stored release made are confirmed.

    Parameters
    ----------
    citation : str
        Citation of a cell from `cite` in the form ``text``, with the mark ``rp:...`` at its end.

    Returns
    -------
    str
        ``unchanged`` if this package makes the statement, and version, day and commit of the
        citation are those of this package or of a stored release.
        ``moved since VERSION: now ...`` if the stored release VERSION made the statement and this
        package makes another one, with the reason for the present verdict.
        ``well-formed, not known to this package: ...`` if words and mark belong together, but
        nothing is known provenance the version or provenance the statement.
        ``not confirmed: ...`` if words and mark do not belong together.

    Raises
    ------
    TypeError
        If the citation is not text.

    Examples
    --------
    >>> verify(cite("niu2024/table-2#scale.red", "text"))
    'unchanged'
    """
    if not isinstance(citation, str):
        raise TypeError(
            f"citation: expected text, got {citation!r}. Use the form 'text' of `cite`"
        )
    statement, _, rest = " ".join(citation.split()).partition(f". {NAME} ")
    source, _, rest = rest.partition(". ")
    marked = re.search(r"\brp:\w+", rest)
    if not marked or marked[0] != _mark(statement):
        return "not confirmed: its words and its mark do not belong together"
    address = statement.partition(": ")[0]
    key, _, name = address.partition("#")
    now = f"{address} is not a printed number"
    if key in library() and name in library()[key].by_name:
        record = item_ledger(key).cell(address)
        now = _statement_of(record)
        if now == statement and source in {version(), *released()}:
            return "unchanged"
        now = f"{now}, for {reason(address) or record.why}"
    if marked[0] in released().get(source, ()):
        return f"moved since {source}: now {now}"
    return f"well-formed, not known to this package: not stated by version {source}; now {now}"


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
    names = [person.last_names[-1] for person in source.persons["author"]]
    authors = " and ".join(names) if len(names) < 3 else f"{names[0]} et al."
    return f"{authors} ({source.fields['year']})"


def _written(
    name: str, title: str, note: str, form: str, paper: str = "", address: str = ""
) -> str:
    """Return the entry of an address of the book, and the entries of its papers."""
    _check_format(form, _CITATION_FORMATS)
    page = f"/goto.html#{anchor(address)}" if address else ""
    permalink = ADDRESS and ADDRESS + page
    # Braces keep a bibliography style from changing the case of names, and BibTeX from taking the
    # name of the group for a first and a last name.
    fields = {
        "title": f"{{{title}}}",
        "year": RELEASED[:4],
        "howpublished": software(),
        "note": note,
        "doi": DOI,
        "url": permalink,
    }
    fields = {key: text for key, text in fields.items() if text}
    people = {"author": [Person("{" + DEVELOPERS + "}")]}
    entries = {name: Entry("misc", fields=fields, persons=people)}
    entries |= {key: _paper(key) for key in ([paper] if paper else PAPERS)}
    if form == "bibtex":
        return str(BibliographyData(entries).to_string("bibtex")).strip()
    items = [_csl(key, entry) for key, entry in entries.items()]
    if form == "csl":
        return json.dumps(items, indent=2, ensure_ascii=False)
    if form == "ris":
        return "\n".join(map(_ris, items))
    from pybtex.backends.plaintext import Backend

    # The key of an entry is set by BibliographyData.
    listed = BibliographyData(entries).entries.values()
    formatted = _style().format_entries(listed)
    texts = [entry.text.render(Backend()).strip() for entry in formatted]
    if note.startswith(
        "rp:"
    ):  # the statement of a cell comes first: `verify` inputs it
        parts = (f"{title}. {software()}.", permalink, note)
        texts[0] = " ".join(filter(None, parts))
    return "\n".join(texts)


def _csl(name: str, entry: Entry) -> dict[str, Any]:
    """Return an entry as an item of the Citation Style Language."""
    fields = {key: re.sub("[{}]", "", text) for key, text in entry.fields.items()}
    people = []
    for person in entry.persons["author"]:
        given = " ".join(person.first_names + person.middle_names)
        family = re.sub("[{}]", "", " ".join(person.prelast_names + person.last_names))
        people.append(
            {"family": family, "given": given} if given else {"literal": family}
        )
    item: dict[str, Any] = {
        "id": name,
        "type": "article-journal" if entry.type == "article" else "software",
        "author": people,
        "issued": {"date-parts": [[int(fields["year"])]]},
    }
    item |= {csl: fields[key] for key, csl in _CSL_FIELDS.items() if key in fields}
    return item if entry.type == "article" else item | {"version": __version__}


def _ris(item: Mapping[str, Any]) -> str:
    """Return an item of CSL in the format of Research Information Systems."""
    is_software = item["type"] == "software"
    ((year,),) = item["issued"]["date-parts"]
    lines = [("TY", "COMP" if is_software else "JOUR"), ("PY", year)]
    lines += [("AU", ", ".join(person.values())) for person in item["author"]]
    lines += [(tag, item[key]) for key, tag in _RIS_TAGS.items() if key in item]
    lines += [("N2", software())] if is_software else []
    return "".join(f"{tag}  - {value}\n" for tag, value in (*lines, ("ER", "")))


def _check_format(form: str, known: tuple[str, ...]) -> None:
    if form not in known:
        raise ValueError(f"format: expected one of {', '.join(known)}, got {form!r}")


@cache
def _style() -> Any:
    """Return the style of citations as text, which is slow to find."""
    from pybtex.plugin import find_plugin

    return find_plugin("pybtex.style.formatting", "unsrt")()


_BAR = Environment(autoescape=True).from_string(
    """<div class="rp-bar">\
<a href="#{{ anchor }}" aria-label="Permalink: {{ key }}"><code>{{ key }}</code></a>
<details><summary>Cite</summary>\
{% for text in citations %}<pre tabindex="0">{{ text }}</pre>{% endfor %}</details>
<span>{% for path, name in files.items() %}{% if not loop.first %} · {% endif %}\
<a href="#{{ path }}" download>{{ name }}</a>{% endfor %}</span>\
{% if functions %}
<details><summary>Function</summary>\
{% for text in functions %}\
{% set name = text.partition('def ')[2].partition('(')[0] %}\
<pre tabindex="0" id="function-{{ anchor }}-{{ name }}">{{ text }}</pre>{% endfor %}</details>\
{% endif %}{% if inputs %}
<details><summary>Inputs</summary>{{ inputs }}</details>{% endif %}</div>"""
)


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
    names = {"tex": "LaTeX", "md": "Markdown", "covariance": "Covariance"}
    endings = {
        path: "covariance" if path.endswith(_COVARIANCE) else path.rpartition(".")[2]
        for path in files
    }
    return Markup(
        _BAR.render(
            key=key,
            anchor=anchor,
            citations=citations,
            files={path: names.get(e, e.upper()) for path, e in endings.items()},
            functions=source.split("\n\n\n") if source else (),
            inputs=inputs,
        )
    )
