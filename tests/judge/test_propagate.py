"""The rounding of inputs, propagated to results."""

import pytest

from reproduce.judge.propagate import plain_results, result_intervals
from reproduce.papers.declare import reproduces
from reproduce.printed.inputs import load_inputs

RED, GREEN = (f"niu2024/table-1#focal-length.{channel}" for channel in ("red", "green"))


@reproduces("niu2024/table-2", inputs=[RED, GREEN])
def ratio(inputs):
    """Ratio of two focal lengths, falling in one and rising in the other."""
    return {"scale.red": inputs[GREEN] / inputs[RED], "scale.blue": 1.0}


def test_the_corners_of_a_ratio():
    low, high, wide = result_intervals(ratio, load_inputs(ratio.inputs))["scale.red"]
    assert low == pytest.approx(24.99995 / 25.06015, rel=1e-14)
    assert high == pytest.approx(25.00005 / 25.06005, rel=1e-14)
    assert not wide


def test_a_result_without_inputs_is_a_point():
    assert result_intervals(ratio, load_inputs(ratio.inputs))["scale.blue"] == (
        1.0,
        1.0,
        False,
    )


NOMINAL = "chen2023/table-2#telescope-focal-length.value"


def test_an_input_printed_as_nominal_makes_the_results_that_follow_it_wide():
    @reproduces("niu2024/table-2", inputs=[GREEN, NOMINAL])
    def mixed(inputs):
        return {
            "scale.red": inputs[GREEN] / inputs[NOMINAL],
            "scale.blue": inputs[GREEN],
        }

    found = result_intervals(mixed, load_inputs(mixed.inputs))
    assert (found["scale.red"].wide, found["scale.blue"].wide) == (True, False)


BLUE, PER_CHANNEL = (
    "niu2024/table-1#focal-length.blue",
    "niu2024/text-approximations#parameters-per-channel",
)


@reproduces("niu2024/table-2", inputs=[RED, GREEN, BLUE, PER_CHANNEL])
def plain(inputs):
    """Copies and differences, and what only looks like them."""
    red, green, blue = inputs[RED], inputs[GREEN], inputs[BLUE]
    return {
        "copy": green,
        "largest": max(red, green, blue),
        "smallest": min(red, green, blue),
        "size": abs(-green),
        "count": float(inputs.count(PER_CHANNEL)),
        "difference": red - blue,
        "nothing": green - green,
        "negative": -green,
        "written in another way": (2 * green + red - red) / 2,
        "half": green / 2,
        "with an offset": green + 0.001,
        "equal by chance": 0.025,
        "equal, but moved by another": green + (blue - 0.02495),
        "a tie": max(green, 0.025),
        "ratio": green / red,
        "sum": red + green,
    }


def test_copies_and_differences_are_told_from_computations():
    """By how a result moves with its inputs, whatever the function looks like."""
    assert plain_results(plain, load_inputs(plain.inputs)) == {
        "copy": "copy",
        "negative": "copy",
        "size": "copy",
        "largest": "copy",
        "smallest": "copy",
        "a tie": "copy",
        "written in another way": "copy",
        "count": "copy",
        "difference": "difference",
        "nothing": "difference",
    }
