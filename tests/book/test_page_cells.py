"""The outputs of a page's cells, run without a kernel."""

from pathlib import Path

import pytest

from page_cells import BOOK, cells, code, execute, notebooks, read


def page(folder: Path, *sources: str) -> Path:
    """Write a page with the given cells."""
    path = folder / "page.md"
    fences = "".join(
        f"```{{code-cell}} ipython3\n{source}\n```\n\n" for source in sources
    )
    path.write_text(f"---\nfile_format: mystnb\n---\n\n# A page\n\n{fences}")
    return path


def test_outputs_are_those_of_a_notebook(tmp_path):
    path = page(
        tmp_path,
        ":tags: [remove-cell]\nx = 1.5",
        "class Bold:\n    def _repr_html_(self):\n        return '<b>2</b>'\n",
        "print('one')\nBold()",
        "a = 3\na",
        "None",
        "a += 1",
        "import matplotlib.pyplot as plt\nline = plt.plot([1, 2])",
    )
    assert len(cells(path)) == 7
    notebook, variables = execute(path)
    assert variables["a"] == 4
    shown = [
        one.get("text") or one.data.get("text/html") or sorted(one.data)
        for cell in code(notebook)
        for one in cell.outputs
    ]
    plot = ["image/png", "text/plain"]
    assert shown == ["one\n", "<b>2</b>", ["text/plain"], plot]
    assert [cell.execution_count for cell in code(notebook)] == [*range(1, 8)]


def test_pages_do_not_share_variables(tmp_path):
    execute(page(tmp_path, "left_behind = 1"))
    with pytest.raises(NameError, match="left_behind"):
        execute(page(tmp_path, "left_behind"))


@pytest.mark.parametrize(
    ("source", "error"),
    [
        ("1 / 0", ZeroDivisionError),
        ("import sys\nprint(1, file=sys.stderr)", RuntimeError),
    ],
)
def test_an_exception_or_a_warning_stops_a_page(tmp_path, source, error):
    before = Path.cwd()
    with pytest.raises(error):
        execute(page(tmp_path, source))
    assert Path.cwd() == before


def test_every_page_with_code_is_run():
    assert read(BOOK / "notation.md") is None
    pages = (path for path in BOOK.rglob("*.md") if "_build" not in path.parts)
    with_code = {path for path in pages if "{code-cell}" in path.read_text("utf-8")}
    assert set(notebooks()) == with_code
