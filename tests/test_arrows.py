"""Directions of imports between the folders of the package."""

import ast
import sys
from graphlib import TopologicalSorter

from commands import output_of
from places import ROOT

SOURCE = ROOT / "src" / "reproduce"

# Folder -> what it may import from the project. A dotted name allows only that module.
ARROWS = {
    "physics": {"physics", "units"},
    "printed": {"printed", "locate"},
    "store": {"store", "locate", "physics.validate"},
    "inference": {"inference", "physics", "units"},
    "papers": {
        *{"papers", "inference", "physics", "store", "printed.inputs", "units"},
        *{"locate.papers", "locate.search_path"},
        *{"locate.data_files", "locate.read_toml"},
    },
    "judge": {
        *{"judge", "papers", "printed", "locate", "store.studies"},
        *{"physics.validate"},
    },
    "consistency": {"consistency", "printed", "physics", "units"},
    "views": {
        *{"views", "judge", "consistency", "inference", "store", "printed", "papers"},
        *{"locate", "units", "version", "physics.validate"},
        *{"physics.registration", "physics.attitude", "physics.images"},
    },
}
# The same between the subpackages of physics, which also import the validation of input and units.
SUBPACKAGES = {
    "optics": {"optics"},
    "attitude": {"attitude", "optics"},
    "images": {"images"},
    "registration": {"registration", "optics"},
    "raytrace": {"raytrace", "attitude"},
    "ground": {"ground", "attitude"},
}
FILE_ACCESS = set("pathlib io os tomllib json csv pandas importlib".split())
OPENING = set("open load loadtxt genfromtxt fromfile read_text".split())
# Modules next to the folders.
TOP = {
    "__init__.py": ["reproduce.version.__version__"],
    "__main__.py": ["reproduce.views.cli.main"],
    "locate.py": [],
    "units.py": [],
    "version.py": [],
}
FILES = sorted(SOURCE.rglob("*.py"))
FORBIDDEN = (
    ("physics", "optics", "from reproduce.printed import cells"),
    ("physics", "optics", "import pathlib"),
    ("physics", "optics", "from reproduce.physics.registration.fit import fit"),
    ("papers", "", "from reproduce.printed.cells import library"),
    ("papers", "", "from reproduce.judge import ledger"),
    ("judge", "", "from reproduce.views import _keys as keys"),
    ("store", "", "from reproduce.papers import catalogue"),
    ("views", "", "from reproduce.physics import camera"),
    ("views", "", "from . import captions"),
    ("views", "", "import reproduce"),
)


def imports(text):
    """Yield the imported modules and names; a relative import as its dots."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            inner = module.startswith("reproduce")
            yield from (f"{module}.{a.name}" for a in node.names) if inner else [module]


def forbidden(text, folder, subpackage=""):
    """Return the imports that a module of a folder must not have."""
    allowed = {f"reproduce.{name}" for name in ARROWS[folder]}
    if subpackage in SUBPACKAGES:
        allowed = {f"reproduce.physics.{n}" for n in SUBPACKAGES[subpackage]}
        allowed |= {"reproduce.physics.validate", "reproduce.units"}
    closed = FILE_ACCESS if folder == "physics" else set()
    return [
        name
        for name in imports(text)
        if name.split(".")[0] in closed | {""}
        or (
            name.split(".")[0] == "reproduce"
            and not any(f"{name}.".startswith(f"{start}.") for start in allowed)
        )
    ]


def test_imports_follow_the_directions():
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        folder, *rest = path.relative_to(SOURCE).parts
        if rest:
            subpackage = rest[0].removesuffix(".py") if folder == "physics" else ""
            assert forbidden(text, folder, subpackage) == [], path
        else:
            names = [name for name in imports(text) if name.startswith("reproduce")]
            assert names == TOP[folder], path
        if path.parent.name == "inference":
            models = "reproduce.inference.models"
            assert not any(name.startswith(models) for name in imports(text)), path
        if folder == "physics":
            calls = {
                n.func for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call)
            }
            names = {ast.unparse(call).rpartition(".")[2] for call in calls}
            assert not names & OPENING, path
    for folder, subpackage, line in FORBIDDEN:
        assert forbidden(line, folder, subpackage), line


def test_every_folder_has_its_directions():
    assert {path.parent.name for path in SOURCE.glob("*/__init__.py")} == set(ARROWS)
    physics = {p.parent.name for p in (SOURCE / "physics").glob("*/__init__.py")}
    physics |= {path.stem for path in (SOURCE / "physics").glob("[a-z]*.py")}
    assert physics == {*SUBPACKAGES, "validate"}


def test_no_modules_import_each_other_in_a_cycle():
    parts = (path.relative_to(SOURCE.parent).with_suffix("").parts for path in FILES)
    names = [".".join(part).removesuffix(".__init__") for part in parts]
    graph = {}
    for name, path in zip(names, FILES, strict=True):
        used = imports(path.read_text(encoding="utf-8"))
        found = {one if one in names else one.rpartition(".")[0] for one in used}
        graph[name] = found - {name}
    TopologicalSorter(graph).prepare()


def test_a_cell_is_judged_without_the_audit():
    code = (
        "import sys, reproduce as rp; print(rp.table('niu2024/table-3')['scale.red'].verdict, "
        "[name for name in sys.modules if name.startswith('reproduce.consistency')])"
    )
    assert output_of(sys.executable, "-c", code).split() == ["differs", "[]"]
