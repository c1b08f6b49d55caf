"""A printed number is its digits and the interval of values that print so."""

import pytest
from hypothesis import given, strategies

from reproduce.printed.number import PrintedNumber


@pytest.mark.parametrize(
    ("text", "value", "half_unit"),
    [
        ("25.0000", 25.0, 0.00005),
        ("2000", 2000.0, 0.5),
        ("5.7e-5", 5.7e-5, 0.05e-5),
        ("-0.050", -0.05, 0.0005),
        ("0", 0.0, 0.5),
    ],
)
def test_trailing_zeros_set_the_last_digit(text, value, half_unit):
    number = PrintedNumber(text)
    assert number.value == pytest.approx(value, rel=1e-15)
    assert number.half_unit == pytest.approx(half_unit, rel=1e-15)


def test_a_count_is_a_point():
    number = PrintedNumber("137", exact=True)
    assert number.interval() == (137.0, 137.0)
    assert not number.overlaps(137.4, 137.4)


def test_a_count_computed_in_floating_point_is_met_but_for_its_last_bits():
    number = PrintedNumber("137", exact=True)
    assert number.overlaps(137 * (1 + 1e-13), 137 * (1 + 1e-13))
    assert not number.overlaps(137 * (1 + 1e-8), 137 * (1 + 1e-8))


@pytest.mark.parametrize(
    ("qualifier", "inside", "outside"),
    [
        ("less", 0.9, 1.1),
        ("greater", 1.1, 0.9),
        ("at-least", 1.0, 0.9),
        ("within", -0.9, -1.1),
        ("about", 1.49, 1.51),
        ("about", 0.51, 0.49),
        ("nominal", 1.04, 1.06),
        ("nominal", 0.96, 0.94),
        (None, 0.96, 0.94),
    ],
)
def test_qualifiers_shape_the_interval(qualifier, inside, outside):
    number = PrintedNumber("1.0", qualifier=qualifier)
    assert number.overlaps(inside, inside)
    assert not number.overlaps(outside, outside)


@pytest.mark.parametrize(
    ("text", "qualifier", "half_width"),
    [
        ("0.060", "about", 0.005),  # 0.06, filled up with a zero
        ("0.045", "about", 0.001),
        ("22", "about", 1.0),
        ("90", "about", 5.0),
        ("483.940", "about", 0.005),
        ("3.78e-3", "about", 0.01e-3),
        ("0", "about", 1.0),
        ("2000", "nominal", 100.0),
        ("2000.0", "nominal", 100.0),  # more digits do not make an instrument truer
        ("-2000", "nominal", 100.0),
        ("0.060", None, 0.0005),
        ("0.1", "within", 0.0),
    ],
)
def test_what_a_qualifier_leaves_open(text, qualifier, half_width):
    number = PrintedNumber(text, qualifier=qualifier)
    assert number.half_width == pytest.approx(half_width, rel=1e-12)
    if qualifier != "within":
        ends = (number.value - half_width, number.value + half_width)
        assert number.interval() == pytest.approx(ends)


@pytest.mark.parametrize("text", ["", "-", "1,5", "0x1", "nan", "inf", "about 3"])
def test_words_are_refused(text):
    with pytest.raises(ValueError, match="digits of a number"):
        PrintedNumber(text)


@given(strategies.decimals(-1000, 1000, places=3), strategies.floats(-0.49, 0.49))
def test_every_value_inside_the_interval_prints_the_same(decimal, part):
    number = PrintedNumber(f"{decimal:.3f}")
    value = number.value + 2 * part * number.half_unit
    assert number.overlaps(value, value)
    assert float(number.format(value)) == number.value


@given(strategies.decimals(-1000, 1000, places=3), strategies.floats(1.01, 5.0))
def test_no_value_outside_the_interval_is_accepted(decimal, part):
    number = PrintedNumber(f"{decimal:.3f}")
    for side in (-1, 1):
        value = number.value + side * part * number.half_unit
        assert not number.overlaps(value, value)


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
    ],
)
def test_computed_values_are_written_like_the_print(text, value, extra, shown):
    assert PrintedNumber(text).format(value, extra=extra) == shown
