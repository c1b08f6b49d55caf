"""The downloaded notebooks: text, numbers and outputs of their pages."""

import re
from types import SimpleNamespace

import nbformat
import pytest
from bs4 import BeautifulSoup
from reading import HTML

import notebook_downloads
from notebook_downloads import FOLDER, install_code, plain, spoken_in

NOTEBOOKS = HTML.parent / FOLDER
# A number that does not begin a longer word.
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\w)")
HIDDEN = ".cell, .headerlink, .prev-next-footer, .eqno, script, details pre"
ROLES = {
    "It is {computed}`k#a` of {fact}`k#count`.": "It is 4.2 of 7.",
    "By {eq}`niu2024-17` and {eq}`book-3`": "By (17) and (B3)",
    "see {doc}`two`": "see [The second](../part/two.ipynb)",
    "see {doc}`words <two>`": "see [words](../part/two.ipynb)",
    "see {doc}`../notation`": "see *Notation*",
    "known {cite:p}`wahba1965,pair`": "known [wahba1965, pair]",
    "{py:func}`~reproduce.front.table`": "`table`",
    "{download}`text <../LICENSE>`": "text",
}


def test_roles_become_their_text(tmp_path):
    build = tmp_path / "_build"
    (build / "jupyter_execute/part").mkdir(parents=True)
    (build / "jupyter_execute/part/two.ipynb").write_text("{}")
    (build / "facts.json").write_text('{"k#a computed": "4.2", "k#count": "7"}')
    titles = {"notation": "Notation", "part/two": "The second"}
    titled = {n: SimpleNamespace(astext=lambda t=t: t) for n, t in titles.items()}
    config = SimpleNamespace(equation_prefixes={"niu2024": "", "book": "B"})
    app = SimpleNamespace(srcdir=tmp_path, outdir=build / "html", config=config)
    app.env = SimpleNamespace(titles=titled)
    for text, words in ROLES.items():
        assert plain(text, spoken_in(app, "part/one"), str) == words
    with pytest.raises(KeyError, match="k#b"):
        plain("{computed}`k#b`", spoken_in(app, "part/one"), str)


def test_a_notebook_installs_a_wheel_and_nothing_from_an_index(monkeypatch):
    for address, place in (
        ("", "--quiet ./reproduce_pointing-0."),
        ("https://a.org/b", "--quiet https://a.org/b/downloads/reproduce_pointing-0."),
    ):
        monkeypatch.setattr(notebook_downloads, "ADDRESS", address)
        assert place in install_code()
        assert install_code().endswith("-py3-none-any.whl")
    title = re.search("^# (.*)$", (HTML.parents[1] / "run.md").read_text("utf-8"), re.M)
    monkeypatch.setattr(notebook_downloads, "ADDRESS", "")
    assert f"the page '{title[1]}'" in install_code()


@pytest.mark.browser
def test_the_wheel_of_the_first_cell_is_next_to_the_book():
    wheel = install_code().rpartition("/")[2]
    assert (HTML / "downloads" / wheel).is_file()
    assert f"href='downloads/{wheel}'" in (HTML / "run.html").read_text("utf-8")


@pytest.mark.browser
def test_a_notebook_has_the_headings_and_numbers_of_its_page():
    paths = sorted(NOTEBOOKS.rglob("*.ipynb"))
    assert paths, "no notebooks to read: run `make book` first"
    for path in paths:
        html = HTML / path.relative_to(NOTEBOOKS).with_suffix(".html")
        page = html.read_text(encoding="utf-8")
        (offered,) = set(re.findall(r'href="([^"]*_sources/[^"]+\.ipynb)"', page))
        assert (html.parent / offered).read_bytes() == path.read_bytes()
        notebook = nbformat.reads(path.read_text("utf-8"), as_version=4)
        nbformat.validate(notebook)
        # Random names would change with each build.
        ids = [cell.id for cell in notebook.cells]
        assert ids == [f"cell-{number}" for number in range(len(ids))]
        install, *notebook.cells = notebook.cells
        assert install.source == install_code()
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert all(cell.execution_count for cell in code)
        text = "\n".join(cell.source for cell in notebook.cells).replace("'", "’")
        words = "\n".join(c.source for c in notebook.cells if c.cell_type == "markdown")
        assert not re.search(
            r"\{[a-z:]+\}`|^\([^)\s]+\)=$|^(`{3}|:::)\{", words, re.M
        ), path
        for link in re.findall(r"\]\(([^)#]+\.ipynb)\)", words):
            assert (path.parent / link).is_file()
        article = BeautifulSoup(page, "html.parser").article
        for hidden in article.select(HIDDEN):
            hidden.decompose()
        numbers = NUMBER.findall(article.get_text(" "))
        assert [number for number in numbers if number not in text] == []
        bare = " ".join(re.sub(r"[*`$]|^#+ ", "", text, flags=re.M).split())
        for head in article.find_all(re.compile("h[1-4]")):
            title = " ".join(head.get_text(" ", strip=True).split())
            assert title.replace("'", "’") in bare
