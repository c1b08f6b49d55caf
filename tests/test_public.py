"""What physics offers: `__all__` says it, others call nothing else, and nothing in it is idle."""

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PHYSICS = ROOT / "src" / "reproduce" / "physics"
CELL = re.compile(r"^```\{code-cell\}.*?\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?reproduce\.physics\.([\w.]+)`")


def module_name(path):
    inner = path.relative_to(PHYSICS).with_suffix("").parts
    return ".".join(["reproduce.physics", *(part for part in inner if part != "__init__")])


MODULES = {module_name(path): path for path in sorted(PHYSICS.rglob("*.py")) if path.read_text()}
PUBLIC = {name: set(import_module(name).__all__) for name in MODULES}
PAGES = [path for path in sorted(ROOT.glob("book/*/*.md")) if path.parent.name != "api"]
OTHERS = [
    path
    for folder in ("src", "benchmarks", "tools", "tests")
    for path in sorted((ROOT / folder).rglob("*.py"))
    if "physics" not in path.relative_to(ROOT).parts
]


def taken(source):
    """Yield module and name of what a source takes from physics, by import or by attribute."""
    tree = ast.parse(source)
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("reproduce.physics"):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in MODULES:
                    modules[alias.asname or alias.name] = inner
                else:
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


def used():
    """Return module and name of everything that others take from physics or link to."""
    found = set()
    for path in OTHERS:
        if path.is_relative_to(ROOT / "tests"):
            continue
        found.update(taken(path.read_text(encoding="utf-8")))
    for path in PAGES:
        found.update(taken(cells(path)))
        for link in LINK.findall(path.read_text(encoding="utf-8")):
            parts = f"reproduce.physics.{link}".split(".")
            module = next(
                ".".join(parts[:n])
                for n in range(len(parts), 0, -1)
                if ".".join(parts[:n]) in MODULES
            )
            found.add((module, parts[len(module.split("."))]))
    return found


USED = used()


@pytest.mark.parametrize("module", MODULES)
def test_all_is_there_sorted_and_exists(module):
    names = import_module(module).__all__
    assert len(set(names)) == len(names)
    assert not [name for name in names if name.startswith("_")]
    assert not [name for name in names if not hasattr(import_module(module), name)]


@pytest.mark.parametrize("path", OTHERS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_other_rooms_take_what_is_public(path):
    wrong = [
        f"{module}.{name}"
        for module, name in taken(path.read_text(encoding="utf-8"))
        if name not in PUBLIC[module] or "._" in module
    ]
    assert wrong == []


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_pages_take_what_is_public(path):
    wrong = [f"{m}.{name}" for m, name in taken(cells(path)) if name not in PUBLIC[m]]
    assert wrong == []


def test_links_lead_to_what_is_public():
    assert {(m, name) for m, name in USED if name not in PUBLIC[m] or "._" in m} == set()


def test_every_public_function_is_called_from_elsewhere_or_shown():
    """Classes are met as results, and checks are called within physics."""
    idle = [
        f"{module}.{name}"
        for module, names in PUBLIC.items()
        if "._" not in module and not module.endswith(".validate")
        for name in sorted(names)
        if inspect.isfunction(getattr(import_module(module), name)) and (module, name) not in USED
    ]
    assert idle == []


def test_a_private_name_is_seen():
    line = "from reproduce.physics.optics.camera import _turned\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]
    line = "from reproduce.physics.optics import camera as c\nc._turned(1, 2)\n"
    assert list(taken(line)) == [("reproduce.physics.optics.camera", "_turned")]


@pytest.mark.parametrize("module", [name for name in MODULES if "._" not in name])
def test_public_functions_say_what_they_take_and_return_and_show_it(module):
    """In sections, in those of a like function, or with the shapes in the first line."""
    for name in PUBLIC[module]:
        function = getattr(import_module(module), name)
        if inspect.isfunction(function) and not module.endswith(".validate"):
            text = inspect.getdoc(function) or ""
            said = re.search(r"(those of|as)\s+`\w+`", text) or "(..." in text.splitlines()[0]
            assert said or "Parameters\n---" in text, name
            assert said or re.search(r"^(Returns|Yields)\n---", text, re.MULTILINE), name
            assert ">>> " in text, name
