"""How the audit is built: modules in one order, and type names of its own."""

import ast
import re
from pathlib import Path

import pytest

import reproduce.audit

FOLDER = Path(reproduce.audit.__file__).parent
MODULES = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")
# From a printed number to the whole audit: each module stands on those before it.
ORDER = ["relation", "examine", "report"]
ROOT = FOLDER.parent.parent.parent


@pytest.mark.parametrize("name", MODULES)
def test_modules_stand_on_each_other_in_one_direction(name):
    source = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    below = re.findall(
        r"^from reproduce\.audit\.(\w+) import", source, flags=re.MULTILINE
    )
    assert sorted(ORDER) == MODULES
    assert set(below) <= set(ORDER[: ORDER.index(name)])


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
