"""What a reader downloads says what the page says, and runs by itself."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup

from notebook_downloads import FOLDER, plain, spoken_in

BUILD = Path(__file__).resolve().parents[2] / "book" / "_build"
# A number that begins no longer word: digits, with decimals.
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\w)")
NOTEBOOKS = sorted((BUILD / FOLDER).rglob("*.ipynb"))


@pytest.fixture
def app(tmp_path: Path) -> SimpleNamespace:
    """As much of Sphinx as the words need: two pages, one of them a notebook."""
    (tmp_path / "_build/jupyter_execute/part").mkdir(parents=True)
    (tmp_path / "_build/jupyter_execute/part/two.ipynb").write_text("{}")
    facts = {"k#a computed": "4.2", "k#count": "7"}
    (tmp_path / "_build/facts.json").write_text(json.dumps(facts))
    titles = {"notation": "Notation", "part/two": "The second"}
    return SimpleNamespace(
        srcdir=str(tmp_path),
        outdir=str(tmp_path / "_build/html"),
        config=SimpleNamespace(equation_prefixes={"niu2024": "", "book": "B"}),
        env=SimpleNamespace(
            titles={
                name: SimpleNamespace(astext=lambda t=t: t)
                for name, t in titles.items()
            }
        ),
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("It is {computed}`k#a` of {fact}`k#count`.", "It is 4.2 of 7."),
        ("By {eq}`niu2024-17` and {eq}`book-3`", "By (17) and (B3)"),
        ("see {doc}`two`", "see [The second](../part/two.ipynb)"),
        ("see {doc}`words <two>`", "see [words](../part/two.ipynb)"),
        ("see {doc}`../notation`", "see *Notation*"),
        ("known {cite:p}`wahba1965,pair`", "known [wahba1965, pair]"),
        ("{py:func}`~reproduce.front.table`", "`table`"),
        ("{download}`text <../LICENSE>`", "text"),
    ],
)
def test_roles_become_what_they_stand_for(
    app: SimpleNamespace, text: str, said: str
) -> None:
    assert plain(text, spoken_in(app, "part/one"), str) == said


def test_an_unknown_number_fails_the_build(app: SimpleNamespace) -> None:
    with pytest.raises(KeyError, match="k#b"):
        plain("{computed}`k#b`", spoken_in(app, "part/one"), str)


@pytest.mark.browser
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_built_notebook_has_numbers_for_roles(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    words = "\n".join(
        "".join(c["source"]) for c in cells if c["cell_type"] == "markdown"
    )
    assert re.findall(r"\{[a-z:]+\}`|^\([^)\s]+\)=$|^`{3}\{", words, re.MULTILINE) == []
    links = re.findall(r"\]\(([^)#]+\.ipynb)\)", words)
    assert [link for link in links if not (path.parent / link).is_file()] == []
    # Random names would make each build another one.
    assert [cell["id"] for cell in cells] == [
        f"cell-{number}" for number in range(len(cells))
    ]


def shown(path: Path) -> tuple[list[str], set[str]]:
    """Return the headings of a page and the numbers in its words, without code and outputs."""
    html = (BUILD / "html" / path.relative_to(BUILD / FOLDER)).with_suffix(".html")
    article = BeautifulSoup(html.read_text(encoding="utf-8"), "html.parser").article
    assert article is not None
    for other in article.select(
        ".cell, .headerlink, .prev-next-footer, .eqno, script, details pre"
    ):
        other.decompose()
    heads = [
        head.get_text(" ", strip=True)
        for head in article.find_all(re.compile("h[1-4]"))
    ]
    return heads, set(NUMBER.findall(article.get_text(" ")))


@pytest.mark.browser
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_says_all_that_its_page_says(path: Path) -> None:
    """Its headings, every number of its sentences, its answer in short; and it has outputs."""
    notebook: Any = nbformat.reads(path.read_text(encoding="utf-8"), as_version=4)
    nbformat.validate(notebook)
    words = "\n".join(cell.source for cell in notebook.cells)
    heads, numbers = shown(path)
    assert heads
    words = words.replace("'", "’")
    told = " ".join(re.sub(r"[*`$]|^#+ ", "", words, flags=re.MULTILINE).split())
    assert [
        head for head in heads if " ".join(head.replace("'", "’").split()) not in told
    ] == []
    assert sorted(number for number in numbers if number not in words) == []
    assert all(cell.source.strip() for cell in notebook.cells)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert any(cell.outputs for cell in code) or not code
    assert all(cell.execution_count for cell in code)


@pytest.mark.browser
def test_every_notebook_is_offered_on_its_page() -> None:
    assert NOTEBOOKS, "no notebooks to read: run `make book` first"
    for path in NOTEBOOKS:
        name = path.relative_to(BUILD / FOLDER)
        page = (BUILD / "html" / name.with_suffix(".html")).read_text(encoding="utf-8")
        (offered,) = set(re.findall(r'href="([^"]*_sources/[^"]+\.ipynb)"', page))
        target = (BUILD / "html" / name).parent / offered
        assert target.resolve().read_bytes() == path.read_bytes()
