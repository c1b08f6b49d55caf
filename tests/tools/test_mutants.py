"""The mutants are drawn the same way each time, and from what computes."""

from pathlib import Path

import pytest

from mutants import Mutant, draw, left_out


def made(file: str, count: int) -> list[Mutant]:
    return [
        Mutant(file, "f", n, "core/AddNot", n, f"if x > {n}:")
        for n in range(1, count + 1)
    ]


MANY = [*made("physics/a.py", 600), *made("physics/b.py", 300), *made("audit/c.py", 99)]


def test_the_same_seed_draws_the_same_sample_and_another_one_another() -> None:
    assert draw(MANY, 100, 1) == draw(MANY[::-1], 100, 1)
    assert draw(MANY, 100, 1) != draw(MANY, 100, 2)


def test_every_file_gets_its_share_to_within_one() -> None:
    drawn = [one.file for one in draw(MANY, 100, 1)]
    assert len(drawn) == 100
    for file, count in {
        "physics/a.py": 600,
        "physics/b.py": 300,
        "audit/c.py": 99,
    }.items():
        assert abs(drawn.count(file) - 100 * count / 999) < 1


def test_no_more_is_drawn_than_there_is() -> None:
    assert draw(MANY, 5000, 1) == sorted(MANY, key=lambda one: (one.file, one.line))


def test_any_mutant_of_a_file_is_drawn_as_often_as_another_one() -> None:
    """Ten of a hundred, four hundred times: each forty times, give or take what chance gives."""
    hundred = made("physics/a.py", 100)
    counts = dict.fromkeys((one.line for one in hundred), 0)
    for seed in range(400):
        for one in draw(hundred, 10, seed):
            counts[one.line] += 1
    spread = sum((count - 40) ** 2 / (40 * 0.9) for count in counts.values())
    assert (
        60 < spread < 145
    )  # chi-square with 99 degrees of freedom, one in a thousand each side


def test_a_change_elsewhere_in_the_file_leaves_the_names_alone() -> None:
    one = Mutant("physics/a.py", "f", 10, "core/AddNot", 3, "if x > 0:")
    moved = Mutant("physics/a.py", "f", 17, "core/AddNot", 4, "if x > 0:")
    assert one.name == moved.name
    assert (
        one.name != Mutant("physics/a.py", "f", 10, "core/AddNot", 3, "if x > 1:").name
    )


SOURCE = """\
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    import os
@cache(1)
def f(x: int | float = 2) -> int | None:
    y: int | float = 3
    if x < 4:
        raise ValueError(f"got {x + 5}")
    return sum(zip(x, y, strict=True)) + 6
"""


@pytest.mark.parametrize(
    ("text", "spared"),
    [
        ("TYPE_CHECKING:", True),
        ("cache(1", True),
        ("int | float = 2", True),
        ("2)", False),
        ("int | None", True),
        ("int | float = 3", True),
        ("3\n", False),
        ("4:", False),
        ("5}", True),
        ("strict=True", True),
        ("6\n", False),
    ],
)
def test_only_what_computes_is_changed(text: str, spared: bool) -> None:
    start = SOURCE.index(text)
    spot = (SOURCE.count("\n", 0, start) + 1, start - SOURCE.rfind("\n", 0, start) - 1)
    assert any(low <= spot < high for low, high in left_out(SOURCE)) == spared


def test_the_folders_to_change_are_there() -> None:
    from mutant_runs import FOLDERS, PACKAGE, ROOT

    assert [(ROOT / PACKAGE / folder).is_dir() for folder in FOLDERS] == [True] * len(
        FOLDERS
    )
    assert Path(__file__).parents[2] == ROOT
