"""The arrows of the design: which folder may import which."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "src" / "reproduce"

# Folder -> what it may import from the project. A dotted name allows that module alone.
ARROWS = {
    "physics": {"physics", "units"},
    "printed": {"printed", "locate", "units"},
    "store": {"store", "locate", "physics.validate"},
    "inference": {"inference", "physics", "units"},
    "papers": {
        *{"papers", "inference", "physics", "store", "printed.inputs", "units"},
        *{"locate.papers", "locate.search_path"},
        *{"locate.schematic_files", "locate.caption_files"},
    },
    "judge": {"judge", "papers", "printed", "locate", "store.studies"},
    "consistency": {"consistency", "printed", "physics"},
    "views": {
        *{"views", "judge", "consistency", "inference", "store", "printed", "papers"},
        *{"locate", "units", "version"},
        *{"physics.registration", "physics.attitude", "physics.images"},
    },
}
# The same inside physics: its rooms stand on each other, on the checks of input and on units.
ROOMS = {
    "optics": {"optics"},
    "attitude": {"attitude"},
    "images": {"images"},
    "registration": {"registration", "optics"},
    "raytrace": {"raytrace", "attitude"},
    "ground": {"ground", "attitude"},
}
PHYSICS_MAY_NOT = {
    "pathlib",
    "io",
    "os",
    "tomllib",
    "json",
    "csv",
    "pandas",
    "importlib",
}
FILES = sorted(SOURCE.rglob("*.py"))


def imports(path):
    """Yield the modules that a file imports; relative imports as a leading dot."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                yield "." * node.level + (node.module or "")
            elif node.module and node.module.startswith("reproduce"):
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
            else:
                yield node.module or ""


def violations(path, folder):
    """Yield the imports that the arrows forbid."""
    for name in imports(path):
        if name.startswith("."):
            yield f"{name} (relative)"
        elif name == "reproduce":
            yield f"{name} (the front door stands above all rooms)"
        elif name.startswith("reproduce."):
            inner = name.removeprefix("reproduce.")
            allowed = any(
                inner == a or inner.startswith(f"{a}.") for a in ARROWS[folder]
            )
            if not allowed:
                yield name
        elif folder == "physics" and name.split(".")[0] in PHYSICS_MAY_NOT:
            yield f"{name} (physics reads no file)"


def climbs(path, room):
    """Yield the imports from rooms of physics that a room does not stand on."""
    for name in imports(path):
        if name.startswith("reproduce.physics."):
            other = name.split(".")[2]
            if other != "validate" and other not in ROOMS[room]:
                yield name


def test_imports_follow_the_arrows():
    bare = {name: [] for name in ("locate.py", "units.py", "version.py")}
    allowed = bare | {
        "__init__.py": ["reproduce.version.__version__"],
        "__main__.py": ["reproduce.views.cli.main"],
    }
    for path in FILES:
        folder, *rest = path.relative_to(SOURCE).parts
        if not rest:
            inner = [name for name in imports(path) if name.startswith("reproduce")]
            assert inner == allowed[path.name], path
            continue
        assert list(violations(path, folder)) == [], path
        room = rest[0].removesuffix(".py")
        if folder == "physics" and room in ROOMS:
            assert list(climbs(path, room)) == [], path


def test_physics_opens_no_file():
    opening = {"open", "load", "loadtxt", "genfromtxt", "fromfile", "read_text"}
    for path in (SOURCE / "physics").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = ast.unparse(node.func).rpartition(".")[2]
                assert name not in opening, path


@pytest.mark.parametrize(
    ("folder", "line"),
    [
        ("physics", "from reproduce.printed import cells"),
        ("physics", "import pathlib"),
        ("papers", "from reproduce.printed.cells import library"),
        ("papers", "from reproduce.judge import ledger"),
        ("judge", "from reproduce.views import keys"),
        ("store", "from reproduce.papers import catalogue"),
        ("views", "from reproduce.physics import camera"),
        ("views", "from . import captions"),
        ("views", "import reproduce"),
    ],
)
def test_forbidden_imports_are_seen(tmp_path, folder, line):
    path = tmp_path / "module.py"
    path.write_text(line)
    assert list(violations(path, folder))


def stands_on(files):
    """Return what each file imports of the others, wherever in it."""
    parts = {
        path: path.relative_to(SOURCE.parent).with_suffix("").parts for path in files
    }
    names = {
        ".".join(one).removesuffix(".__init__"): path for path, one in parts.items()
    }
    found = {}
    for path in files:
        split = [name.split(".") for name in imports(path)]
        # The longest that is a file: what is taken at a door is the door's.
        taken = ([".".join(one[:n]) for n in range(len(one), 1, -1)] for one in split)
        nearest = (
            next((name for name in each if name in names), None) for each in taken
        )
        found[path] = {names[name] for name in nearest if name} - {path}
    return found


def circle(graph):
    """Return files that import each other in a circle, or none."""
    left = dict(graph)
    while bottom := [path for path, below in left.items() if not below & left.keys()]:
        for path in bottom:
            del left[path]
    return sorted(path.name for path in left)


def test_one_cell_is_judged_without_the_audit():
    """In a fresh process: reading a verdict starts no search for contradictions."""
    code = (
        "import sys, reproduce as rp; print(rp.table('niu2024/table-3')['scale.red'].verdict); "
        "print([name for name in sys.modules if name.startswith('reproduce.consistency')])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert run.stdout.split("\n")[:2] == ["differs", "[]"]


def test_no_files_import_each_other_in_a_circle():
    assert circle(stands_on(FILES)) == []


def test_a_circle_is_seen(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "SOURCE", tmp_path / "reproduce")
    (tmp_path / "reproduce").mkdir()
    texts = {"a": "from reproduce.b import x", "b": "from reproduce import a", "c": ""}
    for name, text in texts.items():
        (tmp_path / "reproduce" / f"{name}.py").write_text(text)
    files = sorted((tmp_path / "reproduce").glob("*.py"))
    assert circle(stands_on(files)) == ["a.py", "b.py"]


def test_a_room_of_physics_that_climbs_is_seen(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("from reproduce.physics.registration.fit import fit_registration")
    assert list(climbs(path, "optics"))
    assert not list(climbs(path, "registration"))


def test_the_engine_of_the_posteriors_knows_no_model():
    for path in (SOURCE / "inference").glob("*.py"):
        models = "reproduce.inference.models"
        assert not [name for name in imports(path) if name.startswith(models)], path


def test_every_folder_has_its_arrows():
    rooms = {path.parent.name for path in (SOURCE / "physics").glob("*/__init__.py")}
    rooms |= {path.stem for path in (SOURCE / "physics").glob("[a-z]*.py")} - {
        "validate"
    }
    assert rooms == set(ROOMS)
    folders = {path.parent.name for path in SOURCE.glob("*/__init__.py")}
    assert folders == set(ARROWS)
