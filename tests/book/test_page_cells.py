"""The cells of a page, run without a kernel. `make book` and `make same` run those of all pages."""

from pathlib import Path

import pytest

import page_cells
from page_cells import BOOK, Shown, cells, notebooks, run


def page(folder: Path, *sources: str) -> Path:
    """Write a page with the given cells."""
    path = folder / "page.md"
    fences = "".join(
        f"```{{code-cell}} ipython3\n{source}\n```\n\n" for source in sources
    )
    path.write_text(
        f"---\nfile_format: mystnb\n---\n\n# A page\n\n{fences}", encoding="utf-8"
    )
    return path


def test_what_a_page_shows_is_what_a_notebook_would(tmp_path: Path) -> None:
    path = page(
        tmp_path,
        ":tags: [remove-cell]\nx = 1.5",
        "class Bold:\n    def _repr_html_(self):\n        return '<b>2</b>'\n",
        "print('one')\nBold()",
        "a = 3\na",
        "None",
        "a += 1",
        "'text'",
    )
    assert len(cells(path)) == 7
    shown = run(path)
    assert shown.texts == ["one\n", "<b>2</b>", "3", "text"]


def test_pages_do_not_see_each_other(tmp_path: Path) -> None:
    run(page(tmp_path, "left_behind = 1"))
    with pytest.raises(NameError, match="left_behind"):
        run(page(tmp_path, "left_behind"))


@pytest.mark.parametrize(
    ("sources", "error"),
    [
        (("1 / 0",), ZeroDivisionError),
    ],
)
def test_a_broken_page_is_an_error(
    tmp_path: Path, sources: tuple[str, ...], error: type[Exception]
) -> None:
    with pytest.raises(error):
        run(page(tmp_path, *sources))


def test_a_page_that_is_no_notebook_has_no_cells() -> None:
    assert cells(BOOK / "notation.md") == []
    assert page_cells.Shown() == Shown([], 0.0)


def test_every_page_with_code_is_run() -> None:
    with_code = {
        p for p in BOOK.rglob("*.md") if "{code-cell}" in p.read_text(encoding="utf-8")
    }
    assert set(notebooks()) == {
        path for path in with_code if "_build" not in path.parts
    }
