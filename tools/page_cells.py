"""Run the code of the book's pages without a kernel, and keep the outputs of each cell.

The parser of the book reads a page. Its cells run in order, in a new namespace. The
outputs are those of a notebook: printed text, the value of the last line and open figures.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from IPython.core import formatters, pylabtools
from myst_nb.core.read import read_myst_markdown_notebook

BOOK = Path(__file__).resolve().parent.parent / "book"
NOTEBOOK = "---\nfile_format: mystnb\n"


def read(page: Path) -> Any:
    """Return a page as a notebook, or None if it has no code."""
    text = page.read_text(encoding="utf-8")
    return read_myst_markdown_notebook(text) if text.startswith(NOTEBOOK) else None


def notebooks(book: Path = BOOK) -> list[Path]:
    """Return the pages with code, sorted by name."""
    found = (path for path in book.rglob("*.md") if "_build" not in path.parts)
    return sorted(path for path in found if read(path))


def cells(page: Path) -> list[str]:
    """Return the code cells of a page, in order."""
    notebook = read(page)
    return [cell.source for cell in code(notebook)] if notebook else []


def code(notebook: Any) -> list[Any]:
    """Return the code cells of a notebook."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def execute(page: Path) -> tuple[Any, dict[str, Any]]:
    """Run the cells of a page.

    Returns
    -------
    notebook : nbformat.NotebookNode
        The page with the outputs of its cells.
    variables : dict
        Variables that the cells define.

    Raises
    ------
    RuntimeError
        If a cell writes to standard error. An exception of a cell passes unchanged.
    """
    notebook, variables = read(page), {"__name__": "__main__"}
    notebook.metadata["language_info"] = {
        "name": "python",
        "pygments_lexer": "ipython3",
    }
    with chdir(page.parent):
        for number, cell in enumerate(code(notebook), start=1):
            name = f"{page.name}, cell {number}"
            with (
                redirect_stdout(StringIO()) as printed,
                redirect_stderr(StringIO()) as warned,
            ):
                value = _run_cell(cell.source, name, variables)
            if warned.getvalue():
                raise RuntimeError(f"{name}: {warned.getvalue()}")
            cell.execution_count = number
            cell.outputs = list(_outputs(printed.getvalue(), value, number))
    return notebook, variables


def _run_cell(source: str, name: str, namespace: dict[str, Any]) -> Any:
    """Run a cell and return the value of its last line, None if it is a statement."""
    tree = ast.parse(source, name)
    last = (
        tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    )
    exec(compile(tree, name, "exec"), namespace)
    if not isinstance(last, ast.Expr):
        return None
    return eval(compile(ast.Expression(last.value), name, "eval"), namespace)


def _outputs(printed: str, value: Any, number: int) -> Iterator[Any]:
    """Yield the outputs below a cell, and close the figures."""
    import nbformat.v4
    from matplotlib import pyplot

    # The functions of Jupyter have no types.
    new_output: Any = nbformat.v4.new_output
    formatter: Any = formatters.DisplayFormatter()
    print_figure: Any = pylabtools.print_figure
    if printed:
        yield new_output("stream", text=printed)
    if value is not None:
        data, metadata = formatter.format(value)
        result = {"metadata": metadata, "execution_count": number}
        yield new_output("execute_result", data, **result)
    for figure in map(pyplot.figure, pyplot.get_fignums()):
        image = print_figure(figure, base64=True)
        data = {"image/png": image, "text/plain": repr(figure)}
        yield new_output("display_data", data)
    pyplot.close("all")
