"""Sphinx directive: what a letter asks the authors of a paper, and what each answer would settle.

``data/letters.toml`` holds the questions; ``data/verdicts.toml`` names the one that would settle a
cell. ``{questions} niu2024`` lists those of a paper, the ones that settle most first.
"""

import tomllib
from dataclasses import dataclass
from itertools import groupby

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from reproduce.judge.ledger import frozen
from reproduce.locate import data_folder
from reproduce.printed.cells import anchor, library


@dataclass(frozen=True)
class Question:
    """What authors are asked; `cells` are those that the answer settles, `errata` what it bears on.

    `beside` is a question whose answer is needed as well, `reply` what the authors say to it.
    """

    id: str
    paper: str
    ask: str
    text: str
    cells: tuple[str, ...]
    errata: tuple[str, ...]
    beside: str = ""
    reply: str = ""


def questions(paper: str) -> list[Question]:
    """Return the questions to the authors of a paper, those that settle most cells first."""
    text = (data_folder() / "letters.toml").read_text(encoding="utf-8")
    asked = [
        complete(**one)
        for one in tomllib.loads(text)["question"]
        if one["paper"] == paper
    ]
    return sorted(asked, key=lambda one: -len(one.cells))


def complete(id: str, errata: tuple[str, ...] = (), **entry: str) -> Question:
    """Return a question with the cells that name it, and errata: of these cells, then its own."""
    named = {address: one for address, one in frozen().items() if one.question == id}
    known = dict.fromkeys([*(one.erratum for one in named.values()), *errata])
    return Question(id, cells=tuple(named), errata=tuple(filter(None, known)), **entry)


def link(name: str, text: str) -> str:
    """Link to an anchor on whatever page it is."""
    return f'<a href="#{name}">{text}</a>'


def place(address: str) -> str:
    """Return the table or the section that holds a cell."""
    where, _, rest = library()[address.partition("#")[0]].place.partition(", ")
    return rest if where == "Text" else where


def settles(question: Question, number: dict[str, int]) -> str:
    """Say which cells an answer settles, which errata it bears on, and what the reply is."""
    told = "No number depends on it"
    if question.cells:
        beside = (
            f", with the answer to {number[question.beside]}" if question.beside else ""
        )
        places = (
            f"{where}: {', '.join(map(cell, some))}"
            for where, some in groupby(question.cells, place)
        )
        told = f"It settles **{len(question.cells)}** of the numbers{beside}: {'; '.join(places)}"
    if question.errata:
        told += f". Entries of the register: {', '.join(link(one, one) for one in question.errata)}"
    return f"{told}. Your reply: *{question.reply or 'none yet'}*."


def cell(address: str) -> str:
    """Link to a cell by its name."""
    return link(anchor(address), f"<code>{address.partition('#')[2]}</code>")


class Questions(SphinxDirective):
    """The list of the questions to the authors of a paper."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write the questions as the text of a page, so that they may hold roles."""
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
    return {"parallel_read_safe": True, "parallel_write_safe": True}
