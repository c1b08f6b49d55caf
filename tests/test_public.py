"""What is public: names without an underscore; a room's are listed at its door, and none is idle.

The door of a room of physics and of inference is its `__init__`; others import from there.
"""

import ast
import inspect
import re
from collections import defaultdict
from functools import cache
from importlib import import_module
from pathlib import Path

import page_cells
import reproduce

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src" / "reproduce"
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?(reproduce\.[\w.]+)`")


def module_name(path):
    parts = path.relative_to(ROOT / "src").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = {module_name(path): path for path in sorted(SOURCE.rglob("*.py"))}


def imported(path):
    """Return name to module of what a file imports by name."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module for node in nodes for alias in node.names}


ROOMS = {
    name
    for name, path in MODULES.items()
    if path.name == "__init__.py" and re.search(r"\.physics\.|\.inference", name)
}
DOORS = {room: imported(MODULES[room]) for room in sorted(ROOMS)}
# Not at the door: they load emcee, or SciPy at all before a star is registered.
APART = {
    "reproduce.inference.sampling",
    "reproduce.physics.attitude.diagnosis",
}
PAGES = [
    path for path in sorted(ROOT.glob("book/**/*.md")) if "_build" not in path.parts
]
OTHERS = [
    path
    for folder in ("src", "benchmarks", "tools", "tests", "book/_ext")
    for path in sorted((ROOT / folder).rglob("*.py"))
]


def taken(source):
    """Yield module and name of what a source takes from the package, by import or attribute.

    What is taken at a door is the door's: ("reproduce.physics.optics", "Camera").
    """
    tree = ast.parse(source)
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
            "reproduce"
        ):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in MODULES:
                    modules[alias.asname or alias.name] = inner
                elif node.module in MODULES:
                    yield node.module, alias.name
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = modules.get(node.value.id)
            if module:
                yield module, node.attr


def cells(path):
    """Return the code of a page, magic commands left out."""
    code = "\n".join(page_cells.cells(path))
    return "\n".join(
        line for line in code.splitlines() if not line.startswith(("%", "!"))
    )


def linked(path):
    """Yield module and name of what a page links to."""
    for link in LINK.findall(path.read_text(encoding="utf-8")):
        module = next(
            (m for m in sorted(MODULES, reverse=True) if link.startswith(f"{m}.")), ""
        )
        if module:
            yield module, link.removeprefix(f"{module}.").partition(".")[0]


def home(module, name):
    """Return the module that defines a name taken there or at a door."""
    return DOORS.get(module, {}).get(name, module), name


@cache
def used():
    """Return who takes each name of each module: files, without the module itself and doors."""
    found = defaultdict(set)
    for path in OTHERS:
        if path in {MODULES[inputs] for inputs in DOORS}:
            continue
        for one in taken(path.read_text(encoding="utf-8")):
            if MODULES[one[0]] != path:
                found[one].add(path)
    for path in PAGES:
        for one in (*taken(cells(path)), *linked(path)):
            found[one].add(path)
    for name, module in reproduce._MODULES.items():
        found[f"reproduce.{module}", name].add(SOURCE / "__init__.py")
    return found


@cache
def takers():
    """Return who takes each name, by the module that defines it."""
    found = defaultdict(set)
    for one, paths in used().items():
        found[home(*one)] |= paths
    return found


def public(module):
    """Return the functions and classes of a module that others may take, by name."""
    if module.endswith("__main__"):
        return {}
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    kinds = ast.FunctionDef | ast.ClassDef
    found = {
        n.name: n
        for n in tree.body
        if isinstance(n, kinds) and not n.name.startswith("_")
    }
    return found


def top(path):
    """Return the folder below the package."""
    return path.relative_to(SOURCE).parts[0]


def room(path):
    """Return the folder below the package, and the one below physics or inference."""
    parts = path.relative_to(SOURCE).parts[:-1]
    return parts[:2] if parts[0] in {"physics", "inference"} else parts[:1]


def test_nothing_private_is_taken_by_another_room():
    """Tests and rooms of physics may see a kernel."""
    wrong = [
        (place, name, path)
        for (place, name), paths in takers().items()
        for path in paths
        if name.startswith("_") and not name.startswith("__")
        if path.is_relative_to(SOURCE) and top(path) != top(MODULES[place])
    ]
    assert wrong == []


def test_others_come_in_by_the_door():
    """But for tests, links of pages, and kernels that rooms of physics share."""
    behind = {module for inputs in DOORS.values() for module in inputs.values()} - APART
    wrong = [
        (place, name, path)
        for (place, name), paths in used().items()
        for path in paths
        if place in behind and not name.startswith("_")
        if path.suffix == ".py" and not path.is_relative_to(ROOT / "tests")
        if not (path.is_relative_to(SOURCE) and room(path) == room(MODULES[place]))
    ]
    assert wrong == []


def test_nothing_stands_at_the_door_in_vain():
    """What others take, in code or on a page, stands there; types are met as results."""
    idle = [
        (inputs, name)
        for inputs, names in DOORS.items()
        for name, module in names.items()
        if not inspect.isclass(getattr(import_module(module), name))
        if not any(
            not path.is_relative_to(SOURCE) or room(path) != room(MODULES[module])
            for path in takers()[module, name]
        )
    ]
    assert idle == []


def test_nothing_public_is_idle():
    """Types are met as results, what is decorated by its decorator."""
    idle = [
        (module, name)
        for module in MODULES
        for name, node in public(module).items()
        if isinstance(node, ast.FunctionDef) and not node.decorator_list
        if not takers()[module, name]
    ]
    assert idle == []


def test_every_public_function_and_class_has_its_sentence():
    for module in MODULES:
        for name, node in public(module).items():
            first = (ast.get_docstring(node) or "").partition("\n\n")[0].strip()
            assert first.endswith((".", ":")), (module, name)


def test_only_the_front_door_has_a_list():
    """An underscore says private; a door is its imports."""
    left = {
        path
        for path in MODULES.values()
        if re.search(r"^__all__\b", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert left == {SOURCE / "__init__.py"}


def test_a_private_name_is_seen():
    line = "from reproduce.physics.optics.camera import _turned\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]
    line = "from reproduce.physics.optics import camera as c\nc._turned(1, 2)\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]


def test_functions_of_physics_say_what_they_take_and_return_and_show_it():
    """In sections, in those of a like function, or with the shapes in the first line."""
    doors = [names for inputs, names in DOORS.items() if ".physics." in inputs]
    for name, module in (pair for names in doors for pair in names.items()):
        function = getattr(import_module(module), name)
        if inspect.isfunction(function):
            text = inspect.getdoc(function) or ""
            first = text.partition("\n")[0]
            if not (re.search(r"(those of|as)\s+`\w+`", text) or "(..." in first):
                if inspect.signature(function).parameters:
                    assert "Parameters\n---" in text, name
                assert re.search(r"^(Returns|Yields)\n---", text, re.MULTILINE), name
            assert ">>> " in text, name
