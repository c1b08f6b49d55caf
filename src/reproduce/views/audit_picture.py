"""The audit as a picture: which cell is in which contradiction, and in how many."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.audit.report import Audit, audit_paper
from reproduce.views import audit_words as words
from reproduce.views.figures import STYLE
from reproduce.views.inline_svg import inline
from reproduce.views.pages import Html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# As many cells as a page can show legibly.
MOST = 32


def picture(paper: str, alternative: str) -> Html:
    """Show relations against cells: a dot where a contradicting relation holds a blamed cell."""
    return Html(inline(draw(audit_paper(paper)), f"audit-{paper}", alternative))


def draw(audit: Audit) -> Figure:
    """Draw the contradictions of an audit."""
    from matplotlib import style
    from matplotlib.figure import Figure

    counts = audit.blamed()
    cells = sorted(counts, key=lambda address: (-counts[address], list(audit.cells).index(address)))
    cells = cells[:MOST]
    every = [f.relation for f in audit.read if f.outcome == "contradicts"]
    wrong = [relation for relation in every if set(cells) & set(relation.addresses)]
    others = len(every) - len(wrong)
    with style.context(STYLE):
        figure = Figure(figsize=(8.5, 1.6 + 0.2 * max(len(cells), 1)), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 1))
        for x, relation in enumerate(wrong):
            rows = [y for y, cell in enumerate(cells) if cell in relation.addresses]
            left.plot([x] * len(rows), rows, "-o", markersize=4, linewidth=0.8, color="C1")
        left.set_yticks(range(len(cells)), [words.short(cell) for cell in cells], fontsize=8)
        left.set_xticks(
            range(len(wrong)), [r.name for r in wrong], rotation=90, fontsize=8, ha="center"
        )
        left.set_ylim(len(cells) - 0.5, -0.5)
        more = f"; {others} more hold none of these cells" if others else ""
        left.set_title(f"relations that contradict{more}")
        right.barh(range(len(cells)), [counts[cell] for cell in cells], color="C0")
        right.set_xlabel("smallest sets")
        right.set_title("in how many")
    return figure
