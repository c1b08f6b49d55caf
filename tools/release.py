"""Write the files of a release to ``dist/release``: ``make release``.

The files are sdist, wheel, the built site as one archive, single files of the site, a description
as RO-Crate, and checksums. ``python tools/release.py describe`` writes CITATION.cff, codemeta.json
and datapackage.json from one source. ``python tools/release.py keep`` stores the verdicts, with
which the next release is compared.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import yaml
from pybtex.database import Entry, parse_file
from pybtex.richtext import Text

from pack_book import build_wheel, write_zip
from reproduce.judge.ledger import frozen
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import papers
from reproduce.store.studies import digest
from reproduce.version import (
    ADDRESS,
    AUTHORS,
    DOI,
    RELEASED,
    __version__,
    commit,
    version,
)
from reproduce.views._computed import whole_ledger
from reproduce.views.citations import mark, statement
from reproduce.views.verify import released

ROOT = Path(__file__).resolve().parent.parent
SPDX = "https://spdx.org/licenses/"
TEXTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
FILES, COLUMNS, CFF = TEXTS["files"], TEXTS["columns"], TEXTS["citation"]
TAKEN = [name for name in FILES if name[0].isalpha()]


def reproduced() -> list[Entry]:
    """Return the entries of the papers in the bibliography."""
    return [
        parse_file(str(data / "references.bib")).entries[key]
        for key, data in papers().items()
    ]


def field(paper: Entry, name: str) -> str:
    """Return a field of an entry without BibTeX markup."""
    return str(Text.from_latex(paper.fields[name]))


def about() -> dict[str, Any]:
    """Return the description of the project in the terms of schema.org."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    found: dict[str, Any] = {"name": project["name"], "keywords": project["keywords"]}
    found |= {"description": f"{project['description']}.", "version": __version__}
    found["datePublished"] = RELEASED
    # A person is "Family, Given".
    found["author"] = [
        _thing(f"#author-{place}", "Person" if "," in name else "Organization", name)
        for place, name in enumerate(AUTHORS, start=1)
    ]
    found["license"] = [
        _thing(SPDX + name, "CreativeWork", name)
        for name in project["license"].split(" AND ")
        if not name.startswith("LicenseRef-")
    ]
    found["citation"] = [
        _thing(
            f"https://doi.org/{paper.fields['doi']}",
            "ScholarlyArticle",
            field(paper, "title"),
        )
        for paper in reproduced()
    ]
    found |= {"url": ADDRESS} if ADDRESS else {}
    return found | ({"identifier": f"https://doi.org/{DOI}"} if DOI else {})


def _thing(address: str, kind: str, name: str) -> dict[str, str]:
    return {"@id": address, "@type": kind, "name": name}


def citation() -> str:
    """Return CITATION.cff."""
    own = about()
    found: dict[str, Any] = {
        "cff-version": "1.2.0",
        "message": TEXTS["message"],
        "type": "software",
    }
    found |= {name: own[other] for name, other in CFF.items() if other in own}
    found |= {"doi": DOI} if DOI else {}
    parts = ("family-names", "given-names")
    found["authors"] = [
        dict(zip(parts, name.split(", "), strict=True))
        if "," in name
        else {"name": name}
        for name in AUTHORS
    ]
    found["license"] = [licence["name"] for licence in own["license"]]
    found["references"] = [_cited(paper) for paper in reproduced()]
    return str(yaml.safe_dump(found, sort_keys=False, allow_unicode=True, width=100))


def _cited(paper: Entry) -> dict[str, Any]:
    names = {"journal": "journal", "volume": "volume", "start": "pages", "doi": "doi"}
    known = {
        name: field(paper, key) for name, key in names.items() if key in paper.fields
    }
    authors = [
        {
            "family-names": " ".join(one.last_names),
            "given-names": " ".join(one.first_names),
        }
        for one in paper.persons["author"]
    ]
    own = {"type": "article", "title": field(paper, "title"), "authors": authors}
    return own | {"year": int(paper.fields["year"])} | known


def codemeta() -> str:
    """Return codemeta.json."""
    # Types without a name in the context of CodeMeta.
    more = {name: f"schema:{name}" for name in ("CreativeWork", "ScholarlyArticle")}
    context = ["https://w3id.org/codemeta/3.0", more]
    found = {
        "@context": context,
        "@type": "SoftwareSourceCode",
        "programmingLanguage": "Python",
    }
    return _json(found | about())


def datapackage() -> str:
    """Return the Frictionless descriptor of the data, with the descriptions of data/README.md."""
    own, data = about(), ROOT / "data"
    rows = re.findall(
        r"^\| (`.*?) \| (.*) \|$", (data / "README.md").read_text("utf-8"), re.M
    )
    texts = {
        name: what for names, what in rows for name in re.findall(r"`([^`]+)`", names)
    }
    found = {
        "name": own["name"],
        "title": own["description"],
        "version": own["version"],
    }
    found["licenses"] = [_licence("CC-BY-4.0")]
    found["sources"] = [
        {"title": one["name"], "path": one["@id"]} for one in own["citation"]
    ]
    files = [
        path.relative_to(data).as_posix() for path in data.rglob("*") if path.is_file()
    ]
    found["resources"] = [
        _resource(name, texts)
        for name in sorted(files)
        if not name.endswith(("README.md", "datapackage.json"))
    ]
    return _json(found)


def _resource(name: str, texts: dict[str, str]) -> dict[str, Any]:
    what = texts[max((start for start in texts if name.startswith(start)), key=len)]
    found: dict[str, Any] = {"name": re.sub(r"\W+", "-", name.lower()), "path": name}
    found |= {
        "description": what.replace("`", ""),
        "format": Path(name).name.partition(".")[2] or "text",
    }
    if (theirs := licence_of(f"data/{name}")) != "CC-BY-4.0":
        found["licenses"] = [_licence(theirs)]
    if not name.endswith(".csv"):
        return found
    fields = [{"name": column, "type": kind} for column, kind in COLUMNS[name].items()]
    return found | {"type": "table", "encoding": "utf-8", "schema": {"fields": fields}}


def licence_of(name: str) -> str:
    """Return the licence of a file by REUSE.toml, where later tables have precedence."""
    tables = tomllib.loads((ROOT / "REUSE.toml").read_text("utf-8"))["annotations"]
    fitting = (
        one for one in tables if any(fnmatch(name, path) for path in one["path"])
    )
    return [str(one["SPDX-License-Identifier"]) for one in fitting][-1]


def _licence(name: str) -> dict[str, str]:
    if name.startswith("LicenseRef-"):
        return {"name": "other-open", "title": f"LICENSES/{name}.txt"}
    return {"name": name, "path": SPDX + name}


def _json(found: dict[str, Any]) -> str:
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"


def write_crate(folder: Path) -> None:
    """Describe the files of a folder as an RO-Crate."""
    from rocrate.model import ContextEntity
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.3")

    for name, value in about().items():
        listed = value if isinstance(value, list) else [value]
        things = [one for one in listed if isinstance(one, dict)]
        crate.add(*(ContextEntity(crate, one["@id"], one) for one in things))
        crate.root_dataset[name] = [{"@id": one["@id"]} for one in things] or value
    crate.root_dataset["publisher"] = crate.root_dataset["author"]
    for path in sorted(folder.iterdir()):
        ((what, form),) = (
            text for end, text in FILES.items() if path.name.endswith(end)
        )
        properties = {"name": path.name, "description": what, "encodingFormat": form}
        content = path.read_bytes()
        properties |= {"contentSize": str(len(content)), "sha256": digest(content)}
        crate.add_file(path, path.name, properties=properties)
    crate.metadata.write(folder)


def make(html: Path, folder: Path) -> None:
    """Write a release with a built site to a folder; equal sites give equal files."""
    build_wheel(ROOT, folder, "--sdist")
    name = f"reproduce-pointing-{__version__}-site"
    pages = sorted(path.relative_to(html) for path in html.rglob("*") if path.is_file())
    held = ((page.as_posix(), (html / page).read_bytes()) for page in pages)
    write_zip(folder / f"{name}.zip", name, held)
    for page in TAKEN:
        if (html / page).is_file():
            shutil.copyfile(html / page, folder / page)
    write_crate(folder)
    sums = "".join(
        f"{digest(path.read_bytes())}  {path.name}\n"
        for path in sorted(folder.iterdir())
    )
    (folder / "SHA256SUMS").write_text(sums, encoding="utf-8")


def kept() -> str:
    """Return the verdicts of this release and the marks of its citations, as TOML.

    The marks of earlier releases are included.
    """
    lines = [f'version = "{__version__}"', f'released = "{RELEASED}"']
    lines += [f'commit = "{commit(ROOT)[:10]}"', "", "[verdicts]"]
    for word in VERDICTS:
        cells = [cell for cell, one in frozen().items() if one.verdict == word]
        lines.append(f"{word} = {json.dumps(cells, indent=4)}")
    marks = [mark(statement(record)) for record in whole_ledger().records]
    lines += ["", "[marks]"]
    lines += [
        f'"{name}" = {json.dumps(found, indent=4)}'
        for name, found in {**released(), version(): marks}.items()
    ]
    return "\n".join(lines) + "\n"


DESCRIBE = {"CITATION.cff": citation, "codemeta.json": codemeta}
DESCRIBE |= {"data/datapackage.json": datapackage}
WRITTEN = {"describe": DESCRIBE, "keep": {"data/last-release.toml": kept}}

if __name__ == "__main__":
    if sys.argv[1:]:
        for name, text in WRITTEN[sys.argv[1]].items():
            (ROOT / name).write_text(text(), encoding="utf-8")
        sys.exit()
    target = ROOT / "dist" / "release"
    shutil.rmtree(target, ignore_errors=True)
    make(ROOT / "book/_build/html", target)
    print(f"The files of the release: {target}")
    for name in TAKEN:
        if not (target / name).is_file():
            print(f"Missing: the site has no {name}")
