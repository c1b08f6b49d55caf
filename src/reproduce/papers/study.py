"""Tables of our own beside a paper: declared once, numbers in a DataFrame, no verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from reproduce.papers.words import Column, words
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    import pandas as pd

# Draws that must lie beyond a value before their count says how likely it is.
LEAST_DRAWS = 20


@dataclass(frozen=True)
class Fact:
    """A number or a word of a study that sentences quote; `form` and `zero` as in `Column`."""

    value: float | str
    form: str = ""
    unit: str = ""
    zero: float = 0.0


def first_line(function: Callable[..., object]) -> str:
    """Return the first line of a function's docstring, without its full stop."""
    return (function.__doc__ or "").strip().split("\n")[0].rstrip(".")


@dataclass(frozen=True)
class Study:
    """A table that no paper prints, with what it reads.

    Parameters
    ----------
    key : str
        Such as ``chen2023/heat``.
    function : callable
        Takes the door, if anything is given, and returns the rows, or a DataFrame whose ``attrs``
        fill the blanks of the caption.
    columns : tuple of Column
        As many as a row has entries; the first names the row.
    caption : str
        What it shows, in one or two sentences.
    folded : str
        The name of a column by whose values a long table is shown in parts.
    settings : mapping
        Arguments of `function` that a reader may give, each with what it is; all are numbers.
    given : tuple of str
        Addresses of all printed cells that it reads.
    named : callable, optional
        Takes what `function` takes and returns the facts that sentences quote, by name.
    random : bool
        Whether it draws random numbers, with seeds from the door's root.
    """

    key: str
    function: Callable[..., Iterable[Sequence[Any]] | pd.DataFrame]
    columns: tuple[Column, ...]
    caption: str
    folded: str
    settings: Mapping[str, str]
    given: tuple[str, ...] = ()
    named: Callable[..., Mapping[str, Fact]] | None = None
    random: bool = False

    @property
    def title(self) -> str:
        """What it shows: the first line of the function's docstring."""
        return first_line(self.function)

    def __call__(self, door: Given | None = None, **settings: float) -> pd.DataFrame:
        """Compute the table, from the print or from what another door holds."""
        import pandas as pd

        found = self.function(*self._doors(door), **settings)
        frame = found if isinstance(found, pd.DataFrame) else self.frame(found)
        if list(frame.columns) != [column.name for column in self.columns]:
            raise ValueError(
                f"{self.key}: expected the columns {[c.name for c in self.columns]}, got "
                f"{list(frame.columns)}"
            )
        frame.attrs["caption"] = self.caption.format_map(frame.attrs)
        return frame

    def facts(self) -> Mapping[str, Fact]:
        """Compute what sentences quote of it, by name."""
        return self.named(*self._doors()) if self.named else {}

    def frame(self, rows: Iterable[Sequence[Any]], **blanks: Any) -> pd.DataFrame:
        """Return rows under the declared heads, with what fills the blanks of the caption."""
        import pandas as pd

        rows = list(rows)
        wrong = [row for row in rows if len(row) != len(self.columns)]
        if wrong or not rows:
            raise ValueError(
                f"{self.key}: expected rows of {len(self.columns)} entries, got "
                f"{wrong or 'no rows'}"
            )
        frame = pd.DataFrame(rows, columns=[column.name for column in self.columns])
        frame.attrs.update(blanks)
        return frame

    def _doors(self, door: Given | None = None) -> list[Given]:
        return [given(self.given) if door is None else door] if self.given else []


def studied(
    key: str,
    *,
    given: Sequence[str] = (),
    named: Callable[..., Mapping[str, Fact]] | None = None,
    random: bool = False,
    columns: Sequence[Column] = (),
    caption: str = "",
    folded: str = "",
    settings: Mapping[str, str] | None = None,
) -> Callable[[Callable[..., Any]], Study]:
    """Declare that a function computes the study `key`; the arguments are those of `Study`.

    Heads, caption, folding and settings are the texts of the key in the paper's file of words.
    """
    text = words(key)
    shown = (tuple(columns or text.columns), caption or text.caption, folded or text.folded)
    left = settings or text.settings
    return lambda function: Study(key, function, *shown, left, tuple(given), named, random)
