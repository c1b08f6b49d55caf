"""Run the code of the book's pages in this process, and keep what each page shows.

A page is read by the parser that the book itself uses; its cells run in order, in a namespace of
their own, without a kernel. What a cell prints and ends on is what the page shows.
"""

from __future__ import annotations

import ast
import contextlib
import io
import re
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from myst_nb.core.read import read_myst_markdown_notebook

POSTERIOR = re.compile(r"\{fact\}`posterior/([^#`]+)#")
BOOK = Path(__file__).resolve().parent.parent / "book"


@dataclass
class Shown:
    """What the cells of a page show, in order, and the variables that they define."""

    texts: list[str] = field(default_factory=list)
    seconds: float = 0.0
    variables: dict[str, Any] = field(default_factory=dict)


def cells(page: Path) -> list[str]:
    """Return the code cells of a page, in order; none where the page is not a notebook."""
    text = page.read_text(encoding="utf-8")
    if not text.startswith("---\nfile_format: mystnb\n"):
        return []
    notebook = read_myst_markdown_notebook(text)
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def notebooks() -> list[Path]:
    """Return the pages that have code, in order of their names."""
    found = (path for path in BOOK.rglob("*.md") if "_build" not in path.parts)
    return sorted(path for path in found if cells(path))


def posteriors_on(page: Path) -> list[str]:
    """Return the posteriors whose numbers stand in the sentences of a page."""
    return list(dict.fromkeys(POSTERIOR.findall(page.read_text(encoding="utf-8"))))


def run(page: Path) -> Shown:
    """Run the cells of a page.

    Parameters
    ----------
    page : pathlib.Path
        A page of the book.

    Returns
    -------
    Shown
        What they show; an error of a cell passes, with the page and the cell in its traceback.
    """
    shown = Shown(variables={"__name__": "__main__"})
    begin = time.process_time()
    for number, source in enumerate(cells(page), start=1):
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            value = _execute(source, f"{page.name}, cell {number}", shown.variables)
        shown.texts += [text for text in (printed.getvalue(), _text(value)) if text]
    shown.seconds = time.process_time() - begin
    return shown


def _execute(source: str, name: str, namespace: dict[str, Any]) -> Any:
    """Run a cell and return what its last line is, as a notebook does."""
    tree = ast.parse(source, name)
    last = tree.body[-1] if tree.body else None
    if not isinstance(last, ast.Expr):
        exec(compile(tree, name, "exec"), namespace)
        return None
    del tree.body[-1]
    exec(compile(tree, name, "exec"), namespace)
    return eval(compile(ast.Expression(last.value), name, "eval"), namespace)


def _text(value: Any) -> str:
    """Return what a notebook shows of a value: its HTML, or else its text."""
    if value is None:
        return ""
    html = getattr(value, "_repr_html_", None)
    return str(html()) if html else value if isinstance(value, str) else repr(value)
