"""The outcomes of relations, and numbers checked by hand."""

import math

import numpy as np
import pytest
from made_up import audited_table, finding, printed_cell

from reproduce.consistency._equations import _ITERATION_STEPS
from reproduce.consistency.report import audit_paper

TEXT = """
[[relations.all]]
name = "only"
formula = "{formula}"
cells = "{cells}"
kind = "equation"
source = "s"
"""


def outcomes(formula, *numbers):
    """Return the outcome for cells a, b, c with these printed digits, and the rescuing rule."""
    names = "abcd"[: len(numbers)]
    pairs = zip(names, numbers, strict=True)
    cells = {f"t#{name}": printed_cell(f"t#{name}", text) for name, text in pairs}
    text = TEXT.format(formula=formula, cells=" ".join(f"{n}=t#{n}" for n in names))
    (found,) = audited_table("made up", cells, text).findings
    return found.outcome, found.rescued_by


@pytest.mark.parametrize(
    ("formula", "numbers", "outcome"),
    [
        ("a = b / c", "0.33 1.0 3.0", "agrees"),
        ("a = b / c", "0.15 1 8", "rounding"),
        ("a = b * c", "2.2 1.5 1.5", "agrees"),  # a tie, half to even
        ("a = b * c", "2.6 1.7 1.6", "rounding"),
        # 2.79 is printed as 2.7 by truncation, but not by rounding.
        ("a = b * c", "2.7 1.55 1.8", "rounding"),
        ("a = b + c", "4.0 1.0 2.0", "contradicts"),
        ("a <= b", "1.0 1.1", "agrees"),
        ("a <= b", "1.1 1.05", "rounding"),
        ("a <= b", "1.3 1.1", "contradicts"),
        ("a >= b", "1.1 1.0", "agrees"),
        ("a >= b", "1.0 1.1", "rounding"),
        ("a >= b", "1.1 1.3", "contradicts"),
        ("a + b = c", "1.0 2.0 3.0", "agrees"),
        ("a + b = c", "1.0 2.0 3.1", "rounding"),
        # Two printed digits of one number touch at a tie, which rounds to one of them.
        ("a = b", "10 11", "contradicts"),
        ("a = b", "0.25 0.2", "rounding"),
        ("a = b", "0.26 0.2", "contradicts"),
        ("a = b + 0 * c", "10 11 1", "rounding"),
        ("abs(a) + abs(b) <= c", "1.0 -1.0 1.5", "contradicts"),
    ],
)
def test_outcomes(formula, numbers, outcome):
    assert outcomes(formula, *numbers.split())[0].endswith(outcome)


def test_a_rounding_rule_that_lifts_a_contradiction_is_named():
    assert outcomes("a = 2 * b", "3.5", "1.70") == ("contradicts", "ceiling")
    numbers = ("9.0", "1.1", "1.1", "1.1")
    assert outcomes("a = b + c + d", *numbers) == ("contradicts", "")


@pytest.mark.parametrize(
    ("paper", "relation", "right", "unit"),
    [
        ("niu2024", "scale-red", 25.0237 / 25.0304, 1),
        ("niu2024", "scale-blue", 25.0237 / 25.0134, 1),
        ("niu2024", "after-noise-blue", 2 * 0.05, 1),
        ("chen2023", "motion-4-y", 70.31 - 9.95, 1e-6),
        # One image takes from 85/400 to 23/100 s: about 90 s, and about 22 s.
        ("chen2023", "time-ground", 100 * (85 / 400 + 23 / 100) / 2, 1),
    ],
)
def test_right_sides_are_those_computed_by_hand(paper, relation, right, unit):
    """Relations that restate a computed number are compared with the computation."""
    found = finding(audit_paper(paper), relation).right / unit
    assert found == pytest.approx(right, rel=1e-9)


def test_left_sides_of_inequalities_by_hand():
    audit = audit_paper("niu2024")
    radius = math.hypot(*np.tan(np.radians([8, 6]))) / math.sqrt(3)
    points = np.radians(np.linspace(-1, 1, 401))
    x, y = 25 * np.tan(8 * points)[:, None], 25 * np.tan(6 * points)
    square = x**2 + y**2
    moved = (4.9e-5 - 5.7e-5) * np.mean(square**2) / np.mean(square)
    best = 25 / 25.0601 * (1 + moved)
    left = abs(0.9973 - best) * 25 / 3.45e-3 * radius
    assert finding(audit, "left-over-red").left == pytest.approx(left, rel=0.01)


def test_printed_equations_give_the_numbers_computed_by_hand():
    shown = {
        d.name: d for p in ("niu2024", "chen2023") for d in audit_paper(p).equations
    }
    assert shown["rotary-matrix"].printed == pytest.approx(math.cos(math.radians(16)))
    assert shown["unit-circle"].printed == pytest.approx(math.cos(math.radians(0.14)))
    ratio = shown["distortion-ratio"]
    assert ratio.printed / ratio.right == pytest.approx(1 / 0.9976)
    assert ratio.right == pytest.approx(0.9976**3 * 4.9 / 5.7)
    # The error of the shift equals the shift at first, and doubles with every step.
    assert shown["iteration"].printed == pytest.approx(
        2**_ITERATION_STEPS * math.hypot(0.3, 0.5), rel=1e-3
    )
    assert shown["stage-angle"].right == pytest.approx(-10.3132, abs=1e-4)
    assert shown["stage-signs"].printed == -shown["stage-signs"].wanted


def test_last_digits_are_compared_for_a_relation_of_kind_print():
    text = TEXT.format(formula="min(x) = max(x)", cells="x=t#*")
    text = text.replace("equation", "print")
    for third, outcome in (("3.47", "agrees"), ("3.4", "contradicts")):
        numbers = enumerate(["1.20", "0.05", third])
        cells = {f"t#{i}": printed_cell(f"t#{i}", one, "mm") for i, one in numbers}
        (found,) = audited_table("made up", cells, text).findings
        assert found.outcome == outcome
