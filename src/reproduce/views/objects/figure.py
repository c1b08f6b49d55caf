"""A figure, drawn from its caption and the text, in one panel or several, or a drawing of ours."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge.rerun import refuse_strays
from reproduce.papers.catalogue import drawings
from reproduce.papers.declare import Drawing
from reproduce.papers.words import words
from reproduce.printed.cells import anchor
from reproduce.views import computed
from reproduce.views.facts import filled
from reproduce.views.objects.bar import bar
from reproduce.views.objects.base import Changeable, Item, Shown, setting, text_of
from reproduce.views.writing import figures, numbers
from reproduce.views.writing.blocks import Block, Html

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as MatplotlibFigure

    from reproduce.printed.given import Given


def captioned(caption: str) -> Markup:
    """Return a caption with the place into which the book writes the figure's number."""
    return Markup('<figcaption><span class="rp-number"></span>{}</figcaption>').format(caption)


def pictured(picture: figures.Picture, alternative: str, caption: str, source: str) -> Html:
    """Show a picture of the book, and, in a build of it, write the files that its bar offers."""
    root = None
    if build := os.environ.get(computed.FOLDER):
        downloads = Path(build).parent.parent / "_extra"
        # A book's, and not a folder of somebody else's.
        root = downloads if (downloads / ".nojekyll").is_file() else None
    shown = figures.vectors(picture, root)
    name = f"figure-{picture.key}"
    offered = bar(picture.key, name, figures.figure_files(picture.key), source, cited=False)
    return Html(figures.inline(shown, name, alternative, captioned(caption) + offered))


class Figure(Changeable, Item):
    """A figure of a paper, drawn from its caption and the text, or a drawing of our own.

    Parameters
    ----------
    key : str
        Such as ``chen2023/fig-11a``, or ``niu2024/drawing-registration``.
    changes : mapping, optional
        Address of any cell in `reads` to a value as in the print.
    seed : int, optional
        Of its random numbers, in place of the project's own.
    """

    kind = "a figure"

    @property
    def _declared(self) -> Drawing:
        return figures.declared(self.key)

    def _compute(self, door: Given | None) -> MatplotlibFigure:
        return figures.draw(self.key, door)

    @property
    def drawn(self) -> MatplotlibFigure:
        """The matplotlib figure."""
        figure: MatplotlibFigure = self._made[0]
        return figure

    @cached_property
    def data(self) -> pd.DataFrame:
        """The lines and points that are drawn, in the units of the axes."""
        return figures.data(self.drawn)

    def frame(self) -> pd.DataFrame:
        """Return `data`."""
        return self.data

    @property
    def source(self) -> str:
        """The text of the functions that compute and draw it."""
        return text_of(self._declared.function) if self.key in drawings() else super().source

    def save(self, path: str | Path) -> Path:
        """Write the figure; the ending chooses svg, pdf or png."""
        figures.check_ending(Path(path))  # before anything is drawn
        figures.save(self.drawn, Path(path))
        return Path(path)

    @cached_property
    def caption(self) -> str:
        """What it shows, and of a reader's own setting, what was changed."""
        if self.changes:
            remark = "a reader's own setting; what is marked as printed stays the print"
            return f"{self.title}. {setting('With', self.changes, self.replaced, remark)}"
        return self._filled(words(self.key).figure.caption)

    @cached_property
    def alternative(self) -> str:
        """What a reader who does not see it is told."""
        return self.caption if self.changes else self._filled(words(self.key).figure.alternative)

    def _filled(self, text: str) -> str:
        named = self._declared.named
        known = {name: numbers.fact(one) for name, one in named().items()} if named else {}
        return numbers.powers(filled(text, known))

    def blocks(self) -> Iterator[Block]:
        """Yield the figure with its caption; a terminal is told how to look at it."""
        name = f"figure-{anchor(self.key)}"
        if self.key in drawings():
            name = f"drawing-{anchor(self.key.replace('/drawing-', '/'))}"
        told = "".join(f' --set {address}="{text}"' for address, text in self._changes.items())
        told += "" if self.seed is None else f" --seed {self.seed}"
        text = (
            f"{self.key}: {self.title}\n{self.place}; lines and points in .data\n"
            f"{textwrap.fill(self.caption, 79)}\n"
            f"Draw it with `reproduce figure {self.key} --out FILE.svg{told}`."
        )
        below = captioned(self.caption)
        if self.changes:
            name = f"{name}-changed"
        else:
            source = text_of(self._declared.function)
            below += bar(self.key, name, figures.figure_files(self.key), source)
        # A page of the book has a narrow drawing beside the wide one; a reader's notebook has one.
        shown = (
            figures.in_build(self.key)
            if computed.kept() and not self.changes
            else figures.Vectors(figures.vector_of(self.drawn))
        )
        yield Html(figures.inline(shown, name, self.alternative, below), text)


class Panels(Shown):
    """A figure of several panels, such as ``chen2023/fig-11``, each drawn on its own.

    Parameters
    ----------
    key : str
        The key of the panels without their letters.
    panels : tuple of Figure
        One or more.
    """

    def __init__(self, key: str, panels: tuple[Figure, ...]) -> None:
        self.key, self.panels = key, panels

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that any panel reads."""
        return tuple(dict.fromkeys(address for one in self.panels for address in one.reads))

    @property
    def source(self) -> str:
        """The text of the functions that compute and draw the panels."""
        return "\n\n".join(one.source for one in self.panels)

    @cached_property
    def data(self) -> pd.DataFrame:
        """The lines and points of all panels, with the key of each."""
        import pandas as pd

        return pd.concat([one.data.assign(figure=one.key) for one in self.panels])

    def frame(self) -> pd.DataFrame:
        """Return `data`."""
        return self.data

    def rerun(
        self,
        changes: Mapping[str, str | float] | None = None,
        *,
        seed: int | None = None,
        **settings: Any,
    ) -> Panels:
        """Return the panels drawn again; each takes what it reads, and a seed where it draws."""
        told = dict(changes or {})
        refuse_strays(self.key, told, self.reads)
        random = [one for one in self.panels if one.random] or self.panels
        again = (
            one.rerun(
                {a: value for a, value in told.items() if a in one.reads},
                seed=seed if one in random else None,
                **settings,
            )
            for one in self.panels
        )
        return Panels(self.key, tuple(again))

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the panels and their paper."""
        return "\n\n".join(one.cite(form) for one in self.panels)

    def save(self, path: str | Path) -> list[Path]:
        """Write a file for each panel, its letter behind the name: fig.svg becomes fig-a.svg."""
        path = Path(path)
        return [one.save(path.with_stem(f"{path.stem}-{one.key[-1]}")) for one in self.panels]

    def blocks(self) -> Iterator[Block]:
        """Yield each panel."""
        for one in self.panels:
            yield from one.blocks()
