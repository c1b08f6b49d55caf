"""The letters to the authors: one question for each open cell."""

import re

import pytest
from reading import DESKTOP

from letters import complete, questions, settles
from reproduce.judge.ledger import frozen
from reproduce.printed.cells import PAPERS, anchor
from reproduce.views.consistency import errata_register

OPEN = {"differs", "ambiguous", "unpublished"}


def test_every_open_cell_is_settled_by_one_question():
    settled = [c for paper in PAPERS for one in questions(paper) for c in one.cells]
    verdicts = frozen()
    assert sorted(settled) == sorted(
        c for c, v in verdicts.items() if v.verdict in OPEN
    )
    assert {c for c, v in verdicts.items() if v.question} == set(settled)


def test_a_letter_has_six_to_eight_questions_on_its_paper_in_order():
    for paper in PAPERS:
        asked = questions(paper)
        names = [question.id for question in asked]
        assert 6 <= len(set(names)) == len(asked) <= 8
        errata = {entry.id for entry in errata_register() if entry.paper == paper}
        for number, question in enumerate(asked):
            assert all(cell.startswith(f"{paper}/") for cell in question.cells)
            assert errata >= set(question.errata)
            assert question.cells or question.errata
            assert bool(question.reply) is (question.state != "none")
            assert question.related in {"", *names[:number]}


def test_the_consequence_of_an_answer_has_links_and_the_reply():
    entry = {"paper": "niu2024", "ask": "Why?", "text": "", "related": "before"}
    question = complete("niu2024-scale-run", **entry)
    text = settles(question, {"before": 3})
    assert "answer to 3." in text
    shown, folded = text.split("<summary>")
    links = [re.findall('href="#([^"]+)"', part) for part in (shown, folded)]
    assert links == [[*question.errata], [*map(anchor, question.cells)]]
    reply = {"reply": "Name, on a day: a rerun.", "state": "settled"}
    answered = settles(complete("niu2024-scale-run", **entry, **reply), {"before": 3})
    assert "*Name, on a day: a rerun. (settled)*" in answered


@pytest.mark.browser
def test_letters_are_marked_as_not_sent_and_errata_lead_to_them(open_page):
    for paper in PAPERS:
        page = open_page(f"{paper}/letter.html", viewport=DESKTOP)
        assert "This letter has not been sent" in page.locator("article").inner_text()
        shown = page.locator("article ol > li").all_inner_texts()
        for question, text in zip(questions(paper), shown, strict=True):
            assert question.ask in text
        page = open_page("audit/errata.html", viewport=DESKTOP)
        links = page.locator(f"a[href='../{paper}/letter.html#letter-{paper}']")
        assert links.count() == sum(e.paper == paper for e in errata_register())
