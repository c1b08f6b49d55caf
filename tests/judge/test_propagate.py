"""The rounding of inputs, propagated to results."""

from reproduce.judge._propagate import plain_results
from reproduce.papers.declare import reproduces
from reproduce.printed.inputs import load_inputs

RED, GREEN, BLUE = (
    f"niu2024/table-1#focal-length.{channel}" for channel in ("red", "green", "blue")
)
PER_CHANNEL = "niu2024/text-approximations#parameters-per-channel"


@reproduces("niu2024/table-2", inputs=[RED, GREEN, BLUE, PER_CHANNEL])
def plain(inputs):
    """Copies and differences, and results that are similar to them."""
    red, green, blue = inputs[RED], inputs[GREEN], inputs[BLUE]
    return {
        "copy": green,
        "copy, largest": max(red, green, blue),
        "copy, smallest": min(red, green, blue),
        "copy, size": abs(-green),
        "copy, count": float(inputs.count(PER_CHANNEL)),
        "copy, negative": -green,
        "copy, written in another way": (2 * green + red - red) / 2,
        "copy, a tie": max(green, 0.025),
        "difference": red - blue,
        "difference, nothing": green - green,
        "half": green / 2,
        "with an offset": green + 0.001,
        "equal by chance": 0.025,
        "equal, but moved by another": green + (blue - 0.02495),
        "ratio": green / red,
        "sum": red + green,
    }


def test_copies_and_differences_are_distinguished_from_computations():
    """By the response of a result to its inputs, for any form of the function."""
    inputs = load_inputs(plain.inputs)
    kinds = ("copy", "difference")
    expected = {name: name.partition(",")[0] for name in plain(inputs)}
    assert plain_results(plain, inputs) == {
        name: kind for name, kind in expected.items() if name.startswith(kinds)
    }
