"""Sphinx extension: each equation unfolds into the function that implements it, its own text.

A docstring says ``Implements: niu2024 (17).`` or ``Printed form of niu2024 (24).``; the text of its
function stands folded below the equation of that number.
"""

import ast
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

from paper_links import claimed


class Source(NamedTuple):
    """A function's name, its text and the file that holds it."""

    name: str
    text: str
    path: str


@cache
def implementations() -> dict[str, list[Source]]:
    """Return the functions that implement each equation, by the equation's label."""
    package = find_spec("reproduce")
    if package is None or package.submodule_search_locations is None:
        raise RuntimeError(
            "the package reproduce is not installed; `make book` installs it"
        )
    found: dict[str, list[Source]] = {}
    for path in sorted(
        (Path(package.submodule_search_locations[0]) / "physics").rglob("*.py")
    ):
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
    """Yield the functions and methods of a module: name, docstring, the function itself.

    What the docstring of a class claims, its method ``apply`` does.
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
    """Put the function below its equation, folded."""

    default_priority = 900

    def apply(self, **kwargs: object) -> None:
        """Look at every numbered equation of the page."""
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
    return {"parallel_read_safe": True, "parallel_write_safe": True}
