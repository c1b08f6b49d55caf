"""What each module offers: others take nothing else, nothing in it is idle.

What has no leading underscore is public, in modules that still have `__all__` what that lists.
"""

import ast
import inspect
import re
from collections import defaultdict
from importlib import import_module
from pathlib import Path

import pytest

import reproduce

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src" / "reproduce"
CELL = re.compile(r"^```\{code-cell\}.*?\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?(reproduce\.[\w.]+)`")


def module_name(path):
    parts = path.relative_to(ROOT / "src").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


# A package's own file only says what the package is.
MODULES = {
    module_name(path): path
    for path in sorted(SOURCE.rglob("*.py"))
    if path.name not in {"__init__.py", "__main__.py"}
}
PAGES = [path for path in sorted(ROOT.glob("book/**/*.md")) if "_build" not in path.parts]
OTHERS = [
    path
    for folder in ("src", "benchmarks", "tools", "tests", "book/_ext")
    for path in sorted((ROOT / folder).rglob("*.py"))
]


def taken(source):
    """Yield module and name of what a source takes from the package, by import or attribute."""
    tree = ast.parse(source)
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("reproduce"):
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
    code = "\n".join(CELL.findall(path.read_text(encoding="utf-8")))
    return "\n".join(line for line in code.splitlines() if not line.startswith((":", "%", "!")))


def linked(path):
    """Yield module and name of what a page links to."""
    for link in LINK.findall(path.read_text(encoding="utf-8")):
        module = next((m for m in sorted(MODULES, reverse=True) if link.startswith(f"{m}.")), "")
        if module:
            yield module, link.removeprefix(f"{module}.").partition(".")[0]


def used():
    """Return who takes each name of each module: files, without the module itself."""
    found = defaultdict(set)
    for path in OTHERS:
        for one in taken(path.read_text(encoding="utf-8")):
            if MODULES[one[0]] != path:
                found[one].add(path)
    for path in PAGES:
        for one in (*taken(cells(path)), *linked(path)):
            found[one].add(path)
    front = "reproduce.views.front"
    for name in reproduce.__all__:  # which the package hands on by name
        found[front, name].add(SOURCE / "__init__.py")
    return found


USED = used()
# Where a function without an underscore is one that another module takes.
WHOLE = re.compile(r"reproduce\.papers\.(niu2024\.)?\w+")


def of_project(module, name):
    """Tell whether a module defines a name itself, and does not pass it on."""
    thing = getattr(import_module(module), name)
    return not inspect.ismodule(thing) and getattr(thing, "__module__", module) == module


def public_names(module):
    """Return the public names that a module defines itself, at its top."""
    if listed := getattr(import_module(module), "__all__", None):
        return list(listed)
    found = []
    for node in ast.parse(MODULES[module].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.append(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found += [one.id for top in targets for one in ast.walk(top) if type(one) is ast.Name]
    return [name for name in found if not name.startswith("_")]


@pytest.mark.parametrize("module", MODULES)
def test_others_take_what_is_public(module):
    public = public_names(module)
    assert len(set(public)) == len(public)
    assert not [name for name in public if name.startswith("_")]
    assert not [name for name in public if not hasattr(import_module(module), name)]
    rooms = {path for path in OTHERS if path.is_relative_to(SOURCE)}
    # Rooms, tools and pages take what is public; tests and rooms of physics may see a kernel.
    wrong = [
        name
        for (home, name), takers in USED.items()
        if home == module and name not in public and not name.startswith("_")
        if of_project(home, name) and takers
    ]
    assert wrong == []
    kernels = [
        (name, path)
        for (home, name), takers in USED.items()
        for path in takers & rooms
        if home == module and name.startswith("_") and not name.startswith("__")
        if path.relative_to(SOURCE).parts[0] != MODULES[module].relative_to(SOURCE).parts[0]
    ]
    assert kernels == []


@pytest.mark.parametrize("module", MODULES)
def test_nothing_public_is_idle(module):
    """Types are met as results, and checks are called within physics."""
    things = {name: getattr(import_module(module), name) for name in public_names(module)}
    if not getattr(import_module(module), "__all__", None):
        if not WHOLE.fullmatch(module):
            return
        # What is declared is found by its key, and what a constant of a module is, it says there.
        things = {name: one for name, one in things.items() if inspect.isfunction(one)}
        things.pop("recomputed", None)  # which judge.studies names by its module
    idle = [n for n, one in things.items() if not inspect.isclass(one) and not USED[module, n]]
    assert idle == []


@pytest.mark.parametrize("module", MODULES)
def test_every_public_function_and_class_has_its_sentence(module):
    for name in public_names(module):
        thing = getattr(import_module(module), name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            first = (inspect.getdoc(thing) or "").partition("\n\n")[0].strip()
            assert first.endswith((".", ":")), name
            assert not first.startswith(f"{name}("), name  # what a dataclass gets by itself


def test_a_private_name_is_seen():
    line = "from reproduce.physics.optics.camera import _turned\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]
    line = "from reproduce.physics.optics import camera as c\nc._turned(1, 2)\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]


@pytest.mark.parametrize(
    "module", [name for name in MODULES if ".physics." in name and "._" not in name]
)
def test_functions_of_physics_say_what_they_take_and_return_and_show_it(module):
    """In sections, in those of a like function, or with the shapes in the first line."""
    for name in public_names(module):
        function = getattr(import_module(module), name)
        if inspect.isfunction(function) and not module.endswith(".validate"):
            text = inspect.getdoc(function) or ""
            like = re.search(r"(those of|as)\s+`\w+`", text) or "(..." in text.splitlines()[0]
            assert like or "Parameters\n---" in text, name
            assert like or re.search(r"^(Returns|Yields)\n---", text, re.MULTILINE), name
            assert ">>> " in text, name
