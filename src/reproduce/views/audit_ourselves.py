"""What the page on the audit of ourselves calls: rounding residuals and detection power."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from reproduce.audit.report import audit_paper
from reproduce.audit.sight import Seen, blind, share, stored
from reproduce.judge.ledger import build
from reproduce.judge.residuals import Residuals, residuals
from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS
from reproduce.views.audit_pages import html_table
from reproduce.views.figures import STYLE
from reproduce.views.inline_svg import inline
from reproduce.views.pages import Html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The band of Dvoretzky, Kiefer and Wolfowitz holds the whole curve with this probability.
_CONFIDENCE = 0.95
_KINDS = {
    "digit": "one digit changed",
    "swap": "two neighbours swapped",
    "drop": "a digit dropped",
    "sign": "the sign changed",
}


@functools.cache
def _slips() -> tuple[Seen, ...]:
    path = data_folder() / "studies" / "detection-power.toml"
    return tuple(stored(path.read_text(encoding="utf-8"))[1])


@functools.cache
def _residuals(paper: str) -> Residuals:
    return residuals(build(), paper)


def power_by_kind() -> Html:
    """Show how many planted slips are seen, by kind of slip."""
    counts = share(_slips(), lambda slip: _KINDS[slip.plant.kind])
    return Html(_power_table(counts, "Slip", "Slips seen, by kind"))


def power_by_table() -> Html:
    """Show how many planted slips are seen, table by table."""
    counts = share(_slips(), lambda slip: slip.plant.address.partition("#")[0])
    return Html(_power_table(counts, "Table or group", "Slips seen, by table"))


def _power_table(counts: dict[str, tuple[int, int, int, int]], head: str, caption: str) -> Markup:
    heads = (head, "Planted", "By a relation", "By a verdict", "By either", "Share")
    sums = tuple(sum(column) for column in zip(*counts.values(), strict=True))
    rows = []
    for name, numbers in [*counts.items(), ("all", sums)]:
        part = f"{numbers[3] / numbers[0]:.0%}"
        rows.append([Markup("{}").format(entry) for entry in (name, *numbers, part)])
    return html_table(heads, rows, caption, "rp-table rp-score")


def unseen() -> Html:
    """Show the cells in which no planted slip of any kind is seen, and why."""
    examined = {address for paper in PAPERS for address in audit_paper(paper).examined}
    rows = []
    for address in blind(_slips()):
        why = "in no relation"
        if address in examined:
            why = "the relations that hold it already contradict, or leave it room"
        rows.append([Markup("<code>{}</code>").format(address), Markup("{}").format(why)])
    return Html(
        html_table(("Cell", "Why"), rows, "Cells no check sees", "rp-table rp-small rp-audit")
    )


def rounding(alternative: str) -> Html:
    """Show the distribution of the rounding residuals, a panel for each paper.

    Parameters
    ----------
    alternative : str
        What the figure shows, for readers who cannot see it.

    Returns
    -------
    Html
        Inline SVG.
    """
    return Html(inline(draw_rounding(), "audit-rounding", alternative))


def draw_rounding() -> Figure:
    """Draw the empirical distribution of the residuals with its band.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each paper; the uniform law is the straight line.
    """
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(figsize=(6.4, 3.2), layout="constrained")
        for axes, paper in zip(figure.subplots(1, len(PAPERS), sharey=True), PAPERS, strict=True):
            found = _residuals(paper)
            axes.plot([-0.5, 0.5], [0.0, 1.0], "--", linewidth=1, label="uniform")
            if found.values.size:
                steps = np.concatenate([[-0.5], np.sort(found.values), [0.5]])
                heights = np.append(np.arange(steps.size - 1) / found.values.size, 1.0)
                half = np.sqrt(np.log(2 / (1 - _CONFIDENCE)) / (2 * found.values.size))
                low, high = (np.clip(heights + side * half, 0, 1) for side in (-1, 1))
                axes.step(steps, heights, where="post", label="cells")
                axes.fill_between(steps, low, high, step="post", alpha=0.2, label="band")
            axes.set_title(f"{paper}: {found.values.size} of {found.exact} exact cells")
            axes.set_xlabel("units of the last digit")
            axes.set_ylim(0, 1)
        figure.axes[0].set_ylabel("share of cells")
        figure.axes[0].legend(loc="upper left")
    return figure


def glue() -> None:
    """Make the numbers of this page available to its sentences.

    ``sight-planted``, ``sight-seen``, ``sight-share``, ``sight-blind``, ``sight-relations``,
    ``sight-verdicts``, ``sight-refused``, and for each paper ``residuals-NAME-telling`` and
    ``residuals-NAME-exact``.
    """
    from myst_nb import glue as glue_one

    planted, related, judged, either = share(_slips(), lambda slip: "all")["all"]
    said = {
        "sight-planted": planted,
        "sight-seen": either,
        "sight-share": f"{either / planted:.0%}".replace("%", "\u202f%"),
        "sight-relations": related,
        "sight-verdicts": judged,
        "sight-refused": sum(slip.refused and not slip.either for slip in _slips()),
        "sight-blind": len(blind(_slips())),
    }
    for paper in PAPERS:
        said[f"residuals-{paper}-telling"] = _residuals(paper).values.size
        said[f"residuals-{paper}-exact"] = _residuals(paper).exact
    for label, value in said.items():
        glue_one(label, str(value), display=False)
