"""A printed number is its digits and the interval of values that round to them."""

import math

import pytest
from hypothesis import given, strategies

from reproduce.printed.number import PrintedNumber


def test_trailing_zeros_set_the_last_digit():
    for text, value, half_unit in (
        ("25.0000", 25.0, 0.00005),
        ("2000", 2000.0, 0.5),
        ("5.7e-5", 5.7e-5, 0.05e-5),
        ("-0.050", -0.05, 0.0005),
        ("0", 0.0, 0.5),
    ):
        number = PrintedNumber(text)
        assert (number.value, number.half_unit) == pytest.approx((value, half_unit))


def test_a_count_is_a_point_except_for_rounding_errors():
    number = PrintedNumber("137", exact=True)
    assert (number.half_unit, *number.interval()) == (0.0, 137.0, 137.0)
    for ratio, agrees in ((1 + 1e-13, True), (1 + 1e-8, False)):
        assert number.overlaps(137 * ratio, 137 * ratio) == agrees


@pytest.mark.parametrize(
    ("text", "qualifier", "low", "high"),
    [
        ("1.0", "less", -math.inf, 1.0),
        ("1.0", "greater", 1.0, math.inf),
        ("1.0", "at-least", 1.0, math.inf),
        ("-0.1", "within", -0.1, 0.1),
        ("0.060", "about", 0.055, 0.065),  # 0.06 with a zero for the format
        ("0.045", "about", 0.044, 0.046),
        ("90", "about", 85.0, 95.0),
        ("483.940", "about", 483.935, 483.945),
        ("3.78e-3", "about", 3.77e-3, 3.79e-3),
        ("0", "about", -1.0, 1.0),
        ("2000.0", "nominal", 1900.0, 2100.0),
        ("-2000", "nominal", -2100.0, -1900.0),
        ("0.060", None, 0.0595, 0.0605),
    ],
)
def test_a_qualifier_determines_the_interval(text, qualifier, low, high):
    number = PrintedNumber(text, qualifier=qualifier)
    assert number.interval() == pytest.approx((low, high), rel=1e-12)
    is_limit = qualifier in {"less", "greater", "at-least", "within"}
    assert (number.half_width == 0) == is_limit


@pytest.mark.parametrize("text", ["", "-", "1,5", "0x1", "nan", "inf", "about 3"])
def test_words_are_rejected(text):
    with pytest.raises(ValueError, match="text: "):
        PrintedNumber(text)


@given(strategies.decimals(-1000, 1000, places=3), strategies.floats(0.01, 5.0))
def test_values_agree_and_round_to_the_digits_inside_the_interval_only(decimal, part):
    number = PrintedNumber(f"{decimal:.3f}")
    for side in (-part, part):
        value = number.value + side * number.half_unit
        if abs(part - 1) > 0.01:
            assert number.overlaps(value, value) == (part < 1)
            assert (float(number.format(value, 0)) == number.value) == (part < 1)


@pytest.mark.parametrize(
    ("text", "value", "extra", "shown"),
    [
        ("0.9976", 0.99764, 0, "0.9976"),
        ("0.9976", 0.99764, 1, "0.99764"),
        ("5.7e-5", 5.68e-5, 1, "5.68e-5"),
        ("280", 233.333, 0, "233"),
        ("-0.040", -0.0002, 0, "0.000"),
        ("0.9976", 1e300, 1, "1e+300"),
        ("5.7e-5", -1.25e30, 0, "-1.25e+30"),
        ("280", 123456789012345.0, 0, "123456789012345"),
        ("0.9976", math.nan, 1, "NaN"),
    ],
)
def test_computed_values_have_the_printed_format(text, value, extra, shown):
    assert PrintedNumber(text).format(value, extra=extra) == shown
