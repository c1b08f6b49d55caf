"""What the page on the audit of ourselves calls: rounding residuals and detection power."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from reproduce.audit.report import audit_paper
from reproduce.audit.sight import Counts, Seen, blind, share, stored, why_unseen
from reproduce.judge.ledger import build
from reproduce.judge.residuals import Residuals, residuals, unrounded
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


@functools.cache
def _transforms(paper: str) -> Residuals:
    return unrounded(build(), paper)


def power_by_kind() -> Html:
    """Show how many planted slips are seen, by kind of slip."""
    counts = share(_slips(), lambda slip: _KINDS[slip.plant.kind])
    return Html(_power_table(counts, "Slip", "Slips seen, by kind"))


def power_by_table() -> Html:
    """Show how many planted slips are seen, table by table."""
    counts = share(_slips(), lambda slip: slip.plant.address.partition("#")[0])
    return Html(_power_table(counts, "Table or group", "Slips seen, by table"))


def _power_table(counts: dict[str, Counts], head: str, caption: str) -> Markup:
    heads = (head, "Planted", "By comparing", "By any relation", "By a verdict", "By any", "Share")
    sums = tuple(sum(column) for column in zip(*counts.values(), strict=True))
    rows = []
    for name, numbers in [*counts.items(), ("all", sums)]:
        part = f"{numbers[-1] / numbers[0]:.0%}"
        rows.append([Markup("{}").format(entry) for entry in (name, *numbers, part)])
    return html_table(heads, rows, caption, "rp-table rp-score")


def unseen() -> Html:
    """Show which planted slips nothing sees, and why.

    Returns
    -------
    Html
        How many for each reason; below it, folded away, every number with what escapes in it.
    """
    audits = {paper: audit_paper(paper) for paper in PAPERS}
    escaped: dict[str, dict[str, list[str]]] = {}
    for slip in (slip for slip in _slips() if not slip.either):
        address = slip.plant.address
        why = why_unseen(slip, audits[address.partition("/")[0]])
        escaped.setdefault(why, {}).setdefault(address, []).append(slip.plant.text)
    cell = Markup("{}").format
    counts = [
        [cell(why), cell(sum(map(len, x.values()))), cell(len(x))] for why, x in escaped.items()
    ]
    heads = ("Why", "Slips", "In numbers")
    told = html_table(heads, counts, "Slips that no check sees", "rp-table rp-small")
    rows = [
        [Markup("<code>{}</code>").format(address), cell(", ".join(texts)), cell(why)]
        for why, numbers in escaped.items()
        for address, texts in numbers.items()
    ]
    every = html_table(("Number", "Printed as", "Why"), rows, "What escapes", "rp-table rp-small")
    folded = Markup('<details class="rp-fold"><summary>All {} numbers</summary>{}</details>')
    return Html(told + folded.format(len(rows), every))


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
    return _drawn({paper: _residuals(paper) for paper in PAPERS}, -0.5, "units of the last digit")


def transforms(alternative: str) -> Html:
    """Show the residuals of all cells, each placed in the law that rounded inputs give it.

    Parameters
    ----------
    alternative : str
        What the figure shows, for readers who cannot see it.

    Returns
    -------
    Html
        Inline SVG.
    """
    return Html(inline(draw_transforms(), "audit-transforms", alternative))


def draw_transforms() -> Figure:
    """Draw the empirical distribution of the transformed residuals.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each paper; the uniform law is the straight line.
    """
    found = {paper: _transforms(paper) for paper in PAPERS}
    return _drawn(found, 0.0, "place in its law, from 0 to 1")


def _drawn(found: Mapping[str, Residuals], start: float, label: str) -> Figure:
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(figsize=(6.4, 3.2), layout="constrained")
        panels = figure.subplots(1, len(found), sharey=True)
        for axes, (paper, seen) in zip(panels, found.items(), strict=True):
            axes.plot([start, start + 1.0], [0.0, 1.0], "--", linewidth=1, label="uniform")
            if seen.values.size:
                steps = np.concatenate([[start], np.sort(seen.values), [start + 1.0]])
                heights = np.append(np.arange(steps.size - 1) / seen.values.size, 1.0)
                half = np.sqrt(np.log(2 / (1 - _CONFIDENCE)) / (2 * seen.values.size))
                low, high = (np.clip(heights + side * half, 0, 1) for side in (-1, 1))
                axes.step(steps, heights, where="post", label="cells")
                axes.fill_between(
                    steps,
                    low,
                    high,
                    step="post",
                    facecolor=("C0", 0.15),
                    edgecolor="C0",
                    label="band",
                )
            axes.set_title(f"{paper}: {seen.values.size} of {seen.exact} exact cells")
            axes.set_xlabel(label)
            axes.set_ylim(0, 1)
        figure.axes[0].set_ylabel("share of cells")
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3
        )
    return figure


def glue() -> None:
    """Make the numbers of this page available to its sentences.

    ``sight-planted``, ``sight-seen``, ``sight-share``, ``sight-blind``, ``sight-compared``,
    ``sight-strict``, ``sight-strict-share``,
    ``sight-relations``, ``sight-verdicts``, ``sight-refused``, and for each paper
    ``residuals-NAME-telling``, ``residuals-NAME-exact``, ``transforms-NAME-telling`` and
    ``transforms-NAME-probability``.
    """
    from myst_nb import glue as glue_one

    planted, compared, related, judged, either = share(_slips(), lambda slip: "all")["all"]
    said = {
        "sight-planted": planted,
        "sight-seen": either,
        "sight-share": f"{either / planted:.0%}".replace("%", "\u202f%"),
        "sight-compared": compared,
        "sight-strict": (strict := sum(slip.compared or slip.verdict for slip in _slips())),
        "sight-strict-share": f"{strict / planted:.0%}".replace("%", "\u202f%"),
        "sight-relations": related,
        "sight-verdicts": judged,
        "sight-refused": sum(slip.refused and not slip.either for slip in _slips()),
        "sight-blind": len(blind(_slips())),
    }
    for paper in PAPERS:
        said[f"residuals-{paper}-telling"] = _residuals(paper).values.size
        said[f"residuals-{paper}-exact"] = _residuals(paper).exact
        said[f"transforms-{paper}-telling"] = _transforms(paper).values.size
        said[f"transforms-{paper}-probability"] = f"{_transforms(paper).probability:.2f}"
    for label, value in said.items():
        glue_one(label, str(value), display=False)
