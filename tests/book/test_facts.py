"""The numbers of sentences: computed once, looked up by roles, and missed where there are none."""

import io
import json
import re
from pathlib import Path

import pytest
from sphinx.application import Sphinx

import book_facts as facts
import page_cells
from reproduce.papers.posteriors import posteriors
from reproduce.views import computed

BOOK = Path(__file__).resolve().parents[2] / "book"
ROLE = re.compile(r"\{(printed|computed|verdict|fact)\}`([^`]+)`")
PAGES = [path for path in BOOK.rglob("*.md") if "_build" not in path.parts]
# Double precision holds sixteen digits: nothing is worth saying to better than this.
NOISE = re.compile(r"10⁻1[3-9]|10⁻¹[³-⁹]|\d[eE][-−]1[3-9]")


@pytest.fixture(scope="module")
def known() -> dict[str, str]:
    """The facts without those of pages and posteriors, whose tests run and sample them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(facts, "of_pages", lambda pages: {})
        return facts.unsampled()


def test_every_number_of_a_sentence_is_known(known):
    wanted = {
        name if role == "fact" else f"{name} {role}"
        for path in PAGES
        for role, name in ROLE.findall(path.read_text(encoding="utf-8"))
    }
    assert len(wanted) > 200
    apart = ("posterior/", "instruments/")
    assert {name for name in wanted if not name.startswith(apart)} <= set(known)


def test_a_fact_says_something_and_no_rounding_noise(known):
    assert [
        name for name, text in known.items() if not text or NOISE.search(text)
    ] == []


def test_all_facts_are_those_of_the_ledger_and_of_every_posterior(monkeypatch):
    monkeypatch.setattr(facts, "unsampled", lambda: {"a": "1"})
    monkeypatch.setattr(facts, "of_posteriors", lambda names: dict.fromkeys(names, "2"))
    assert facts.facts() == {"a": "1", **dict.fromkeys(posteriors(), "2")}


def test_facts_are_those_of_the_ledger(known):
    assert known["niu2024/table-3#scale.red printed"] == "0.9973"
    assert known["niu2024/table-3#scale.red verdict"] == "differs"
    assert known["all cells"] == str(
        int(known["niu2024 cells"]) + int(known["chen2023 cells"])
    )


def test_a_build_computes_the_ledger_once(tmp_path, monkeypatch):
    key, calls = "niu2024/table-2", []
    alone = computed.item_ledger(key)

    def build():
        calls.append("once")
        return alone

    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    monkeypatch.setattr(computed.ledger, "build", build)
    cached = (computed.kept, computed.item_ledger, computed.whole_ledger)
    try:
        for _ in range(2):
            for one in cached:
                one.cache_clear()
            assert computed.item_ledger(key) == alone
        assert calls == ["once"]
    finally:
        for one in cached:
            one.cache_clear()


def test_facts_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(facts, "facts", lambda: {"a": "1"})
    facts.write_facts(tmp_path / "new" / "facts.json")
    assert json.loads((tmp_path / "new" / "facts.json").read_text()) == {"a": "1"}


def built(folder: Path, text: str) -> tuple[str, str]:
    """Build a page with the roles; return what the build complains of, and the page."""
    (folder / "_build").mkdir()
    (folder / "_build" / "facts.json").write_text(json.dumps({"k#a computed": "4.2"}))
    (folder / "index.md").write_text(f"# Page\n\n{text}\n")
    out, complaints = folder / "out", io.StringIO()
    app = Sphinx(
        str(folder),
        None,
        str(out),
        str(out),
        "text",
        status=None,
        warning=complaints,
        confoverrides={"extensions": ["myst_parser", "fact_roles"]},
    )
    app.build()
    return complaints.getvalue(), (out / "index.txt").read_text()


def test_a_role_puts_the_number_into_the_sentence(tmp_path):
    complaints, page = built(tmp_path, "It is {computed}`k#a` or {fact}`k#a computed`.")
    assert "It is 4.2 or 4.2." in page
    assert "ERROR" not in complaints


def test_a_number_that_is_not_there_is_an_error_of_the_build(tmp_path):
    complaints, _ = built(tmp_path, "It is {printed}`k#a`.")
    assert "index.md:3: ERROR: no fact is called 'k#a printed'" in complaints


def test_numbers_that_a_page_collects_are_facts(tmp_path, monkeypatch):
    """Pages without such numbers are not run."""
    head = "---\nfile_format: mystnb\n---\n\n"
    cell = "```{{code-cell}} ipython3\n{}\n```\n"
    series = 'import pandas as pd\nquoted = pd.Series({"shift": f"{-0.1:.2f} px"})'
    (tmp_path / "one.md").write_text(head + cell.format(series))
    (tmp_path / "two.md").write_text(head + cell.format("1 / 0"))
    monkeypatch.setattr(page_cells, "BOOK", tmp_path)
    assert facts.of_pages(sorted(tmp_path.glob("*.md"))) == {
        "one#shift": "−0.10\u202fpx"
    }
