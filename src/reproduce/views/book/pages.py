"""What the book's pages call beside the front door: figures, legend, downloads, versions."""

from __future__ import annotations

import platform
from importlib import metadata

from markupsafe import Markup

from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import papers
from reproduce.papers.catalogue import drawings
from reproduce.printed.cells import anchor
from reproduce.version import __version__
from reproduce.views.book.build import shipped
from reproduce.views.book.facts import filled
from reproduce.views.keys import check_key
from reproduce.views.objects.base import text_of
from reproduce.views.objects.figure import with_bar
from reproduce.views.writing import numbers, verdicts
from reproduce.views.writing.blocks import Grid, Html
from reproduce.views.writing.cite import citation as citation_of
from reproduce.views.writing.display import Blocks
from reproduce.views.writing.figures import declared, vectors

__all__ = ["citation", "downloads", "figure", "source", "verdict_legend", "versions"]


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


def versions() -> Blocks:
    """Show what the book was built with."""
    names = ("numpy", "scipy", "matplotlib", "pandas", "emcee", "jupyter-book")
    rows = {"Python": platform.python_version(), "reproduce-pointing": __version__}
    rows |= {name: metadata.version(name) for name in names}
    return Blocks((Grid("What the book was built with.", ("", "version"), list(rows.items())),))
