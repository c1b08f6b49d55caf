"""The files of a release: equal each time, described for other software, valid."""

import csv
import io
import json
import shutil
import tarfile
import tomllib
import warnings
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import frictionless
import pytest
import rdflib
import requests
import rocrate
import yaml
from packaging.metadata import Metadata
from places import ROOT
from rocrate_validator import services
from rocrate_validator.utils.http import HttpRequester

import release
from pack_book import build_wheel
from reproduce.judge.ledger import frozen
from reproduce.version import __version__, version
from reproduce.views.citations import cite

CONTEXTS = ROOT / "tests" / "data"
SITE = {f"page-{letter}.html": f"<p>{letter}" for letter in "sphinxmyrtu"}
SITE |= {"index.html": "<p>Hello", "niu2024/own.html": "<p>Stars", "ledger.json": "{}"}
READ_BY_TWINE_7 = {"2.1", "2.2", "2.3", "2.4", "2.5"}
OLD_GRAPH = "ignore:ConjunctiveGraph is deprecated:DeprecationWarning"


def test_descriptions_come_from_one_source(monkeypatch):
    for name, text in release.DESCRIBE.items():
        assert (ROOT / name).read_text("utf-8") == text(), (
            "python tools/release.py describe"
        )
    assert not {"url", "doi"} & set(yaml.safe_load(release.citation()))
    address, doi = "https://example.org/book", "10.1/x"
    monkeypatch.setattr(release, "ADDRESS", address)
    monkeypatch.setattr(release, "DOI", doi)
    monkeypatch.setattr(release, "AUTHORS", ("Doe, Jane", "The others"))
    cited, code = yaml.safe_load(release.citation()), json.loads(release.codemeta())
    assert (cited["url"], cited["doi"]) == (address, doi)
    person = {"family-names": "Doe", "given-names": "Jane"}
    assert cited["authors"] == [person, {"name": "The others"}]
    assert [one["@type"] for one in code["author"]] == ["Person", "Organization"]
    assert (code["url"], code["identifier"]) == (address, f"https://doi.org/{doi}")


def faults(data):
    """Return the faults that Frictionless finds in the data package of a folder."""
    with warnings.catch_warnings():
        # Frictionless does not close a compressed file.
        warnings.simplefilter("ignore", ResourceWarning)
        limit = csv.field_size_limit()  # Frictionless changes it for the whole process
        report = frictionless.validate(str(data / "datapackage.json"))
        csv.field_size_limit(limit)
    return [kind for _, kind in report.flatten(["name", "type"])]


def test_the_data_are_a_valid_package_of_all_files(tmp_path):
    data = Path(shutil.copytree(ROOT / "data", tmp_path / "data"))
    assert faults(data) == []
    text = (data / "datapackage.json").read_text(encoding="utf-8")
    resources = json.loads(text)["resources"]
    files = {p.relative_to(data).as_posix() for p in data.rglob("*") if p.is_file()}
    other = {p for p in files if p.endswith(("README.md", "datapackage.json"))}
    assert sorted(one["path"] for one in resources) == sorted(files - other)
    assert len({one["name"] for one in resources}) == len(resources)
    (data / "printed/second-entry.csv").write_text("address,number")
    assert "incorrect-label" in faults(data)


def names_of(value):
    """Yield the names and types of a JSON-LD document, at every depth."""
    if isinstance(value, dict):
        yield from (name for name in value if not name.startswith("@"))
        yield from [value["@type"]] if "@type" in value else []
    if isinstance(value, list | dict):
        parts = value.values() if isinstance(value, dict) else value
        for part in parts:
            yield from names_of(part)


@pytest.mark.filterwarnings(OLD_GRAPH)
def test_codemeta_has_only_names_of_its_context_and_expands():
    document = json.loads(release.codemeta())
    named, more = document["@context"]
    assert named == "https://w3id.org/codemeta/3.0"
    text = (CONTEXTS / "codemeta-3.0-context.json").read_text(encoding="utf-8")
    context = json.loads(text)["@context"]
    content = {name: value for name, value in document.items() if name != "@context"}
    assert set(names_of(content)) <= set(context) | set(more)
    document["@context"][0] = context
    graph = rdflib.Graph().parse(data=json.dumps(document), format="json-ld")
    schema = rdflib.Namespace("http://schema.org/")
    (software,) = graph.subjects(rdflib.RDF.type, schema.SoftwareSourceCode)
    assert graph.value(software, schema.version) == rdflib.Literal(__version__)
    licences = {str(one) for one in graph.objects(software, schema.license)}
    stated = yaml.safe_load(release.citation())["license"]
    assert licences == {release.SPDX + name for name in stated}
    papers = set(graph.objects(software, schema.citation))
    assert rdflib.URIRef("https://doi.org/10.3390/s24010259") in papers


def missed(crate):
    """Return the faults of an RO-Crate, without a network."""
    settings = services.ValidationSettings(
        rocrate_uri=str(crate),
        profile_identifier="ro-crate-1.3",
        offline=True,
        cache_path=crate.parent / "cache",
    )
    return [issue.message for issue in services.validate(settings).get_issues()]


@pytest.mark.nightly
@pytest.mark.filterwarnings(OLD_GRAPH)
def test_the_crate_is_valid(tmp_path, monkeypatch):
    """The validation takes a minute."""

    def get(self, url, **_):
        assert url == "https://w3id.org/ro/crate/1.3/context"
        answer = requests.Response()
        answer.status_code, answer.url = 200, url
        answer.headers["Content-Type"] = "application/ld+json"
        answer.raw = io.BytesIO(
            Path(rocrate.__file__)
            .with_name("data")
            .joinpath("ro-crate.jsonld")
            .read_bytes()
        )
        return answer

    monkeypatch.setattr(HttpRequester, "get", get, raising=False)
    crate = tmp_path / "crate"
    crate.mkdir()
    for end in release.FILES:
        name = end if end in release.TAKEN else f"x{end}"
        (crate / name).write_text(end, encoding="utf-8")
    release.write_crate(crate)
    assert missed(crate) == []
    path = crate / "ro-crate-metadata.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    root = next(part for part in document["@graph"] if part["@id"] == "./")
    names = {p.name for p in crate.iterdir()} - {path.name}
    assert {part["@id"] for part in root["hasPart"]} == names


def insides(path):
    """Return the files of an archive, or the file itself, by name."""
    if path.suffix in {".whl", ".zip"}:
        with ZipFile(path) as packed:
            return {name: packed.read(name) for name in packed.namelist()}
    if path.suffix == ".gz":
        with tarfile.open(path) as packed:
            files = [entry for entry in packed if entry.isfile()]
            return {entry.name: packed.extractfile(entry).read() for entry in files}
    return {path.name: path.read_bytes()}


@pytest.mark.slow
def test_two_releases_in_different_folders_are_equal(tmp_path):
    made = []
    for place, names in (("here", list(SITE)), ("there", list(SITE)[::-1])):
        site, folder = tmp_path / place / "html", tmp_path / place / "release"
        for name in names:
            (site / name).parent.mkdir(parents=True, exist_ok=True)
            (site / name).write_text(SITE[name], encoding="utf-8")
        release.make(site, folder)
        made.append({path.name: path.read_bytes() for path in folder.iterdir()})
    files = made[0]
    assert files == made[1]
    absent = {end for end in release.FILES if not any(n.endswith(end) for n in files)}
    assert absent == set(release.TAKEN) - set(SITE)
    lines = files.pop("SHA256SUMS").decode().splitlines()
    sums = {name: sha256(content).hexdigest() for name, content in files.items()}
    assert dict(line.split("  ")[::-1] for line in lines) == sums
    for path in folder.iterdir():
        for name, content in insides(path).items():
            assert str(tmp_path).encode() not in content, name
            assert str(ROOT).encode() not in content, name
    (site,) = folder.glob("*-site.zip")
    assert [*insides(site).values()] == [SITE[name].encode() for name in sorted(SITE)]


def test_a_built_package_contains_the_address_of_the_book(tmp_path, monkeypatch):
    address, doi = "https://example.org/book", "10.1/x"
    monkeypatch.setenv("REPRODUCE_ADDRESS", address)
    monkeypatch.setenv("REPRODUCE_DOI", doi)
    build_wheel(ROOT, tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    files = {name.rpartition("/")[2]: text for name, text in insides(wheel).items()}
    assert files["_commit"].decode().split("\n")[1:] == [address, doi]
    # twine 7, in the pinned publisher, validates with this class.
    metadata = Metadata.from_email(files["METADATA"])
    assert metadata.metadata_version in READ_BY_TWINE_7
    urls = metadata.project_urls
    assert urls["Homepage"] == address
    assert all(url.startswith(address) for url in urls.values())


def test_the_verdicts_and_marks_of_a_release_are_stored(monkeypatch):
    earlier = {"0.0.1, 2026-01-01, commit x": ["rp:0"]}
    monkeypatch.setattr(release, "released", lambda: earlier)
    kept = tomllib.loads(release.kept())
    verdicts = {
        cell: word for word, cells in kept["verdicts"].items() for cell in cells
    }
    assert verdicts == {cell: one.verdict for cell, one in frozen().items()}
    assert kept["version"] == __version__
    assert kept["marks"].keys() == {*earlier, version()}
    marks = kept["marks"][version()]
    assert len(marks) == len(frozen())
    line = cite("niu2024/table-3#scale.red", "text").partition("\n")[0]
    assert line.rpartition(" ")[2] in marks
