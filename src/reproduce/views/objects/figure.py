"""A figure, drawn from its caption and the text, in one panel or several."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from reproduce.judge.rerun import refuse_strays
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Drawing
from reproduce.printed.cells import anchor
from reproduce.views import computed, keys
from reproduce.views.objects.bar import bar
from reproduce.views.objects.base import Changeable, Item, Shown, setting
from reproduce.views.writing import figures
from reproduce.views.writing.blocks import Block, Html

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as MatplotlibFigure

    from reproduce.printed.given import Given


def with_bar(
    key: str,
    name: str,
    shown: figures.Vectors,
    alternative: str,
    caption: str,
    source: str,
    *,
    item: bool = False,
) -> Html:
    """Show a figure of the book under its anchor, its caption and its bar below."""
    below = captioned(caption) + bar(key, name, figures.figure_files(key), source, item=item)
    return Html(figures.inline(shown, name, alternative, below))


def captioned(caption: str) -> Markup:
    """Return a caption with the place into which the book writes the figure's number."""
    return Markup('<figcaption><span class="rp-number"></span>{}</figcaption>').format(caption)


def pictured(picture: figures.Picture, alternative: str, caption: str, source: str) -> Html:
    """Show a picture of the book, and, in a build of it, write the files that its bar offers."""
    figure = figures.drawn(picture.paint)
    slender = figures.drawn(picture.paint, narrow=True)
    shown = figures.Vectors(figures.vector_of(figure), figures.vector_of(slender))
    if build := os.environ.get(computed.FOLDER):
        downloads = Path(build).parent.parent / "_extra"
        if (downloads / ".nojekyll").is_file():  # a book's, and not a folder of somebody else's
            figures.write_files(figure, picture.key, downloads, picture.numbers, svg=shown.wide)
    return with_bar(picture.key, f"figure-{picture.key}", shown, alternative, caption, source)


class Figure(Changeable, Item):
    """A figure, drawn from its caption and the text.

    Parameters
    ----------
    key : str
        Such as ``chen2023/fig-11a``.
    changes : mapping, optional
        Address of any cell in `reads` to a value as in the print.
    seed : int, optional
        Of its random numbers, in place of the project's own.
    """

    kind = "a figure"

    def __init__(
        self, key: str, changes: Mapping[str, str | float] | None = None, seed: int | None = None
    ) -> None:
        if catalogue()[keys.check_key(key)].draw is None:
            known = ", ".join(figures.drawable())
            raise ValueError(f"{key} has no figure; these have one: {known}")
        super().__init__(key, changes, seed)

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

    def save(self, path: str | Path) -> Path:
        """Write the figure; the ending chooses svg, pdf or png."""
        figures.check_ending(Path(path))  # before anything is drawn
        figures.save(self.drawn, Path(path))
        return Path(path)

    def _told(self) -> str:
        remark = "a reader's own setting; what is marked as printed stays the print"
        return setting("With", self.changes, self.replaced, remark) if self.changes else ""

    def blocks(self) -> Iterator[Block]:
        """Yield the figure; in words what it shows, and how to look at it."""
        name = f"figure-{anchor(self.key)}" + ("-changed" if self.changes else "")
        told = self._told()
        alternative = f"{self.title}. {told}".rstrip()
        shown = figures.Vectors(figures.vector_of(self.drawn))
        setting = "".join(f' --set {name}="{text}"' for name, text in self._changes.items())
        setting += "" if self.seed is None else f" --seed {self.seed}"
        words = (
            f"{self.key}: {self.title}\n{self.place}; {self.data['curve'].nunique()} curves, "
            f"{len(self.data)} points in .data\n{told}\nDraw it with `reproduce figure {self.key} "
            f"--out FILE.svg{setting}`."
        )
        yield Html(figures.inline(shown, name, alternative), words.replace("\n\n", "\n"))


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
        **settings: object,
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
