"""The letters to the authors: one question settles each cell that is open."""

import re

import pytest
from playwright.sync_api import Browser
from reading import DESKTOP, HTML

from letters import complete, place, questions, settles
from reproduce.judge.ledger import frozen
from reproduce.printed.cells import PAPERS, anchor
from reproduce.views.consistency import errata_register

ASKED = {paper: questions(paper) for paper in PAPERS}


def test_every_open_cell_is_settled_by_one_question():
    settled = [cell for asked in ASKED.values() for one in asked for cell in one.cells]
    words = {"differs", "ambiguous", "unpublished"}
    open_cells = {cell for cell, one in frozen().items() if one.verdict in words}
    assert sorted(settled) == sorted(open_cells)
    assert not [
        cell
        for cell, one in frozen().items()
        if one.question and cell not in open_cells
    ]


@pytest.mark.parametrize("paper", PAPERS)
def test_a_letter_asks_six_to_eight_questions_of_its_own_paper_in_order(paper):
    asked = ASKED[paper]
    assert 6 <= len(asked) <= 8
    assert len({one.id for one in asked}) == len(asked)
    counts = [len(one.cells) for one in asked]
    assert counts == sorted(counts, reverse=True)
    known = {one.id for one in errata_register() if one.paper == paper}
    for at, one in enumerate(asked):
        assert all(cell.startswith(f"{paper}/") for cell in one.cells)
        assert set(one.errata) <= known
        assert one.cells or one.errata, one.id
        assert one.beside in {"", *(other.id for other in asked[:at])}, one.id


def test_what_an_answer_settles_is_said_with_links_and_the_reply():
    numbers = {"before": 3}
    entry = {"paper": "niu2024", "ask": "Why?", "text": "", "beside": "before"}
    one = complete("niu2024-scale-run", **entry)
    told = settles(one, numbers)
    assert told.startswith(
        "It settles **2** of the numbers, with the answer to 3: Table 3: "
    )
    assert re.findall('href="#([^"]+)"', told) == [*map(anchor, one.cells), *one.errata]
    assert told.endswith("Your reply: *none yet*.")
    answered = complete(
        "niu2024-scale-run", **entry, reply="Made-up name, on a day: a rerun."
    )
    assert settles(answered, numbers).endswith(
        "Your reply: *Made-up name, on a day: a rerun.*."
    )
    assert "No number" in settles(complete("none", **entry, errata=("x",)), numbers)


def test_a_quoted_number_is_placed_by_its_section():
    assert place("niu2024/table-3#scale.red") == "Table 3"
    assert place("niu2024/text-experiment#exposure") == "section 4.3"


@pytest.mark.browser
@pytest.mark.parametrize("paper", PAPERS)
def test_a_letter_says_that_nothing_is_sent_and_errata_lead_to_it(
    browser: Browser, paper: str
):
    page = browser.new_page(viewport=DESKTOP)
    page.goto((HTML / paper / "letter.html").as_uri())
    assert "This letter has not been sent" in page.locator("article").inner_text()
    shown = page.locator("article ol > li").all_inner_texts()
    assert len(shown) == len(ASKED[paper])
    for one, text in zip(ASKED[paper], shown, strict=True):
        assert one.ask in text
        assert (f"It settles {len(one.cells)} of" in text) is bool(one.cells)
    page.goto((HTML / "audit" / "errata.html").as_uri())
    leads = page.locator(f"a[href='../{paper}/letter.html#letter-{paper}']")
    assert leads.count() == sum(one.paper == paper for one in errata_register())
    page.close()
