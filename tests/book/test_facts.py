"""The facts of sentences: computed once, looked up by roles, errors if absent."""

import io
import json
import re
from pathlib import Path

from sphinx.application import Sphinx

import book_facts as facts
import page_cells
from reproduce.papers.posteriors import posteriors

ROLE = re.compile(r"\{(printed|computed|verdict|fact)\}`([^`]+)`")
# Rounding noise of double precision, which has sixteen digits.
NOISE = re.compile(r"10⁻1[3-9]|10⁻¹[³-⁹]|\d[eE][-−]1[3-9]")
PAGE = "---\nfile_format: mystnb\n---\n\n```{{code-cell}} ipython3\n{}\n```\n"


def test_every_number_of_a_sentence_is_known(monkeypatch):
    """Except the facts of pages and posteriors, whose tests run and sample them."""
    monkeypatch.setattr(facts, "of_pages", lambda pages: {})
    known = facts.unsampled()
    pages = (p for p in page_cells.BOOK.rglob("*.md") if "_build" not in p.parts)
    used = {
        name if role == "fact" else f"{name} {role}"
        for page in pages
        for role, name in ROLE.findall(page.read_text(encoding="utf-8"))
    }
    assert len(used) > 200
    other = ("posterior/", "instruments/")
    assert {name for name in used if not name.startswith(other)} <= set(known)
    assert [n for n, text in known.items() if not text or NOISE.search(text)] == []
    papers = (known["niu2024 cells"], known["chen2023 cells"])
    assert int(known["all cells"]) == sum(map(int, papers))


def test_all_facts_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(facts, "unsampled", lambda: {"a": "1"})
    monkeypatch.setattr(facts, "of_posteriors", lambda names: dict.fromkeys(names, "2"))
    facts.write_facts(tmp_path / "new" / "facts.json")
    written = json.loads((tmp_path / "new" / "facts.json").read_text())
    assert written == {"a": "1", **dict.fromkeys(posteriors(), "2")}


def test_roles_put_numbers_into_sentences_and_unknown_numbers_are_errors(tmp_path):
    (tmp_path / "_build").mkdir()
    (tmp_path / "_build/facts.json").write_text('{"k#a computed": "4.2"}')
    text = "It is {computed}`k#a` or {fact}`k#a computed`.\n\nNot {printed}`k#a`."
    (tmp_path / "index.md").write_text(f"# Page\n\n{text}\n")
    out, warning = str(tmp_path / "out"), io.StringIO()
    settings = {"extensions": ["myst_parser", "fact_roles"]}
    streams = {"status": None, "warning": warning}
    Sphinx(tmp_path, None, out, out, "text", settings, **streams).build()
    assert "It is 4.2 or 4.2." in Path(out, "index.txt").read_text()
    (error,) = re.findall(r"index\.md:(\d+): ERROR: .*'(.*)'", warning.getvalue())
    assert error == ("5", "k#a printed")


def test_the_numbers_that_a_page_collects_are_facts(tmp_path, monkeypatch):
    """Pages without such numbers are not run."""
    series = 'import pandas as pd\nquoted = pd.Series({"shift": f"{-0.1:.2f} px"})'
    for name, code in (("one", series), ("two", "1 / 0")):
        (tmp_path / f"{name}.md").write_text(PAGE.format(code))
    monkeypatch.setattr(page_cells, "BOOK", tmp_path)
    found = facts.of_pages(sorted(tmp_path.glob("*.md")))
    assert found == {"one#shift": "−0.10\u202fpx"}


def test_constants_of_the_verdicts_are_facts():
    constants = {"central": "99 %", "outside": "1 %", "nominal": "5 %", "wide": "10 %"}
    expected = {name: text.replace(" ", "\u202f") for name, text in constants.items()}
    assert facts._of_constants() == expected
