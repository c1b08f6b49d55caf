"""What a reader takes away from a table or a figure: its address, citation, data and function."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from reproduce.printed.cells import anchor
from reproduce.views import cite

__all__ = ["bar"]


def bar(key: str, name: str, endings: Sequence[str], source: str) -> Markup:
    """Return the bar below an item.

    The links to its data name files below the root of the built book, ``#tables/KEY.csv``.

    Parameters
    ----------
    key : str
        The item.
    name : str
        Its anchor on the page.
    endings : sequence of str
        Files that the book carries of it, such as ``tables/{}.csv``.
    source : str
        The text of the functions that make it, empty where there is none.
    """
    file = '<a href="#{}" download>{}</a>'
    paths = [(one.format(anchor(key)), one.rpartition(".")[2]) for one in endings]
    files = Markup(" · ").join(
        Markup(file).format(path, "LaTeX" if kind == "tex" else kind.upper())
        for path, kind in paths
    )
    cited = Markup("<pre>{}</pre><pre>{}</pre>").format(
        cite.citation(key, "bibtex"), cite.citation(key, "text")
    )
    parts = [
        Markup('<a href="#{}" class="rp-permalink"><code>{}</code></a>').format(name, key),
        _fold("Cite", cited),
        Markup("<span>Data: {}</span>").format(files),
    ]
    if source:
        parts.append(_fold("Function", Markup("<pre>{}</pre>").format(source)))
    return Markup('<div class="rp-bar">{}</div>').format(Markup("\n").join(parts))


def _fold(summary: str, content: Markup) -> Markup:
    return Markup("<details><summary>{}</summary>{}</details>").format(summary, content)
