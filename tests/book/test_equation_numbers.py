"""An equation's label holds the number that the page shows."""

import pytest

from equation_numbers import printed_number

PREFIXES = {"niu2024": "", "chen2023": "", "book": "B"}


@pytest.mark.parametrize(
    ("label", "number"),
    [
        ("niu2024-17", "17"),
        ("chen2023-2", "2"),
        ("chen2023-11-printed", "11, as extracted"),
        ("niu2024-4b", "4b"),
        ("book-3", "B3"),
    ],
)
def test_number_is_read_off_the_label(label: str, number: str) -> None:
    assert printed_number(label, PREFIXES) == number


@pytest.mark.parametrize(
    "label", ["energy", "smith1999-1", "niu2024", "niu2024-x", "niu2024-1-2"]
)
def test_a_label_without_a_number_is_refused(label: str) -> None:
    assert printed_number(label, PREFIXES) is None
