"""What a reader takes away from a table or a figure: address, citation, data, function, inputs."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import Markup

from reproduce.views.writing.cite import citation

NOTHING = Markup("")
NAMES = {"tex": "LaTeX", "md": "Markdown"}


def bar(
    key: str,
    anchor: str,
    files: Iterable[str],
    source: str,
    *,
    cited: bool = True,
    inputs: Markup = NOTHING,
) -> Markup:
    """Return the bar below a table or a figure of a page.

    Its links lead to files below the root of the built book, ``#tables/KEY.csv``.

    Parameters
    ----------
    key : str
        Its key.
    anchor : str
        Its anchor on the page.
    files : iterable of str
        Paths of its data and pictures below the root of the book.
    source : str
        The text of the functions that make it, empty where there is none.
    cited : bool
        Whether it can be cited on its own.
    inputs : Markup
        What it is computed from, empty where it is not.
    """
    parts = [
        Markup('<a href="#{0}" aria-label="Permalink: {1}"><code>{1}</code></a>').format(
            anchor, key
        )
    ]
    if cited:
        texts = (citation(key, form) for form in ("bibtex", "text"))
        parts.append(_fold("Cite", Markup("").join(map(_block, texts))))
    link = Markup('<a href="#{}" download>{}</a>')
    named = [(path, path.rpartition(".")[2]) for path in files]
    links = [link.format(path, NAMES.get(kind, kind.upper())) for path, kind in named]
    parts.append(Markup("<span>{}</span>").format(Markup(" · ").join(links)))
    if source:
        parts.append(_fold("Function", _block(source)))
    if inputs:
        parts.append(_fold("Inputs", inputs))
    return Markup('<div class="rp-bar">{}</div>').format(Markup("\n").join(parts))


def _fold(summary: str, content: Markup) -> Markup:
    return Markup("<details><summary>{}</summary>{}</details>").format(summary, content)


def _block(text: str) -> Markup:
    return Markup('<pre tabindex="0">{}</pre>').format(text)
