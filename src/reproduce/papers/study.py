"""Results of our own that stand beside a paper: a table in words, judged against nothing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Study:
    """A table of results that no paper prints.

    Parameters
    ----------
    caption : str
        What it shows, in one sentence.
    head : tuple of str
        Names of the columns, with units.
    rows : tuple of tuple of str
        Entries, as many in each row as there are columns; the first names the row.

    Examples
    --------
    >>> Study("Squares", ("n", "square"), (("2", "4"),)).rows[0]
    ('2', '4')
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.head)]
        if wrong or not self.rows:
            raise ValueError(
                f"rows: expected {len(self.head)} entries each, got {wrong or 'no rows'}"
            )
