"""Promises between the project's own files."""

import math
import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

import reproduce
from reproduce import units

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


@pytest.fixture(scope="module")
def locked() -> dict[str, str]:
    """Name and version of every package in the lock."""
    return dict(re.findall(r"^([a-z0-9._-]+)==([^ ;\\]+)", read("environment.txt"), re.MULTILINE))


def test_one_version_everywhere() -> None:
    newest = re.search(r"^## (\d\S*), (\d{4}-\d\d-\d\d)$", read("CHANGELOG.md"), re.MULTILINE)
    citation = yaml.safe_load(read("CITATION.cff"))
    assert newest is not None
    assert (newest[1], newest[2]) == (reproduce.__version__, citation["date-released"])
    assert citation["version"] == reproduce.__version__


def test_build_reads_the_version_from_the_package(project: dict) -> None:
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "src/reproduce/__init__.py"


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


def test_lock_names_the_command_that_makes_it() -> None:
    named = read("environment.txt").splitlines()[1].lstrip("# ").split()
    recipe = re.search(r"uv (pip compile(?:.*\\\n)*.*)", read("Makefile"))
    assert recipe is not None
    # uv leaves out of the head what does not bear on the result.
    written = set(recipe[1].replace("\\\n", " ").split()) - {"--quiet", "--upgrade"}
    assert set(named) - {"uv"} == written


def test_lock_covers_every_dependency(project: dict, locked: dict[str, str]) -> None:
    extras = project["project"]["optional-dependencies"].values()
    wanted = [
        *project["build-system"]["requires"],
        *project["project"]["dependencies"],
        *project["dependency-groups"]["lock"],
        *(requirement for extra in extras for requirement in extra),
    ]
    names = {re.split(r"[^a-z0-9._-]", requirement)[0] for requirement in wanted}
    assert names - set(locked) == set()


def test_every_locked_package_has_a_hash(locked: dict[str, str]) -> None:
    blocks = re.split(r"\n(?=[a-z0-9])", read("environment.txt"))
    hashed = [block for block in blocks if "--hash=sha256:" in block]
    assert len(hashed) == len(locked)


def test_dependencies_have_lower_bounds(project: dict) -> None:
    assert [item for item in project["project"]["dependencies"] if ">=" not in item] == []


def tracked_files() -> list[Path]:
    """Return the files git knows or would add."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    # A hook's own repository variables must not point git elsewhere.
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    listed = subprocess.run(command, cwd=ROOT, env=clean, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


def test_no_file_names_a_registry_or_a_machine() -> None:
    faults = []
    for path in tracked_files():
        if path == Path(__file__):
            continue
        text = path.read_text(encoding="utf8", errors="ignore")
        faults += [f"{path.relative_to(ROOT)}: {hit[0]}" for hit in FOREIGN.finditer(text)]
    assert faults == []


def test_angle_factors_have_one_home():
    """A factor typed again, or one name for both directions, is wrong by ten powers unseen."""
    typed = re.compile(r"\b(206264|206265|3437\.7|648000|4\.848|2\.908)|\b3600\b|\bARC(SEC|MIN)\b")
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
    assert pytest.approx(1, rel=1e-15) == units.ARCSEC_PER_RADIAN * units.RADIANS_PER_ARCSEC
