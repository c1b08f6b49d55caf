"""What the book's pages call beside the front door: figures, legend, downloads, versions."""

from __future__ import annotations

import platform
from importlib import metadata

import numpy as np
from markupsafe import Markup

from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import papers
from reproduce.papers.catalogue import drawings
from reproduce.papers.niu2024 import simulation_angles
from reproduce.printed.cells import anchor
from reproduce.printed.given import given
from reproduce.version import __version__
from reproduce.views.book.build import shipped
from reproduce.views.book.facts import filled
from reproduce.views.keys import check_key
from reproduce.views.objects.base import text_of
from reproduce.views.objects.figure import with_bar
from reproduce.views.writing import numbers, verdicts
from reproduce.views.writing.cite import citation as citation_of
from reproduce.views.writing.display import Grid, Html
from reproduce.views.writing.figures import declared, vectors

__all__ = [
    *("angle_arrangements", "citation", "downloads", "figure", "source"),
    *("verdict_legend", "versions"),
]


def figure(key: str, alternative: str, caption: str) -> Html:
    """Show a figure that follows the page's light or dark theme, with its caption below."""
    named = declared(key).named
    facts = {name: numbers.fact(quoted) for name, quoted in named().items()} if named else {}
    own = key in drawings()
    name = f"{'drawing' if own else 'figure'}-{anchor(key)}"
    text, told = (numbers.powers(filled(one, facts)) for one in (alternative, caption))
    source = text_of(declared(key).function)
    return with_bar(key, name, vectors(key), text, told, source, item=not own)


def verdict_legend() -> Html:
    """Show what the verdict words mean."""
    term = Markup('<dt><span class="rp-badge rp-badge-{0}">{0}</span></dt><dd>{1}</dd>')
    terms = Markup("\n").join(
        term.format(verdict, verdicts.MEANINGS[verdict]) for verdict in VERDICTS
    )
    return Html(Markup('<dl class="rp-legend">\n{}\n</dl>').format(terms))


def citation(key: str) -> Html:
    """Show how to cite a reproduced item, in words."""
    entries = citation_of(key, "text").splitlines()
    items = Markup("").join(Markup("<li>{}</li>").format(entry) for entry in entries)
    return Html(Markup('<ul class="rp-citation">{}</ul>').format(items))


def source(key: str) -> Html:
    """Show the file of printed numbers of an item."""
    path = papers()[check_key(key).partition("/")[0]] / "printed" / f"{key}.toml"
    return Html(Markup('<pre class="rp-source">{}</pre>').format(path.read_text(encoding="utf-8")))


def downloads() -> Html:
    """Show links to the ledger, its schema and every item's table, as shipped beside the pages."""
    link = Markup('<li><a href="{0}" download><code>{0}</code></a>: {1}</li>')
    items = [link.format(name, what) for name, what in shipped().items()]
    return Html(Markup('<ul class="rp-downloads">{}</ul>').format(Markup("").join(items)))


def versions() -> Html:
    """Show what the book was built with."""
    names = ("numpy", "scipy", "matplotlib", "pandas", "emcee", "jupyter-book")
    rows = {"Python": platform.python_version(), "reproduce-pointing": __version__}
    rows |= {name: metadata.version(name) for name in names}
    return Html(Grid("What the book was built with.", ("", "version"), list(rows.items())).html)


def angle_arrangements() -> Html:
    """Show every arrangement of rotation angles that has the count niu2024 prints."""
    door = given(simulation_angles.READS)
    used = simulation_angles.literal(door).name
    half = np.degrees(simulation_angles.half_ranges(door)).round(3).tolist()
    found = simulation_angles.candidates(door)
    rows = []
    for one in found:
        choices = Markup("; ").join((one.lattice, one.offset, one.window))
        if one.name == used:
            choices += Markup("<br><strong>in use</strong>")
        zero = "yes" if np.isclose(one.angles, 0).all(axis=-1).any() else "no"
        rows.append([_picture(np.degrees(one.angles).round(3).tolist(), half), choices, zero])
    caption = f"The {len(found)} arrangements with exactly {len(found[0].angles)} angles."
    head = ("Angles", "Lattice, offset, outline", "Zero position")
    return Html(Grid(caption, head, rows).html)


def _picture(angles: list[list[float]], half: list[float]) -> Markup:
    """Draw angles within the printed range, to its scale."""
    wide, high = half
    box = Markup('<rect x="{}" y="{}" width="{}" height="{}" {}/>').format(
        -wide,
        -high,
        2 * wide,
        2 * high,
        Markup('fill="none" stroke="currentColor" stroke-width="0.08" opacity="0.5"'),
    )
    dot = Markup('<circle cx="{}" cy="{}" r="0.2" fill="currentColor"/>')
    dots = Markup("").join(dot.format(x, -y) for x, y in angles)
    view = f"{-wide - 0.4} {-high - 0.4} {2 * wide + 0.8} {2 * high + 0.8}"
    svg = Markup('<svg viewBox="{}" width="128" aria-hidden="true">{}{}</svg>')
    return svg.format(view, box, dots)
