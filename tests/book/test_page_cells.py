"""Every call that a page makes, made once: a page that cannot be built fails here."""

import re
from pathlib import Path

import pytest

import page_cells
from page_cells import BOOK, Shown, cells, notebooks, posteriors_on, run
from reproduce.views.book.facts import of_posteriors

PAGES = notebooks()
SAMPLED = re.compile(r"\{fact\}`(posterior/[^`]+)`")
# Double precision holds sixteen digits: nothing on a page is worth saying to better than this.
NOISE = re.compile(r"\d[eE][-−]1[3-9]|10<sup>[-−]1[3-9]</sup>")
DRAWN = re.compile(r"<svg.*?</svg>", re.DOTALL)


def page(folder: Path, *sources: str) -> Path:
    """Write a page with the given cells."""
    path = folder / "page.md"
    fences = "".join(f"```{{code-cell}} ipython3\n{source}\n```\n\n" for source in sources)
    path.write_text(f"---\nfile_format: mystnb\n---\n\n# A page\n\n{fences}", encoding="utf-8")
    return path


@pytest.mark.no_cover  # what it covers is covered by tests that look at it
@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.relative_to(BOOK).as_posix())
def test_page_can_be_built(path: Path) -> None:
    shown = run(path)
    assert shown.texts
    sentences = of_posteriors(posteriors_on(path))
    assert set(SAMPLED.findall(path.read_text(encoding="utf-8"))) <= set(sentences)
    assert all(sentences.values())
    said = [
        *sentences.values(),
        *(DRAWN.sub("", text) for text in shown.texts),
    ]
    assert [text for text in said if NOISE.search(text)] == [], "rounding noise is no result"


def test_every_page_with_code_is_run() -> None:
    with_code = {p for p in BOOK.rglob("*.md") if "{code-cell}" in p.read_text(encoding="utf-8")}
    assert set(PAGES) == {path for path in with_code if "_build" not in path.parts}


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
