"""Sphinx extension: roles that put a computed number into a sentence.

``{printed}`niu2024/table-3#scale.red``` shows the printed value, ``{computed}`` the computed value
and ``{verdict}`` the verdict. ``{fact}`niu2024/readings#best-joint``` shows a number of a study,
and ``{fact}`niu2024/table-3 differs``` a count. `tools/book_facts.py` writes the facts. An unknown
name fails the build.
"""

import json
from functools import cache
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxRole

from after_build import SAFE
from reproduce.printed.cells import anchor

FILE = Path("_build") / "facts.json"


@cache
def facts(path: Path, changed: float) -> dict[str, str]:
    """Read the facts from a file with a time of change."""
    return dict(json.loads(path.read_text(encoding="utf-8")))


def name_of(role: str, text: str) -> str:
    """Return the name under which a fact is stored.

    >>> name_of("computed", "niu2024/table-3#scale.red")
    'niu2024/table-3#scale.red computed'
    >>> name_of("fact", "niu2024/readings#best-joint")
    'niu2024/readings#best-joint'
    """
    return text if role == "fact" else f"{text} {role}"


class Fact(SphinxRole):
    """The text of a fact, with a class for the style sheet."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Look the fact up."""
        path = Path(self.env.srcdir) / FILE
        self.env.note_dependency(str(path))
        name = name_of(self.name, self.text)
        known = facts(path, path.stat().st_mtime)
        if name not in known:
            message = self.inliner.reporter.error(
                f"no fact is called {name!r}", line=self.lineno
            )
            return [], [message]
        about = self.text.partition(" ")[0]
        if self.name == "fact" and f"{about} printed" not in known:
            return [nodes.inline(self.rawtext, known[name], classes=["rp-fact"])], []
        # A fact of a printed cell is a link to the cell; `anchors` adds the page.
        uri = f"#{anchor(about)}"
        link = nodes.reference(self.rawtext, known[name], internal=True, refuri=uri)
        return [nodes.inline("", "", link, classes=["rp-fact"])], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the roles."""
    for role in ("printed", "computed", "verdict", "fact"):
        app.add_role(role, Fact())
    return SAFE
