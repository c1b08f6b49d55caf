"""The index of a paper: every table, figure and group of quoted numbers, with its score."""

from __future__ import annotations

from markupsafe import Markup

from reproduce.judge.verdicts import VERDICTS
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import anchor, library
from reproduce.views import keys, record_text
from reproduce.views.build import item_ledger
from reproduce.views.grid import Entry, Grid

__all__ = ["index"]


def index(paper: str) -> Grid:
    """List the items of a paper in order of print; each leads to its place."""
    shown = [verdict for verdict in VERDICTS if verdict != "pending"]
    badge = Markup('<span class="rp-badge rp-badge-{0}">{0}</span>').format
    rows: list[list[Entry]] = []
    for key in (one for one in catalogue() if one.startswith(f"{paper}/")):
        held = key in library()
        tally = record_text.tally(item_ledger(key).of(key)) if held else {}
        counts = [str(tally.get(verdict) or "·") if held else "" for verdict in shown]
        target = anchor(key) if held else f"figure-{anchor(key)}"
        place = keys.place(key).partition(",")[0]
        link = Markup('<a href="#{}">{}</a>').format(target, place)
        rows.append([link, Markup("{}<br><code>{}</code>").format(keys.title(key), key), *counts])
    caption = f"Tables, figures and quoted numbers of {paper}, in order of print."
    return Grid(caption, ["", "", *map(badge, shown)], rows, kind="rp-score")
