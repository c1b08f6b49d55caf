"""A release is the same whenever it is made, and what it says of itself holds before validators."""

import csv
import io
import json
import re
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
import yaml
from rocrate_validator import services
from rocrate_validator.utils.http import HttpRequester

import release
from reproduce.judge.ledger import frozen
from reproduce.version import __version__, version
from reproduce.views.export import citation

ROOT = Path(__file__).parents[2]
CONTEXTS = ROOT / "tests" / "data"
SITE = {f"page-{letter}.html": f"<p>{letter}" for letter in "sphinxmyrtu"}
SITE |= {"index.html": "<p>Hello", "niu2024/own.html": "<p>Stars", "ledger.json": "{}"}


@pytest.mark.parametrize("name", release.DESCRIBE)
def test_what_the_project_is_comes_from_one_source(name):
    told = "run `python tools/release.py describe`"
    assert (ROOT / name).read_text(encoding="utf-8") == release.DESCRIBE[name](), told


def test_address_and_doi_are_told_once_there_are_some(monkeypatch):
    assert not {"url", "doi"} & set(yaml.safe_load(release.citation()))
    monkeypatch.setattr(release, "ADDRESS", "https://example.org/book")
    monkeypatch.setattr(release, "DOI", "10.1/x")
    citation, code = yaml.safe_load(release.citation()), json.loads(release.codemeta())
    assert (citation["url"], citation["doi"]) == ("https://example.org/book", "10.1/x")
    assert (code["url"], code["identifier"]) == (
        citation["url"],
        "https://doi.org/10.1/x",
    )


# The data as a Frictionless package.


@pytest.fixture
def data(tmp_path):
    return Path(shutil.copytree(ROOT / "data", tmp_path / "data"))


def faults(data):
    with warnings.catch_warnings():
        # It leaves the compressed file open below what it unpacks.
        warnings.simplefilter("ignore", ResourceWarning)
        limit = csv.field_size_limit()  # which it changes for the whole process
        report = frictionless.validate(str(data / "datapackage.json"))
        csv.field_size_limit(limit)
    return [type_ for _, type_ in report.flatten(["name", "type"])]


def test_the_data_are_a_valid_package_that_leaves_out_no_file(data):
    assert faults(data) == []
    listed = json.loads((data / "datapackage.json").read_text(encoding="utf-8"))[
        "resources"
    ]
    files = {
        path.relative_to(data).as_posix() for path in data.rglob("*") if path.is_file()
    }
    described = {
        path for path in files if path.endswith(("README.md", "datapackage.json"))
    }
    assert {one["path"] for one in listed} == files - described
    assert len({one["name"] for one in listed}) == len(listed)


@pytest.mark.parametrize(
    ("name", "old", "new", "fault"),
    [
        ("stars/spectra.csv", "390,", "red,", "type-error"),
        (
            "printed/second-entry.csv",
            "address,value",
            "address,number",
            "incorrect-label",
        ),
        (
            "datapackage.json",
            '"path": "errata.toml"',
            '"path": "nothing.toml"',
            "scheme-error",
        ),
    ],
)
def test_a_slip_in_the_data_is_seen(data, name, old, new, fault):
    path = data / name
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    assert fault in faults(data)


# codemeta.json by its context.


def known(value, context):
    """Whether every name of a document, at every depth, is in a context."""
    if isinstance(value, list):
        return all(known(one, context) for one in value)
    if not isinstance(value, dict):
        return True
    names = {name for name in value if not name.startswith("@")} | {
        value.get("@type", "name")
    }
    return names <= set(context) and all(known(one, context) for one in value.values())


def test_codemeta_says_only_what_its_context_knows():
    document = json.loads(release.codemeta())
    named, more = document.pop("@context")
    assert named == "https://w3id.org/codemeta/3.0"
    text = (CONTEXTS / "codemeta-3.0-context.json").read_text(encoding="utf-8")
    context = json.loads(text)["@context"] | more
    assert known(document, context)
    assert not known(
        document | {"author": {"@type": "Organization", "title": "x"}}, context
    )


@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
def test_codemeta_expands():
    document = json.loads(release.codemeta())
    text = (CONTEXTS / "codemeta-3.0-context.json").read_text(encoding="utf-8")
    document["@context"][0] = json.loads(text)["@context"]
    graph = rdflib.Graph().parse(data=json.dumps(document), format="json-ld")
    schema = rdflib.Namespace("http://schema.org/")
    (software,) = graph.subjects(rdflib.RDF.type, schema.SoftwareSourceCode)
    assert graph.value(software, schema.version) == rdflib.Literal(__version__)
    assert len(list(graph.objects(software, schema.license))) == 2
    papers = set(graph.subjects(rdflib.RDF.type, schema.ScholarlyArticle))
    assert papers == set(graph.objects(software, schema.citation))
    assert rdflib.URIRef("https://doi.org/10.3390/s24010259") in papers


# The RO-Crate, without a network.


@pytest.fixture
def crate(tmp_path, monkeypatch):
    def get(self, url, **_):
        names = {"https://w3id.org/ro/crate/1.2/context": "ro-crate-1.2-context.json"}
        answer = requests.Response()
        answer.status_code, answer.url = 200, url
        answer.headers["Content-Type"] = "application/ld+json"
        answer.raw = io.BytesIO((CONTEXTS / names[url]).read_bytes())
        return answer

    monkeypatch.setattr(HttpRequester, "get", get, raising=False)
    folder = tmp_path / "crate"
    folder.mkdir()
    for end in release.FILES:
        (folder / (end if end in release.TAKEN else f"x{end}")).write_text(
            end, encoding="utf-8"
        )
    release.write_crate(folder)
    return folder


def missed(crate):
    settings = services.ValidationSettings(
        rocrate_uri=str(crate),
        profile_identifier="ro-crate-1.2",
        offline=True,
        cache_path=crate.parent / "cache",
    )
    return [issue.message for issue in services.validate(settings).get_issues()]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
def test_the_crate_is_valid(crate):
    assert missed(crate) == []
    path = crate / "ro-crate-metadata.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    root = next(one for one in document["@graph"] if one["@id"] == "./")
    assert {part["@id"] for part in root["hasPart"]} == {
        p.name for p in crate.iterdir()
    } - {path.name}
    del root["license"]
    path.write_text(json.dumps(document), encoding="utf-8")
    (fault,) = missed(crate)
    assert "license" in fault


def test_a_file_that_no_one_describes_is_refused(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(ValueError, match="not enough values"):
        release.write_crate(tmp_path)


# The files of a release.


def site(folder, names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(SITE[name], encoding="utf-8")
    return folder


def insides(path):
    """Return the files of an archive, unpacked."""
    if path.suffix in {".whl", ".zip"}:
        with ZipFile(path) as packed:
            return {name: packed.read(name) for name in packed.namelist()}
    if path.suffix == ".gz":
        with tarfile.open(path) as packed:
            files = [one for one in packed if one.isfile()]
            return {one.name: packed.extractfile(one).read() for one in files}
    return {path.name: path.read_bytes()}


@pytest.mark.slow
def test_a_release_made_twice_elsewhere_is_the_same(tmp_path):
    made = []
    for place, names in (("here", list(SITE)), ("there", list(SITE)[::-1])):
        folder = tmp_path / place / "release"
        release.make(site(tmp_path / place / "html", names), folder)
        made.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert made[0] == made[1]
    absent = {
        end for end in release.FILES if not any(name.endswith(end) for name in made[0])
    }
    assert absent == set(release.TAKEN) - set(SITE)
    sums = made[0].pop("SHA256SUMS").decode()
    told = {name: sha256(content).hexdigest() for name, content in made[0].items()}
    assert dict(line.split("  ")[::-1] for line in sums.splitlines()) == told
    for path in folder.iterdir():
        for name, content in insides(path).items():
            assert str(tmp_path).encode() not in content, name
            assert str(ROOT).encode() not in content, name
    packed = insides(folder / f"reproduce-pointing-{__version__}-site.zip")
    start = f"reproduce-pointing-{__version__}-site/"
    assert packed == {
        start + name: text.encode() for name, text in sorted(SITE.items())
    }
    assert list(packed) == sorted(packed)


def test_the_verdicts_that_are_kept_are_the_frozen_ones():
    kept = tomllib.loads(release.kept())
    verdicts = {
        cell: word for word, cells in kept["verdicts"].items() for cell in cells
    }
    assert verdicts == {cell: one.verdict for cell, one in frozen().items()}
    assert kept["version"] == __version__


def test_the_marks_of_citations_are_kept_with_those_of_earlier_releases(monkeypatch):
    monkeypatch.setattr(
        release, "released", lambda: {"0.0.1, 2026-01-01, commit x": ["rp:0"]}
    )
    kept = tomllib.loads(release.kept())["marks"]
    assert kept.pop("0.0.1, 2026-01-01, commit x") == ["rp:0"]
    ((source, marks),) = kept.items()
    assert source == version()
    assert len(marks) == len(frozen())
    for address in ("niu2024/table-3#scale.red", "niu2024/table-1#focal-length.red"):
        assert citation(address, "text").partition("\n")[0].rpartition(" ")[2] in marks


# The workflows.


@pytest.mark.parametrize("name", ["nightly", "release", "tests"])
def test_workflows_run_existing_targets_and_pin_their_actions(name):
    text = (ROOT / f".github/workflows/{name}.yml").read_text(encoding="utf-8")
    jobs = yaml.safe_load(text)["jobs"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", makefile, re.M)
    steps = [step for job in jobs.values() for step in job["steps"]]
    runs = [step["run"].split() for step in steps if "run" in step]
    programs = {run[0] for run in runs}
    assert programs <= {"make", ".ci/run", "gh", "python"}
    assert {run[1] for run in runs if run[0] == "make"} <= set(targets)
    actions = [step["uses"] for step in steps if "uses" in step]
    assert actions
    for action in actions:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action)
    for step in steps:  # a shallow clone has no history to compare dates with
        if step.get("uses", "").startswith("actions/checkout@"):
            assert step["with"]["fetch-depth"] == 0
    for job in jobs.values():
        assert {job.get("needs", next(iter(jobs)))} <= set(jobs)
        if "environment" in job:
            contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
            assert f"`{job['environment']}`" in contributing
