"""The marks of all printed numbers, and the slider over a printed input."""

import re
from collections import Counter
from decimal import Decimal

import numpy as np
import pytest
from bs4 import BeautifulSoup
from commands import width

import reproduce as rp
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views._blocks import LOOKS
from reproduce.views._computed import whole_ledger

TABLE, FOCAL = "niu2024/table-2", "niu2024/table-1#focal-length.red"
STARS, NOISE = "niu2024/stars", "niu2024/text-simulation#noise"


def parse(html):
    return BeautifulSoup(str(html), "html.parser")


def test_every_number_is_a_mark_that_leads_to_its_cell(paper):
    """With the shape and the class of its verdict; the legend has their counts."""
    page = parse(rp.contents(paper)._repr_html_())
    records = [one for one in whole_ledger().records if one.cell.startswith(paper)]
    assert len(page.select(".rp-hit")) == len(records)
    marks = page.select("a[tabindex] path:not(.rp-hit)")
    links = [mark.find_parent("a")["href"] for mark in marks]
    assert links == [f"#{anchor(record.cell)}" for record in records]
    verdicts = [mark["class"][0].removeprefix("rp-mark-") for mark in marks]
    assert verdicts == [record.verdict for record in records]
    assert [mark["d"] for mark in marks] == [LOOKS[one]["shape"] for one in verdicts]
    assert len({look["shape"] for look in LOOKS.values()}) == len(LOOKS)
    counts = [one.text.split() for one in page.select(".rp-wall-legend strong")]
    weak = len(page.select(".rp-wall .rp-mark-weak"))  # "5 of these weak"
    expected = Counter(verdicts, of=weak)
    assert {one[1]: int(one[0]) for one in counts if one[0] != "0"} == expected


def test_a_paper_has_a_row_of_every_item():
    for paper in PAPERS:
        keys = [key for key in catalogue() if key.startswith(f"{paper}/")]
        shown = rp.contents(paper)._repr_html_()
        assert not any(other in shown for other in PAPERS if other != paper)
        links = parse(rp.contents(paper).index._repr_html_()).select("a")
        starts = [f"#{'figure-' * (key not in library())}{anchor(key)}" for key in keys]
        assert [link["href"] for link in links] == starts


def heights(html):
    """Return the heights of the points of a sweep, of its dashed lines and of its bars."""
    page = parse(html).select_one(".rp-wide")
    points = [float(point["y"]) for point in page.select("[clip-path] > use")]
    lines = [
        [float(y) for y in re.findall(r"[ML] [\d.]+ ([\d.]+)", path["d"])]
        for path in page.select("path[style*=dasharray], [id*=LineCollection] path[d]")
    ]
    dashed = [ends[0] for ends in lines if ends[0] == ends[1]]
    return points, dashed, [low - high for low, high in lines if low != high]


def test_a_sweep_of_a_table_has_the_values_of_each_rerun():
    """The dial starts at the printed value, and a dashed line shows the printed result."""
    values = ["24.9 mm", "25.0601 mm", "25.2 mm"]
    swept = rp.table(TABLE).sweep(FOCAL, values, ["scale.red", "scale.blue"])
    computed = swept.frame()["computed"]
    assert len(computed) == 2 * len(values)
    for value in values:
        single = rp.table(TABLE).rerun({FOCAL: value}).frame()
        assert computed[(value, "scale.red")] == single.loc["scale.red", "changed"]
    assert f"{values[1]} (printed)" in repr(swept)
    html = swept._repr_html_()
    for shown in (repr(swept), html):
        assert "Scale factor, Red" in shown
        assert "scale.red" not in shown
    (dial,) = parse(html).select("input")
    assert (dial["type"], dial["max"], dial["value"]) == ("range", "2", "1")
    # Blue does not depend on the focal length of red.
    points, dashed, _ = heights(html)
    assert len(set(points[3:])) == 1 < len(set(points[:3]))
    blue = library()[TABLE]["scale.blue"].number.value
    assert (points[3] > dashed[1]) == (computed.iloc[1] < blue)
    # It rounds to the printed digits, so that it is in the band of their interval.
    _, band = parse(html).select(".rp-wide path[style*='opacity: 0.2']")
    ends = [float(y) for y in re.findall(r"[ML] [\d.]+ ([\d.]+)", band["d"])]
    assert min(ends) < points[3] < max(ends)


def test_a_sweep_of_a_prediction_shows_its_intervals():
    table, values = rp.table("niu2024/table-3"), ["0.02 px", "0.2 px"]
    swept = table.sweep(NOISE, values, ["rotation.red"], replicates=20)
    single = table.rerun({NOISE: "0.2 px"}, replicates=20).frame()
    frame, html = swept.frame(), swept._repr_html_()
    assert frame["computed"].iloc[1] == single.loc["rotation.red", "changed"]
    widths = (frame["high"] - frame["low"]).to_numpy(float)
    bars = heights(html)[2]
    assert bars[1] / bars[0] == pytest.approx(widths[1] / widths[0], rel=1e-3)
    frames = (
        table.sweep(NOISE, numbers, replicates=20).frame()
        for numbers in ([np.int64(1), Decimal(2)], ["1 px", "2 px"])
    )
    first, second = (frame["computed"].tolist() for frame in frames)
    assert first == second
    assert width(repr(table.sweep(NOISE, values, replicates=20))) <= 80


REJECTED = {
    NOISE: [(TABLE, NOISE, ["0.1 px"]), (TABLE, [FOCAL, NOISE], ["37"])],
    "value": [(TABLE, FOCAL, []), (TABLE, FOCAL, 25.0)],
    "changes: ": [(TABLE, 5, ["1"]), (STARS, [5], ["1"])],
    FOCAL: [(TABLE, FOCAL, [None])],
    "expected": [("niu2024/table-3", NOISE, "0.2 px")],
    "different": [("niu2024/table-3", [NOISE] * 2, [["0.1 px", "0.2 px"]])],
    "scale.green": [(TABLE, FOCAL, ["25 mm"], ["scale.green"])],
    "'rotation.red'": [(TABLE, FOCAL, ["25 mm"], ["rotation.red", "scale.red"])],
    "rows": [
        (STARS, NOISE, ["0.1 px"], [], {"Stars": 51}),
        (STARS, NOISE, ["0.1 px"], [], {"stars": 50}),
    ],
}


def test_a_sweep_names_a_wrong_argument():
    for named, cases in REJECTED.items():
        for key, *arguments in cases:
            with pytest.raises((ValueError, TypeError), match=re.escape(named)):
                rp.table(key).sweep(*arguments)
    with pytest.raises(ValueError, match="speed"):
        rp.table(STARS).rerun(speed=1)


def test_a_sweep_of_a_supplementary_table_selects_rows_and_columns():
    values, column = ["0.02 px", "0.1 px"], "similarity (px)"
    swept = rp.table(STARS).sweep(NOISE, values, [column], {"Stars": [50, 137]})
    for value in values:
        single = rp.table(STARS).rerun({NOISE: value}).frame().set_index("Stars")
        found = swept.frame()["computed"][value]
        assert found.tolist() == single.loc[[50, 137], column].tolist()
