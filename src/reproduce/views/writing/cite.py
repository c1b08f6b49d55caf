"""Citations of what is reproduced, beside the paper that it reproduces."""

from __future__ import annotations

import json
from typing import Any

from pybtex.database import BibliographyData, Entry, Person, parse_file

from reproduce.judge.studies import studies
from reproduce.locate import papers
from reproduce.papers.catalogue import drawings
from reproduce.printed.cells import anchor
from reproduce.version import RELEASED, __version__, software
from reproduce.views import keys

FORMATS = ("bibtex", "csl", "text")
DEVELOPERS = "The reproduce-pointing developers"
# The fields of BibTeX that CSL calls otherwise.
_CSL = {"journal": "container-title", "volume": "volume", "pages": "page", "number": "issue"}
_CSL |= {"doi": "DOI", "note": "note"}


def citation(address: str, form: str) -> str:
    """Return how to cite an item, a cell or a table of our own, and the paper it comes from."""
    key, _, name = address.partition("#")
    paper = key.partition("/")[0]
    if key in studies():
        return beside("Study", key, paper, studies()[key].title, form)
    if key in drawings():
        return beside("Drawing", key, paper, drawings()[key].title, form)
    keys.check_address(address)
    place = keys.place(key).partition(",")[0]
    what = place if place != "Text" else f"the numbers quoted in the text ({key.split('/')[1]})"
    title = f"Reproduction of {what} of {_et_al(paper)}: {keys.title(key)}"
    note = f"{'Cell' if name else 'Item'} {address}, anchor {anchor(address)}"
    return _written(f"reproduce-{anchor(address)}", title, note, paper, form)


def beside(kind: str, name: str, paper: str, title: str, form: str) -> str:
    """Return how to cite a posterior or a table of our own and the paper that it stands beside."""
    link = "of" if kind == "Posterior" else "beside"
    whole = f"{kind} {link} {_et_al(paper)}: {title}"
    named = f"reproduce-{kind.lower()}-{anchor(name)}"
    return _written(named, whole, f"{kind} {name}", paper, form)


def _paper(key: str) -> Entry:
    return parse_file(str(papers()[key] / "references.bib")).entries[key]


def _et_al(paper: str) -> str:
    source = _paper(paper)
    return f"{source.persons['author'][0].last_names[-1]} et al. ({source.fields['year']})"


def _written(name: str, title: str, note: str, paper: str, form: str) -> str:
    if form not in FORMATS:
        raise ValueError(f"unknown format {form!r}: expected one of {', '.join(FORMATS)}")
    # Braces keep a bibliography style from changing the case of names, and BibTeX from taking the
    # group's name for a first and a last name.
    fields = {
        "title": f"{{{title}}}",
        "year": RELEASED[:4],
        "howpublished": software(),
        "note": note,
    }
    ours = Entry("misc", fields=fields, persons={"author": [Person("{" + DEVELOPERS + "}")]})
    entries = {name: ours, paper: _paper(paper)}
    if form == "bibtex":
        return str(BibliographyData(entries).to_string("bibtex")).strip()
    if form == "csl":
        listed = [_csl(name, entry) for name, entry in entries.items()]
        return json.dumps(listed, indent=2, ensure_ascii=False)
    from pybtex.backends.plaintext import Backend
    from pybtex.plugin import find_plugin

    style = find_plugin("pybtex.style.formatting", "unsrt")()
    formatted = style.format_entries(BibliographyData(entries).entries.values())
    return "\n".join(entry.text.render(Backend()).strip() for entry in formatted)


def _csl(name: str, entry: Entry) -> dict[str, Any]:
    fields = {
        field: value.replace("{", "").replace("}", "") for field, value in entry.fields.items()
    }
    article = entry.type == "article"
    item: dict[str, Any] = {
        "id": name,
        "type": "article-journal" if article else "software",
        "title": fields["title"],
        "author": [_csl_name(person) for person in entry.persons["author"]],
        "issued": {"date-parts": [[int(fields["year"])]]},
    }
    item |= {csl: fields[field] for field, csl in _CSL.items() if field in fields}
    return item if article else item | {"version": __version__}


def _csl_name(person: Person) -> dict[str, str]:
    if not person.first_names:
        return {"literal": " ".join(person.last_names).strip("{}")}
    given = " ".join(person.first_names + person.middle_names)
    return {"family": " ".join(person.prelast_names + person.last_names), "given": given}
