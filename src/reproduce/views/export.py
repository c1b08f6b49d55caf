"""What a reader takes away: exports through pandas, citations, and the bar that offers both."""

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

from reproduce.judge.ledger import Ledger, Record, reason
from reproduce.locate import data_folder, papers
from reproduce.papers.catalogue import drawings, studies
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
from reproduce.views.blocks import PLAIN, Grid, plain
from reproduce.views.computed import item_ledger, whole_ledger
from reproduce.views.numbers import minus, powers

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("csv", "json", "latex", "markdown")
# The endings of their files.
_ENDINGS = {"csv": "csv", "json": "json", "latex": "tex", "markdown": "md"}


def export(ledger: Ledger, address: str, form: str, shown: Grid) -> str:
    """Return the records of an item or a cell in a format of other programs.

    JSON and CSV contain every field of each record. LaTeX and Markdown have the layout of `shown`.
    """
    key, _, name = address.partition("#")
    records = [r for r in ledger.of(key) if not name or r.cell == address]
    if form == "json":
        tables = () if name else tuple(t for t in ledger.tables if t.key == key)
        part = Ledger(records=tuple(records), tables=tables)
        return with_provenance(part, address).model_dump_json(indent=2)
    provenance = provenance_of(citation(address, "text"))
    if form == "csv":
        return export_frame(full_frame(records), form, provenance)
    import pandas as pd

    rows = [list(map(plain, row)) for row in shown.rows]
    frame = pd.DataFrame(rows, columns=list(map(plain, shown.head)), dtype=str)
    frame.attrs["latex"] = {
        "caption": plain(shown.caption),
        "label": f"tab:{anchor(key)}",
        "column_format": "l" + "r" * (frame.shape[1] - 1),
    }
    return export_frame(frame, form, provenance)


def table_files(key: str) -> dict[str, str]:
    """Return where the book carries the exports of a table: path below its root to format."""
    return {f"tables/{anchor(key)}.{ending}": form for form, ending in _ENDINGS.items()}


def provenance_of(cited: str, setting: str = "") -> dict[str, str]:
    """Return the provenance of an export: software, citation and changes."""
    told = {"software": software(), "citation": cited, "setting": setting}
    return {name: text for name, text in told.items() if text}


def with_provenance(ledger: Ledger, address: str = "all") -> Ledger:
    """Return a ledger with the written reason of each verdict, and its provenance."""
    told = tuple(
        r.model_copy(update={"reason": reason(r.cell)}) for r in ledger.records
    )
    return ledger.model_copy(
        update={"records": told} | provenance_of(citation(address, "text"))
    )


def export_frame(
    frame: pd.DataFrame, form: str, provenance: Mapping[str, str] | None = None
) -> str:
    """Write any DataFrame as csv, json, latex or markdown.

    Its provenance is a comment before the rows; in JSON it is next to the rows.
    """
    _check_format(form, FORMATS)
    provenance = provenance or provenance_of(citation("all", "text"))
    said = "".join(f"{name}: {text}\n" for name, text in provenance.items())
    if form == "csv":
        # Words are quoted, since an address holds the sign of a comment.
        return indent(said, "# ") + str(
            frame.to_csv(index=False, quoting=csv.QUOTE_NONNUMERIC)
        )
    if form == "json":
        rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
        return json.dumps({**provenance, "rows": rows}, indent=2, ensure_ascii=False)
    if form == "latex":
        table = frame.to_latex(index=False, escape=True, **frame.attrs.get("latex", {}))
        return (indent(said, "% ") + _in_tex(table)).encode("ascii", PLAIN).decode()
    dashes = ["---"] * len(frame.columns)
    lines = [frame.columns, dashes, *frame.to_numpy()]
    # Other programs read numbers with a hyphen as the sign.
    texts = [
        " | ".join(str(cell).replace("|", "\\|").replace("−", "-") for cell in line)
        for line in lines
    ]
    return "\n".join([f"<!--\n{said}-->\n", *(f"| {text} |" for text in texts)])


def _in_tex(text: str) -> str:
    """Write signs of numbers and of units as LaTeX does.

    Examples
    --------
    >>> print(_in_tex("-5e-5 µm"))
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
        "⁻": "$^{-}$",
        **{sign: f"$^{{{digit}}}$" for digit, sign in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")},
    }
)


def full_frame(records: Iterable[Record]) -> pd.DataFrame:
    """Return one row per cell, with every field of the ledger and the reason.

    Lists are words with blanks between them; an interval is two columns.
    """
    import pandas as pd

    rows = []
    for record in records:
        found = record.readings
        closest = found and found.closest
        row = record.model_dump() | {
            "reason": reason(record.cell),
            "readings": found and found.count,
            "agreeing": found and found.agreeing,
            "agrees_if": found and verdicts.deciding(found),
            "closest": closest and verdicts.choices_text(closest.choices),
            "closest_computed": closest and closest.computed,
            "closest_probability": closest and closest.probability,
        }
        for name in ("stands_for", "interval"):
            row[f"{name}_low"], row[f"{name}_high"] = row.pop(name) or (None, None)
        for name in ("flags", "equations", "seed", "inputs"):
            row[name] = " ".join(map(str, row[name] or ()))
        rows.append(row)
    return pd.DataFrame(rows)


_CITATION_FORMATS = ("bibtex", "ris", "csl", "text")
# Field of BibTeX to its names in CSL and in RIS; empty if RIS has none.
_FIELDS = {
    "title": ("title", "TI"),
    "year": ("issued", "PY"),
    "journal": ("container-title", "JO"),
    "volume": ("volume", "VL"),
    "number": ("issue", "IS"),
    "pages": ("page", "SP"),
    "doi": ("DOI", "DO"),
    "url": ("URL", "UR"),
    "note": ("note", "N1"),
    "howpublished": ("", "N2"),
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
        text = citation_digest(item_ledger(key).cell(library()[key][name].address))
        return _written(entry, text, mark(text), form, paper, address)
    place = keys.place(key).partition(",")[0]
    if place == "Text":
        place = f"the numbers quoted in the text ({key.split('/')[1]})"
    title = f"Reproduction of {place} of {_et_al(paper)}: {keys.title(key)}"
    note = f"Item {key}, anchor {anchor(key)}"
    return _written(entry, title, note, form, paper, key)


def cite_related(kind: str, name: str, paper: str, title: str, form: str) -> str:
    """Return the citation of a posterior or a supplementary table, and of its paper."""
    link = "of" if kind == "Posterior" else "beside"
    whole = f"{kind} {link} {_et_al(paper)}: {title}"
    entry = f"reproduce-{kind.lower()}-{anchor(name)}"
    return _written(entry, whole, f"{kind} {name}", form, paper, name)


def citation_digest(record: Record) -> str:
    """Return the printed value, the computed value to six digits and the verdict of a cell."""
    unit = "" if record.unit in {"", "1"} else f" {record.unit}"
    said = [f"{record.cell}: printed {record.printed}{unit}"]
    if record.computed is not None and record.role == "result":
        what = "assumed" if "stand_in" in record.flags else "recomputed"
        ends = ", ".join(f"{end:.6g}" for end in record.interval or ())
        said.append(f"{what} {record.computed:.6g}{ends and f' [{ends}]'}{unit}")
    if record.verdict == "ambiguous" and record.readings:
        said.append(
            f"agrees with {record.readings.agreeing} of {record.readings.count} readings"
        )
    return ", ".join((*said, record.verdict))


def mark(said: str) -> str:
    """Return the checksum of a statement on a cell."""
    return f"rp:{sha256(said.encode()).hexdigest()[:12]}"


def verify(text: str) -> str:
    """Compare the statement of a citation with the present and the released statements."""
    if not isinstance(text, str):
        raise TypeError(
            f"citation: expected text, got {text!r}. Use the form 'text' of `cite`"
        )
    said, _, rest = " ".join(text.split()).partition(f". {NAME} ")
    source, _, rest = rest.partition(". ")
    marked = re.search(r"\brp:\w+", rest)
    if not marked or marked[0] != mark(said):
        return "not ours: its words and its mark do not belong together"
    address = said.partition(": ")[0]
    key, _, name = address.partition("#")
    now = f"{address} is not a printed number"
    if key in library() and name in library()[key].by_name:
        record = item_ledger(key).cell(address)
        now = citation_digest(record)
        if now == said and source in {version(), *released()}:
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
    return [mark(citation_digest(record)) for record in whole_ledger().records]


@cache
def _paper(key: str) -> Entry:
    return parse_file(str(papers()[key] / "references.bib")).entries[key]


def _et_al(paper: str) -> str:
    source = _paper(paper)
    names = [person.last_names[-1] for person in source.persons["author"]]
    told = " and ".join(names) if len(names) < 3 else f"{names[0]} et al."
    return f"{told} ({source.fields['year']})"


def _written(
    name: str, title: str, note: str, form: str, paper: str = "", address: str = ""
) -> str:
    """Write the entry of an address of the book, and the entries of its papers."""
    _check_format(form, _CITATION_FORMATS)
    permalink = ADDRESS
    if ADDRESS and address:
        permalink = f"{ADDRESS}/goto.html#{anchor(address)}"
    # Braces keep a bibliography style from changing the case of names, and BibTeX from taking the
    # group's name for a first and a last name.
    fields = {
        "title": f"{{{title}}}",
        "year": RELEASED[:4],
        "howpublished": software(),
        "note": note,
        "doi": DOI,
        "url": permalink,
    }
    ours = Entry(
        "misc",
        fields={k: v for k, v in fields.items() if v},
        persons={"author": [Person("{" + DEVELOPERS + "}")]},
    )
    papers = {one: _paper(one) for one in ([paper] if paper else PAPERS)}
    entries = BibliographyData({name: ours} | papers)
    if form == "bibtex":
        return str(entries.to_string("bibtex")).strip()
    if form == "csl":
        listed = [_csl(name, entry) for name, entry in entries.entries.items()]
        return json.dumps(listed, indent=2, ensure_ascii=False)
    if form == "ris":
        return "\n".join(map(_ris, entries.entries.values()))
    from pybtex.backends.plaintext import Backend

    formatted = _style().format_entries(entries.entries.values())
    texts = [entry.text.render(Backend()).strip() for entry in formatted]
    if note.startswith("rp:"):  # the statement of a cell comes first: `verify` reads it
        parts = (f"{title}. {software()}.", permalink, note)
        texts[0] = " ".join(part for part in parts if part)
    return "\n".join(texts)


def _csl(name: str, entry: Entry) -> dict[str, Any]:
    """Return an entry as an item of the Citation Style Language."""
    is_article = entry.type == "article"
    item: dict[str, Any] = {
        "id": name,
        "type": "article-journal" if is_article else "software",
        "title": "",
        "author": [_names(person) for person in entry.persons["author"]],
    }
    for field, (csl, _) in _FIELDS.items():
        if csl and field in entry.fields:
            item[csl] = _bare(entry.fields[field])
    item["issued"] = {"date-parts": [[int(item["issued"])]]}
    return item if is_article else item | {"version": __version__}


def _ris(entry: Entry) -> str:
    """Return an entry in the format of Research Information Systems."""
    lines = [("TY", "JOUR" if entry.type == "article" else "COMP")]
    people = entry.persons["author"]
    lines += [("AU", ", ".join(_names(person).values())) for person in people]
    for field, (_, tag) in _FIELDS.items():
        if field in entry.fields:
            lines.append((tag, _bare(entry.fields[field])))
    return "".join(f"{tag}  - {value}\n" for tag, value in (*lines, ("ER", "")))


def _names(person: Person) -> dict[str, str]:
    """Return the family name, then the given names; or the name of a group."""
    family = _bare(" ".join(person.prelast_names + person.last_names))
    given = " ".join(person.first_names + person.middle_names)
    return {"family": family, "given": given} if given else {"literal": family}


def _bare(text: str) -> str:
    """Return a text of BibTeX without braces."""
    return text.replace("{", "").replace("}", "")


def _check_format(form: str, known: tuple[str, ...]) -> None:
    if form not in known:
        raise ValueError(f"format: expected one of {', '.join(known)}, got {form!r}")


@cache
def _style() -> Any:
    """Return how texts of citations look; to find it takes longer than to write some."""
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
    """Return the bar below a table or a figure of a page, with an anchor for each function.

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
    names = {"tex": "LaTeX", "md": "Markdown"}
    endings = {path: path.rpartition(".")[2] for path in files}
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
