"""What the audit offers: every module says what is public, and every public name what it is."""

import ast
import functools
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

import reproduce.audit

FOLDER = Path(reproduce.audit.__file__).parent
MODULES = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")
# From a printed number to the whole audit: each module stands on those before it.
ORDER = ["rounding", "formula", "relation", "intervals", "solve", "examine", "conflicts"]
ORDER += ["slips", "corrections", "equations", "report", "errata"]
ROOT = FOLDER.parent.parent.parent


@functools.cache
def imported():
    """Return what each module of the audit is asked for by other files, pages included."""
    found = {name: set() for name in MODULES}
    for folder, ending in (("src", "py"), ("tests", "py"), ("tools", "py"), ("book", "md")):
        for path in (ROOT / folder).rglob(f"*.{ending}"):
            text = path.read_text(encoding="utf-8")
            for name, lines in re.findall(
                r"from reproduce\.audit\.(\w+) import (\([^)]*\)|.*)", text
            ):
                found[name] |= set(re.findall(r"\w+", lines))
    return found


@pytest.mark.parametrize("name", MODULES)
def test_all_lists_what_others_import(name):
    """Functions and constants that nobody else asks for are private; types may be named."""
    module = import_module(f"reproduce.audit.{name}")
    public = set(module.__all__)
    assert {one for one in imported()[name] if not one.startswith("_")} <= public
    assert all(hasattr(module, one) for one in public)
    idle = {one for one in public - imported()[name] if one.islower() or one.isupper()}
    assert not idle


@pytest.mark.parametrize("name", MODULES)
def test_modules_stand_on_each_other_in_one_direction(name):
    source = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    below = re.findall(r"^from reproduce\.audit\.(\w+) import", source, flags=re.MULTILINE)
    assert sorted(ORDER) == MODULES
    assert set(below) <= set(ORDER[: ORDER.index(name)])


@pytest.mark.parametrize("name", MODULES)
def test_every_public_function_and_class_has_its_sentence(name):
    module = import_module(f"reproduce.audit.{name}")
    for public in module.__all__:
        thing = getattr(module, public)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            first = (thing.__doc__ or "").partition("\n\n")[0].strip()
            assert first.endswith("."), public
            assert not first.startswith(f"{public}("), public  # what a dataclass gets by itself


def test_no_type_of_the_audit_has_a_name_that_another_room_uses():
    """One word, one meaning: classes, and names for kinds of values."""
    homes: dict[str, set[Path]] = {}
    for path in FOLDER.parent.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, set()).add(path)
            elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                alias = node.targets[0].id
                if alias[0].isupper() and not alias.isupper():
                    homes.setdefault(alias, set()).add(path)
    twice = {name for name, paths in homes.items() if len(paths) > 1}
    assert not {name for name in twice for path in homes[name] if path.parent == FOLDER}
