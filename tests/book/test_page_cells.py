"""The outputs of the cells of a page, run without a kernel."""

from pathlib import Path

import pytest

from page_cells import BOOK, cells, code, execute, notebooks, read

SOURCES = (
    ":tags: [remove-cell]\nx = 1.5",
    "class Bold:\n    def _repr_html_(self):\n        return '<b>2</b>'\n",
    "print('one')\nBold()",
    "a = 3\na",
    "None",
    "a += 1",
    "import matplotlib.pyplot as plt\nline = plt.plot([1, 2])",
)


@pytest.fixture
def page(tmp_path):
    """Write a page with cells and return its path."""

    def written(*sources):
        path = tmp_path / "page.md"
        cells = (f"```{{code-cell}} ipython3\n{source}\n```\n\n" for source in sources)
        head = "---\nfile_format: mystnb\n---\n\n# A page\n\n"
        path.write_text(head + "".join(cells))
        return path

    return written


def test_outputs_are_those_of_a_notebook(page):
    path = page(*SOURCES)
    assert len(cells(path)) == len(SOURCES)
    notebook, variables = execute(path)
    assert variables["a"] == 4
    outputs = [output for cell in code(notebook) for output in cell.outputs]
    printed, bold, number, plot = outputs
    assert printed.text == "one\n"
    assert bold.data["text/html"] == "<b>2</b>"
    assert [*number.data] == ["text/plain"]
    assert sorted(plot.data) == ["image/png", "text/plain"]
    assert [cell.execution_count for cell in code(notebook)] == [*range(1, 8)]


def test_errors_and_warnings_stop_a_page_and_variables_are_not_shared(page):
    before = Path.cwd()
    execute(page("left_behind = 1"))
    for source, error in (
        ("left_behind", NameError),
        ("1 / 0", ZeroDivisionError),
        ("import sys\nprint(1, file=sys.stderr)", RuntimeError),
    ):
        with pytest.raises(error):
            execute(page(source))
    assert Path.cwd() == before


def test_every_page_with_code_is_run():
    assert read(BOOK / "notation.md") is None
    pages = (path for path in BOOK.rglob("*.md") if "_build" not in path.parts)
    with_code = {path for path in pages if "{code-cell}" in path.read_text("utf-8")}
    assert set(notebooks()) == with_code
