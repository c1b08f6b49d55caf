"""Public names: without an underscore, imported from the subpackage, used, and documented."""

import ast
import inspect
import re
from collections import defaultdict
from importlib import import_module

from places import ROOT

import page_cells
import reproduce

SOURCE = ROOT / "src" / "reproduce"
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?(reproduce\.[\w.]+)`")


def module_name(path):
    parts = path.relative_to(ROOT / "src").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = {module_name(path): path for path in sorted(SOURCE.rglob("*.py"))}
TREES = {name: ast.parse(path.read_text("utf-8")) for name, path in MODULES.items()}


def imported_names(tree):
    """Return the module of each name that a file imports by name."""
    nodes = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module for node in nodes for alias in node.names}


# Subpackages of physics and inference, and the public names that their `__init__.py` imports.
SUBPACKAGES = {
    name: imported_names(TREES[name])
    for name, path in MODULES.items()
    if path.name == "__init__.py" and re.search(r"\.physics\.|\.inference", name)
}
# Not imported by the `__init__.py`: they load emcee or parts of SciPy.
SEPARATE = {"reproduce.inference.sampling", "reproduce.physics.attitude.diagnosis"}


def used_names(tree):
    """Yield module and name of each import or attribute of the package in a module."""
    modules, nodes = {}, list(ast.walk(tree))
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(
            "reproduce"
        ):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in MODULES:
                    modules[alias.asname or alias.name] = inner
                elif node.module in MODULES:
                    yield node.module, alias.name
    for node in nodes:
        if isinstance(node, ast.Attribute):
            name = getattr(node.value, "id", None)
            if name in modules:
                yield modules[name], node.attr


def names_of_page(path):
    """Yield module and name of what a page uses in its cells and links to."""
    code = "\n".join(page_cells.cells(path))
    lines = [line for line in code.splitlines() if not line.startswith(("%", "!"))]
    yield from used_names(ast.parse("\n".join(lines)))
    for link in LINK.findall(path.read_text(encoding="utf-8")):
        starts = [name for name in MODULES if link.startswith(f"{name}.")]
        if starts:
            module = max(starts, key=len)
            yield module, link.removeprefix(f"{module}.").partition(".")[0]


# Module and name, as they are imported -> the files that use them.
USED = defaultdict(set)
for folder in ("src", "benchmarks", "tools", "tests", "book/_ext"):
    for path in sorted((ROOT / folder).rglob("*.py")):
        if path not in {MODULES[name] for name in SUBPACKAGES}:
            for used in used_names(ast.parse(path.read_text(encoding="utf-8"))):
                USED[used] |= {path} - {MODULES[used[0]]}
for path in ROOT.glob("book/**/*.md"):
    for used in names_of_page(path) if "_build" not in path.parts else ():
        USED[used].add(path)
for name, module in reproduce._MODULES.items():
    USED[f"reproduce.{module}", name].add(SOURCE / "__init__.py")
# The same by the module that defines the name.
DEFINED = defaultdict(set)
for (module, name), paths in USED.items():
    DEFINED[SUBPACKAGES.get(module, {}).get(name, module), name] |= paths


def public(module):
    """Return the public functions and classes of a module, by name."""
    kinds = ast.FunctionDef | ast.ClassDef
    nodes = [node for node in TREES[module].body if isinstance(node, kinds)]
    main = module.endswith("__main__")
    return {node.name: node for node in nodes if node.name[0] != "_" and not main}


def folders(path, depth=2):
    """Return the folder of a module, with the subpackage in physics and inference."""
    parts = path.relative_to(SOURCE).parts[:-1]
    return parts[: depth if parts[:1] in {("physics",), ("inference",)} else 1]


def users(paths, folder, depth=2):
    """Return the modules of the package in other folders."""
    inside = [path for path in paths if path.is_relative_to(SOURCE)]
    return [path for path in inside if folders(path, depth) != folder]


def test_private_names_and_modules_are_used_only_in_their_folder():
    private = {place: paths for place, paths in DEFINED.items() if place[1][0] == "_"}
    # Subpackages export names of their private modules.
    private |= {place: paths for place, paths in USED.items() if "._" in place[0]}
    for (module, name), paths in private.items():
        if not name.startswith("__"):
            assert users(paths, folders(MODULES[module], 1), 1) == [], (module, name)


def test_public_names_are_imported_from_their_subpackage():
    """Except by tests and links of pages."""
    inner = {m for names in SUBPACKAGES.values() for m in names.values()} - SEPARATE
    for (module, name), paths in USED.items():
        if module in inner and name[0] != "_":
            code = [path for path in paths if path.suffix == ".py"]
            free = (SOURCE, ROOT / "tests")
            other = [path for path in code if not any(map(path.is_relative_to, free))]
            other += users(paths, folders(MODULES[module]))
            assert other == [], (module, name)


def test_every_public_function_is_used():
    """Types are those of results; decorated functions are registered."""
    for subpackage, names in SUBPACKAGES.items():
        for name, module in names.items():
            paths, own = DEFINED[module, name], folders(MODULES[module])
            used = users(paths, own) or any(not p.is_relative_to(SOURCE) for p in paths)
            known = used or inspect.isclass(getattr(import_module(module), name))
            assert known, (subpackage, name)
    for module in MODULES:
        for name, node in public(module).items():
            plain = isinstance(node, ast.FunctionDef) and not node.decorator_list
            assert DEFINED[module, name] or not plain, (module, name)


def test_public_functions_are_documented():
    for module in MODULES:
        for name, node in public(module).items():
            first = (ast.get_docstring(node) or "").partition("\n\n")[0].strip()
            assert first.endswith((".", ":")), (module, name)
    physics = [names for name, names in SUBPACKAGES.items() if ".physics." in name]
    for name, module in (pair for names in physics for pair in names.items()):
        function = getattr(import_module(module), name)
        text = inspect.getdoc(function) or ""
        if inspect.isfunction(function):
            # Or those of another function, or shapes in the first line.
            if not (
                re.search(r"(those of|as)\s+`\w+`", text)
                or "(..." in text.split("\n")[0]
            ):
                needed = bool(inspect.signature(function).parameters)
                assert ("Parameters\n---" in text) >= needed, name
                assert re.search(r"^(Returns|Yields)\n---", text, re.MULTILINE), name
            assert ">>> " in text, name
