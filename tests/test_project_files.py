"""Files of the project: versions, licences, locks, dependencies, units."""

import hashlib
import json
import os
import re
import subprocess
import tomllib

import jsonschema
import pytest
import yaml
from places import ROOT

import reproduce
from release import licence_of
from reproduce.store import studies
from reproduce.version import AUTHORS

# Hosts of package registries, and folders of one machine.
FOREIGN = re.compile(
    r"(pypi\.org|pythonhosted\.org|npmjs\.(org|com)|deb\.debian\.org|(?<!no-emit-)index-url"
    r"|(?<![\w.~}>])/(root|home/\w+|Users/\w+|opt|work)/)"
)
# Factors between angles, or a name for both directions.
ANGLES = re.compile(
    r"\b(206264|206265|3437\.7|648000|4\.848|2\.908)|\b3600\b|\bARC(SEC|MIN)\b"
)


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


PROJECT = tomllib.loads(read("pyproject.toml"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
DEPENDENCIES = PROJECT["project"]["dependencies"]
LOCKS = [
    "environment.txt",
    "tools/environment-test.txt",
    "tools/environment-notebooks.txt",
]
LOCKED = [
    dict(re.findall(r"^([a-z0-9._-]+)==([^ ;\\]+)", read(n), re.M)) for n in LOCKS
]


def packages(requirements):
    """Return the names of the packages. An extra may name another extra of the project."""
    names = {re.split(r"[^a-z0-9._-]", requirement)[0] for requirement in requirements}
    return names - {PROJECT["project"]["name"]}


def test_version_citation_and_licences_agree():
    newest = re.search(r"^## \[(\d\S*)\] - (\S+)$", read("CHANGELOG.md"), re.MULTILINE)
    cited = yaml.safe_load(read("CITATION.cff"))
    release = (cited["version"], str(cited["date-released"]))
    assert newest.groups() == release
    assert cited["version"] == reproduce.__version__
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "src/reproduce/version.py"
    schema = json.loads(read("tests/data/citation-file-format-1.2.0.json"))
    # Dates are text in the schema.
    document = yaml.load(read("CITATION.cff"), Loader=yaml.BaseLoader)
    validator = jsonschema.Draft7Validator(schema)
    assert [error.message for error in validator.iter_errors(document)] == []
    assert [one["name"] for one in PROJECT["project"]["authors"]] == [*AUTHORS]


def test_the_licence_of_the_wheel_is_that_of_its_files():
    """The texts of all licences are in the wheel."""
    files = [path for name in ("src", "data") for path in (ROOT / name).rglob("*.*")]
    names = [path.relative_to(ROOT).as_posix() for path in files]
    expression = PROJECT["project"]["license"].split(" AND ")
    assert {licence_of(name) for name in names} == {*expression}
    stated = PROJECT["project"]["license-files"]
    texts = {path for name in stated for path in ROOT.glob(name)}
    own = {"MIT": "LICENSE", "CC-BY-4.0": "LICENSE-TEXT"}
    licences = [own.get(name, f"LICENSES/{name}.txt") for name in expression]
    assert {ROOT / name for name in licences} == texts
    for name in own:
        assert read(f"LICENSES/{name}.txt") in read(own[name])


def test_locks_are_complete_and_made_by_make():
    make = read("Makefile").replace("\\\n", " ")
    (common,) = re.findall(r"^COMPILE = \$\(PY\) -m uv (.*)$", make, re.MULTILINE)
    for lock, locked in zip(LOCKS, LOCKED, strict=True):
        named = set(read(lock).splitlines()[1].lstrip("# ").split()) - {"uv"}
        output = re.escape(lock)
        (own,) = re.findall(rf"\$\(COMPILE\) (.*--output-file {output}.*)", make)
        # uv omits options without an effect on the result.
        assert named == {*common.split(), *own.split()} - {"--quiet", "--upgrade"}
        blocks = re.split(r"\n(?=[a-z0-9])", read(lock))
        assert sum("--hash=sha256:" in block for block in blocks) == len(locked)


def test_locks_have_every_dependency_in_one_version():
    book, tests, notebooks = LOCKED
    every = DEPENDENCIES + [name for extra in EXTRAS.values() for name in extra]
    pages = DEPENDENCIES + EXTRAS["notebooks"] + EXTRAS["images"]
    tools = PROJECT["build-system"]["requires"] + PROJECT["dependency-groups"]["lock"]
    assert packages(pages) <= set(notebooks)
    assert packages(pages + EXTRAS["book"] + tools) <= set(book)
    assert packages(every + tools) <= set(tests)
    assert notebooks.items() <= book.items() <= tests.items()
    assert not {"sphinx", "jupyter-book", "myst-nb"} & set(notebooks)
    (count,) = studies.table("installed")["packages"]
    assert count == len(notebooks)
    rows = [line for line in read("CONTRIBUTING.md").splitlines() if line[:1] == "|"]
    assert packages(every) <= set(re.findall(r"[a-z0-9-]+", " ".join(rows)))
    assert all(">=" in requirement for requirement in DEPENDENCIES)


def git(*words):
    # The variables of a hook would name another repository.
    clean = {name: v for name, v in os.environ.items() if name[:4] != "GIT_"}
    return subprocess.run(
        ["git", *words], cwd=ROOT, env=clean, capture_output=True, text=True
    )


def test_a_tag_is_the_version():
    """A release of a tag with another version than that of the code fails."""
    tags = [
        tag for tag in git("tag", "--points-at", "HEAD").stdout.split() if tag[0] == "v"
    ]
    assert tags in ([], [f"v{reproduce.__version__}"])


def test_no_file_names_a_registry_or_a_machine():
    listed = git("ls-files", "--cached", "--others", "--exclude-standard")
    if listed.returncode:
        pytest.skip("not a git checkout")
    names = {*listed.stdout.splitlines()} - {"tests/test_project_files.py"}
    files = [ROOT / name for name in names if (ROOT / name).is_file()]
    texts = {path: path.read_text(encoding="utf-8", errors="ignore") for path in files}
    assert [path for path, text in texts.items() if FOREIGN.search(text)] == []


def test_angle_factors_are_defined_once():
    for path in set((ROOT / "src").rglob("*.py")) - {ROOT / "src/reproduce/units.py"}:
        lines = [line for line in read(path).splitlines() if ">>>" not in line]
        assert [line for line in lines if ANGLES.search(line)] == [], path


def test_files_of_instruments_have_the_checksums_of_their_readme():
    for path in (ROOT / "data/instruments").rglob("*.*"):
        if path.suffix not in {".md", ".txt"}:
            stated, digest = (
                read(path.parent / "README.md"),
                hashlib.sha256(path.read_bytes()),
            )
            name = re.escape(path.name)
            assert re.search(rf"`{name}`.*`{digest.hexdigest()}`", stated), path
