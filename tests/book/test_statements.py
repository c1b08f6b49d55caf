"""Statements of pages, letters and register that rest on a number, against that number."""

import numpy as np
from bench import ARCSEC
from scipy.stats import chi2

from book_facts import of_ledger
from reproduce.judge.ledger import frozen
from reproduce.papers.chen2023 import effectiveness
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs


def test_one_pointing_error_agrees_within_the_rounding_of_the_residuals():
    """The letter to the authors of niu2024: the other three need the rounding of the pitch."""
    text = library()["niu2024/text-experiment"]
    angle = (
        3.45e-6 / 25.0237e-3 / ARCSEC
    )  # of one pixel, pitch and focal length as exact
    agreeing = set()
    for place in ("red-x", "red-y", "blue-x", "blue-y"):
        residual, printed = (
            float(text[f"{name}-{place}"].text)
            for name in ("rmse-after", "pointing-error")
        )
        if abs(residual * angle - printed) <= 0.5e-4 * angle + 0.5e-4:
            agreeing.add(place)
    assert agreeing == {"blue-x"}


def test_the_differences_are_within_the_central_99_percent_and_beyond_the_upper_percent():
    """The register on Table V: means of 100 images of white noise, all eight differences."""
    row = effectiveness._differences(
        load_inputs(effectiveness._differences.inputs)
    ).iloc[1]
    _, found, freedom, chance = row
    assert chi2.ppf(0.99, freedom) < found < chi2.ppf(0.995, freedom)
    assert abs(chance - chi2.sf(found, freedom)) < 1e-9


def test_the_first_page_trusts_what_agrees():
    """Its third column: yes, no, cannot be checked, open."""
    found = frozen()
    expected = {
        "niu2024/table-2#scale.red": "exact",
        "niu2024/table-3#rotation.red": "consistent",
        "niu2024/table-3#rotation.blue": "consistent",
        "niu2024/table-3#scale.red": "differs",
        "niu2024/table-3#scale.blue": "differs",
        "niu2024/text-experiment#rmse-after-red-x": "unpublished",
        "chen2023/text-effectiveness#difference-bound": "exact",
        "chen2023/table-5#3.reference-x": "ambiguous",
        "chen2023/text-resolution#optimum": "ambiguous",
    }
    assert {cell: found[cell].verdict for cell in expected} == expected
    counts = of_ledger()
    agree = counts["chen2023/table-4 agree"].partition(" ")[0]
    assert agree == counts["chen2023/table-4 results"]


def test_words_and_dashes_are_not_counted_as_numbers():
    facts = of_ledger()
    assert int(facts["all cells"]) - int(facts["all numbers"]) == 13


def test_focal_length_and_columns_do_not_settle_the_monitored_angles():
    """The front page: with the interchanged columns and one length, four of seven still differ."""
    monitored = effectiveness.monitored_angle
    reading = {"columns": "motions", "telescope": "common", "images": "state"}
    drawn = monitored.with_options(reading)(load_inputs(monitored.inputs))
    table, outside = library()["chen2023/table-5"], 0
    for name, one in drawn.items():
        low, high = np.quantile(one / ARCSEC, [0.005, 0.995])
        outside += not low <= float(table[name].text) <= high
    assert outside >= 4
