"""Sphinx extension: the source of its function below each equation, folded.

A docstring with ``Implements: niu2024 (17).`` or ``Printed form of niu2024 (24).`` connects its
function to the equation.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

from after_build import SAFE
from paper_links import claimed
from reproduce import physics


class Source(NamedTuple):
    """Name, text and file of a function."""

    name: str
    text: str
    path: str


@cache
def implementations() -> dict[str, list[Source]]:
    """Return the functions that implement each equation, by the equation's label."""
    found: dict[str, list[Source]] = {}
    for path in sorted(Path(physics.__path__[0]).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for name, claim, node in functions(ast.parse(text)):
            source = Source(
                name, "\n".join(lines[node.lineno - 1 : node.end_lineno]), str(path)
            )
            for line in claim.splitlines():
                for label in claimed(line):
                    found.setdefault(label, []).append(source)
    return found


def functions(
    tree: ast.AST, prefix: str = ""
) -> Iterator[tuple[str, str, ast.FunctionDef]]:
    """Yield the functions and methods of a module: name, docstring and syntax tree.

    The docstring of a class also belongs to its method ``apply``.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield f"{prefix}{node.name}", ast.get_docstring(node) or "", node
        elif isinstance(node, ast.ClassDef):
            methods = list(functions(node, f"{node.name}."))
            yield from methods
            claim = ast.get_docstring(node) or ""
            yield from ((n, claim, m) for n, _, m in methods if m.name == "apply")


class Unfold(SphinxTransform):
    """Insert the function below its equation."""

    default_priority = 900

    def apply(self, **kwargs: object) -> None:
        """Insert the functions of all numbered equations of the page."""
        for equation in list(self.document.findall(nodes.math_block)):
            for source in implementations().get(equation.get("label", ""), []):
                self.env.note_dependency(source.path)
                place = equation.parent
                at = place.index(equation) + 1
                opening = (
                    '<details class="rp-details rp-function"><summary>The function that computes '
                    f"it: <code>{source.name}</code></summary>"
                )
                place.insert(at, nodes.raw("", "</details>", format="html"))
                place.insert(
                    at, nodes.literal_block(source.text, source.text, language="python")
                )
                place.insert(at, nodes.raw("", opening, format="html"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(Unfold)
    return SAFE
