"""Promises between the project's own files."""

import hashlib
import json
import math
import os
import re
import subprocess
import tomllib
from pathlib import Path

import jsonschema
import pytest
import yaml

import reproduce
from reproduce import units
from reproduce.store import studies

ROOT = Path(__file__).resolve().parents[1]
# Hosts of package registries, and folders that exist on one machine only.
FOREIGN = re.compile(
    r"(pypi\.org|pythonhosted\.org|npmjs\.(org|com)|deb\.debian\.org|(?<!no-emit-)index-url"
    r"|(?<![\w.~}>])/(root|home/\w+|Users/\w+|opt|work)/)"
)


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf8")


@pytest.fixture(scope="module")
def project() -> dict:
    return tomllib.loads(read("pyproject.toml"))


READERS, TESTS, PAGES = LOCKS = (
    "environment.txt",
    "tools/environment-test.txt",
    "tools/environment-notebooks.txt",
)


def locked(lock: str) -> dict[str, str]:
    """Name and version of every package in a lock."""
    return dict(re.findall(r"^([a-z0-9._-]+)==([^ ;\\]+)", read(lock), re.MULTILINE))


def test_one_version_everywhere() -> None:
    newest = re.search(
        r"^## \[(\d\S*)\] - (\d{4}-\d\d-\d\d)$", read("CHANGELOG.md"), re.MULTILINE
    )
    citation = yaml.safe_load(read("CITATION.cff"))
    assert newest is not None
    assert (newest[1], newest[2]) == (reproduce.__version__, citation["date-released"])
    assert citation["version"] == reproduce.__version__


def test_build_reads_the_version_from_the_package(project: dict) -> None:
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "src/reproduce/version.py"


def test_citation_file_keeps_its_format() -> None:
    schema = json.loads(read("tests/data/citation-file-format-1.2.0.json"))
    # Dates are text in the schema.
    citation = yaml.load(read("CITATION.cff"), Loader=yaml.BaseLoader)
    validator = jsonschema.Draft7Validator(schema)
    assert [error.message for error in validator.iter_errors(citation)] == []
    del citation["authors"]
    assert not validator.is_valid(citation)


def test_both_papers_are_cited() -> None:
    citation = yaml.safe_load(read("CITATION.cff"))
    bibliography = read("data/references.bib")
    for reference in citation["references"]:
        assert reference["doi"] in bibliography


def test_licences_are_complete_and_linked(project: dict) -> None:
    assert "Permission is hereby granted, free of charge" in read("LICENSE")
    assert "Attribution 4.0 International" in read("LICENSE-TEXT")
    assert "Section 8 -- Interpretation." in read("LICENSE-TEXT")
    assert project["project"]["license-files"] == ["LICENSE", "LICENSE-TEXT"]
    for page in ("README.md", "book/index.md"):
        assert re.findall(r"\bLICENSE(?:-TEXT)?\b", read(page)), page


@pytest.mark.parametrize("lock", LOCKS)
def test_lock_names_the_command_that_makes_it(lock: str) -> None:
    named = read(lock).splitlines()[1].lstrip("# ").split()
    makefile = read("Makefile").replace("\\\n", " ")
    common = re.search(r"^COMPILE = \$\(PY\) -m uv (.*)$", makefile, re.MULTILINE)
    recipe = re.search(
        rf"\$\(COMPILE\) (.*--output-file {re.escape(lock)}.*)", makefile
    )
    assert common is not None
    assert recipe is not None
    # uv leaves out of the head what does not bear on the result.
    written = {*common[1].split(), *recipe[1].split()} - {"--quiet", "--upgrade"}
    assert set(named) - {"uv"} == written


def test_locks_cover_every_dependency(project: dict) -> None:
    extras = project["project"]["optional-dependencies"]
    reader = [
        *project["build-system"]["requires"],
        *project["project"]["dependencies"],
        *project["dependency-groups"]["lock"],
        *extras["book"],
        *extras["images"],
        *extras["notebooks"],
    ]
    for lock, wanted in (
        (READERS, reader),
        (
            PAGES,
            project["project"]["dependencies"] + extras["notebooks"] + extras["images"],
        ),
        (
            TESTS,
            reader
            + [requirement for extra in extras.values() for requirement in extra],
        ),
    ):
        names = {re.split(r"[^a-z0-9._-]", requirement)[0] for requirement in wanted}
        # An extra may stand for another one of the project.
        assert names - set(locked(lock)) - {project["project"]["name"]} == set()


def test_the_lock_of_the_tests_holds_that_of_the_reader() -> None:
    reader = locked(READERS)
    tests = locked(TESTS)
    assert {name: tests.get(name) for name in reader} == reader


def test_who_runs_a_page_installs_a_part_of_what_builds_the_book() -> None:
    """And is told how many packages that is."""
    reader, pages = locked(READERS), locked(PAGES)
    assert {name: reader.get(name) for name in pages} == pages
    assert not {"sphinx", "jupyter-book", "myst-nb"} & set(pages)
    (told,) = studies.table("installed")["packages"]
    assert told == len(pages) < 0.8 * len(reader)


def test_a_reader_installs_nothing_of_the_tests() -> None:
    ours = {
        "pytest",
        "hypothesis",
        "mypy",
        "ruff",
        "playwright",
        "scikit-image",
        "dask",
    }
    ours |= {"opencv-python-headless", "frictionless", "rdflib"}
    assert ours <= set(locked(TESTS))
    assert not ours & set(locked(READERS))


@pytest.mark.parametrize("lock", LOCKS)
def test_every_locked_package_has_a_hash(lock: str) -> None:
    blocks = re.split(r"\n(?=[a-z0-9])", read(lock))
    hashed = [block for block in blocks if "--hash=sha256:" in block]
    assert len(hashed) == len(locked(lock))


def test_every_dependency_says_what_it_is_for(project: dict) -> None:
    rows = [
        line.split("|")[1]
        for line in read("CONTRIBUTING.md").splitlines()
        if "|" in line
    ]
    told = set(re.findall(r"[a-z0-9-]+", " ".join(rows)))
    extras = project["project"]["optional-dependencies"].values()
    wanted = project["project"]["dependencies"] + [
        one for extra in extras for one in extra
    ]
    named = {re.split(r"[^a-z0-9._-]", one)[0] for one in wanted}
    assert named - told - {project["project"]["name"]} == set()


def test_dependencies_have_lower_bounds(project: dict) -> None:
    assert [
        item for item in project["project"]["dependencies"] if ">=" not in item
    ] == []


def tracked_files() -> list[Path]:
    """Return the files git knows or would add."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    # A hook's own repository variables must not point git elsewhere.
    clean = {
        name: value for name, value in os.environ.items() if not name.startswith("GIT_")
    }
    listed = subprocess.run(
        command, cwd=ROOT, env=clean, capture_output=True, text=True
    )
    if listed.returncode:
        pytest.skip("not a git checkout")
    return [
        ROOT / name for name in listed.stdout.splitlines() if (ROOT / name).is_file()
    ]


def test_no_file_names_a_registry_or_a_machine() -> None:
    faults = []
    for path in tracked_files():
        if path == Path(__file__):
            continue
        text = path.read_text(encoding="utf8", errors="ignore")
        faults += [
            f"{path.relative_to(ROOT)}: {hit[0]}" for hit in FOREIGN.finditer(text)
        ]
    assert faults == []


def test_angle_factors_have_one_home():
    """A factor typed again, or one name for both directions, is wrong by ten powers unseen."""
    typed = re.compile(
        r"\b(206264|206265|3437\.7|648000|4\.848|2\.908)|\b3600\b|\bARC(SEC|MIN)\b"
    )
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in sorted((ROOT / "src").rglob("*.py"))
        if path.name != "units.py"
        for line in path.read_text(encoding="utf-8").splitlines()
        if typed.search(line) and not line.strip().startswith(">>>")
    ]
    assert found == []


def test_angle_factors():
    assert units.ARCSEC_PER_RADIAN * math.radians(1) == pytest.approx(3600, rel=1e-15)
    assert units.ARCMIN_PER_RADIAN * math.radians(1) == pytest.approx(60, rel=1e-15)
    assert (
        pytest.approx(1, rel=1e-15)
        == units.ARCSEC_PER_RADIAN * units.RADIANS_PER_ARCSEC
    )


def test_files_of_instruments_are_those_of_their_readme() -> None:
    for path in sorted((ROOT / "data/instruments").rglob("*.*")):
        if path.suffix not in {".md", ".txt"}:
            stated = (path.parent / "README.md").read_text(encoding="utf-8")
            found = hashlib.sha256(path.read_bytes()).hexdigest()
            assert re.search(rf"`{re.escape(path.name)}`.*`{found}`", stated), path
