"""Sphinx directive: questions to the authors of a paper, and the cells that each answer settles.

``data/letters.toml`` contains the questions, and ``data/verdicts.toml`` the question of each open
cell. ``{questions} niu2024`` lists the questions of a paper, sorted by their number of cells.
"""

from dataclasses import dataclass
from itertools import groupby

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from after_build import SAFE
from reproduce.judge.ledger import entries, frozen
from reproduce.printed.cells import anchor, find, library
from reproduce.views._blocks import link

FOLD = " <details><summary>The numbers</summary>{}.</details>"


@dataclass(frozen=True)
class Question:
    """A question to the authors, the cells that its answer settles, and related errata.

    `related` is another question whose answer is needed, `reply` the answer of the authors, and
    `state` is none, received, disputed or settled.
    """

    id: str
    paper: str
    ask: str
    text: str
    cells: tuple[str, ...]
    errata: tuple[str, ...]
    related: str = ""
    reply: str = ""
    state: str = "none"


def questions(paper: str) -> list[Question]:
    """Return the questions to the authors of a paper, sorted by their number of cells."""
    every = entries("letters.toml", "question")
    asked = [complete(**one) for one in every if one["paper"] == paper]
    return sorted(asked, key=lambda one: -len(one.cells))


def complete(id: str, errata: tuple[str, ...] = (), **entry: str) -> Question:
    """Return a question with its cells and errata; those of the cells are first."""
    named = {address: one for address, one in frozen().items() if one.question == id}
    known = dict.fromkeys([*(one.erratum for one in named.values()), *errata])
    if entry.get("reply"):
        entry["reply"] += f" ({entry['state']})"
    return Question(id, cells=tuple(named), errata=tuple(filter(None, known)), **entry)


def place(address: str) -> str:
    """Return the table or the section of a cell."""
    where, _, rest = library()[address.partition("#")[0]].place.partition(", ")
    return rest if where == "Text" else where


def settles(question: Question, number: dict[str, int]) -> str:
    """Return a sentence with the cells and errata of a question, and the reply."""
    text = "No number depends on it"
    if question.cells:
        related = (
            f", with the answer to {number[question.related]}"
            if question.related
            else ""
        )
        places = (
            f"{where}: {'; '.join(map(cell, some))}"
            for where, some in groupby(question.cells, place)
        )
        cells = ". ".join(places)
        text = f"It settles **{len(question.cells)}** of the numbers{related}"
    if question.errata:
        text += f". Entries of the register: {', '.join(link(one, one) for one in question.errata)}"
    text += f". Your reply: *{question.reply or 'none yet'}*."
    return f"{text}{FOLD.format(cells)}" if question.cells else text


def cell(address: str) -> str:
    """Return a link to a cell with its label."""
    return link(anchor(address), find(address)[0].label)


class Questions(SphinxDirective):
    """The list of the questions to the authors of a paper."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the questions as text of the page; they may contain roles."""
        asked = questions(self.arguments[0])
        number = {one.id: at for at, one in enumerate(asked, start=1)}
        lines = [
            f"{number[one.id]}. **{one.ask}**\n\n   {one.text}\n\n   {settles(one, number)}\n"
            for one in asked
        ]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("questions", Questions)
    return SAFE
