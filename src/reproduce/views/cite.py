"""Citations of a reproduced item, beside the paper it reproduces."""

from __future__ import annotations

import json
from typing import Any

from pybtex.database import BibliographyData, Entry, Person, parse_file

from reproduce.locate import papers
from reproduce.printed.cells import anchor
from reproduce.version import RELEASED, __version__
from reproduce.views import keys

__all__ = ["beside", "citation"]

FORMATS = ("bibtex", "csl", "text")
_DEVELOPERS = "The reproduce-pointing developers"


def citation(key: str, form: str, address: str = "") -> str:
    """Return how to cite an item and the paper it comes from."""
    paper = key.partition("/")[0]
    named = f"reproduce-{anchor(address or key)}"
    return _written(named, _reproduction(key, _paper(paper), address or key), paper, form)


def beside(kind: str, name: str, paper: str, title: str, form: str) -> str:
    """Return how to cite a posterior or a table of our own and the paper that it stands beside."""
    source = _paper(paper)
    author = source.persons["author"][0].last_names[-1]
    link = "of" if kind == "Posterior" else "beside"
    fields = {
        "title": f"{{{kind} {link} {author} et al. ({source.fields['year']}): {title}}}",
        **_ours(f"{kind} {name}"),
    }
    return _written(f"reproduce-{kind.lower()}-{anchor(name)}", _entry(fields), paper, form)


def _paper(key: str) -> Entry:
    return parse_file(str(papers()[key] / "references.bib")).entries[key]


def _written(name: str, ours: Entry, paper: str, form: str) -> str:
    if form not in FORMATS:
        raise ValueError(f"unknown format {form!r}: expected one of {', '.join(FORMATS)}")
    entries = {name: ours, paper: _paper(paper)}
    if form == "bibtex":
        return str(BibliographyData(entries).to_string("bibtex")).strip()
    if form == "csl":
        listed = [_csl(name, entry) for name, entry in entries.items()]
        return json.dumps(listed, indent=2, ensure_ascii=False)
    return _text(BibliographyData(entries))


def _reproduction(key: str, source: Entry, address: str) -> Entry:
    first = source.persons["author"][0].last_names[-1]
    year = source.fields["year"]
    place = keys.place(key).partition(",")[0]
    what = place if place != "Text" else f"the numbers quoted in the text ({key.split('/')[1]})"
    kind = "Item" if address == key else "Cell"
    fields = {
        # Braces keep a bibliography style from changing the case of names.
        "title": f"{{Reproduction of {what} of {first} et al. ({year}): {keys.title(key)}}}",
        **_ours(f"{kind} {address}, anchor {anchor(address)}"),
    }
    return _entry(fields)


def _ours(note: str) -> dict[str, str]:
    return {
        "year": RELEASED[:4],
        "howpublished": f"reproduce-pointing, version {__version__}",
        "note": note,
    }


def _entry(fields: dict[str, str]) -> Entry:
    # Here braces keep BibTeX from taking the group's name for a first and a last name.
    return Entry("misc", fields=fields, persons={"author": [Person("{" + _DEVELOPERS + "}")]})


def _csl(name: str, entry: Entry) -> dict[str, Any]:
    fields = {
        field: value.replace("{", "").replace("}", "") for field, value in entry.fields.items()
    }
    item: dict[str, Any] = {
        "id": name,
        "type": "article-journal" if entry.type == "article" else "software",
        "title": fields["title"],
        "author": [_csl_name(person) for person in entry.persons["author"]],
        "issued": {"date-parts": [[int(fields["year"])]]},
    }
    renamed = {
        "journal": "container-title",
        "volume": "volume",
        "pages": "page",
        "number": "issue",
        "doi": "DOI",
        "note": "note",
    }
    item |= {csl: fields[field] for field, csl in renamed.items() if field in fields}
    if item["type"] == "software":
        item["version"] = __version__
    return item


def _csl_name(person: Person) -> dict[str, str]:
    if not person.first_names:
        return {"literal": " ".join(person.last_names).strip("{}")}
    given = " ".join(person.first_names + person.middle_names)
    return {"family": " ".join(person.prelast_names + person.last_names), "given": given}


def _text(data: BibliographyData) -> str:
    from pybtex.backends.plaintext import Backend
    from pybtex.plugin import find_plugin

    style = find_plugin("pybtex.style.formatting", "unsrt")()
    formatted = style.format_entries(data.entries.values())
    return "\n".join(entry.text.render(Backend()).strip() for entry in formatted)
