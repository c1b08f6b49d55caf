"""The marks of all printed numbers, and the slider over a printed input."""

import re
from collections import Counter
from html.parser import HTMLParser

import pytest

import reproduce as rp
from reproduce.judge.rerun import CannotChangeError
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views import contents
from reproduce.views.computed import item_ledger

TABLE, FOCAL = "niu2024/table-2", "niu2024/table-1#focal-length.red"
STARS, NOISE = "niu2024/stars", "niu2024/text-simulation#noise"
BORESIGHTS = "chen2023/text-satellite#boresight-angle"


def tags(text, name):
    """Return the attributes of all tags of a name."""
    found = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: (
        tag == name and found.append(dict(attrs))
    )
    parser.feed(str(text))
    return found


def test_every_number_is_a_mark_that_leads_to_its_cell():
    """With the shape and the class of its verdict; the legend has their counts."""
    records = item_ledger("niu2024/table-2", "niu2024/text-optics").records
    drawn, _, legend = contents._overview_grid(records).partition(
        '<ul class="rp-wall-legend">'
    )
    links = [tag["href"] for tag in tags(drawn, "a") if tag.get("tabindex") == "-1"]
    assert links == [f"#{anchor(record.cell)}" for record in records]
    heads = [tag["href"] for tag in tags(drawn, "a") if "tabindex" not in tag]
    assert heads == ["#niu2024-text-optics", "#niu2024-table-2"]
    marks = [tag for tag in tags(drawn, "path") if tag["class"] != "rp-hit"]
    verdicts = [m["class"].split()[0].removeprefix("rp-mark-") for m in marks]
    assert verdicts == [record.verdict for record in records]
    shapes = {verdict: m["d"] for verdict, m in zip(verdicts, marks, strict=True)}
    assert shapes.items() <= contents.SHAPES.items()
    assert len(set(contents.SHAPES.values())) == len(contents.SHAPES)
    counts = re.findall(r"<strong>(\d+) (\w+)</strong>", legend)
    assert {word: int(n) for n, word in counts if n != "0"} == Counter(verdicts)


def test_marks_have_the_layout_of_the_paper():
    """A long table continues in further columns; all tables have the same height."""
    rows, pitch = contents.MAX_ROWS, contents.PITCH_PIXELS
    for key, table in library().items():
        drawn = str(contents._overview_grid(item_ledger(key).records))
        heights = set(re.findall(r'viewBox="0 0 \d+ (\d+)"', drawn))
        assert heights == {str(rows * pitch)}
        places = re.findall(r"translate\((\d+) (\d+)\)", drawn)
        found = [(int(x) // pitch, int(y) // pitch) for x, y in places]
        assert len(set(found)) == len(found) == len(table.cells)
        assert max(y for _, y in found) < rows
        if len(table.rows) <= rows:
            across, down = range(max(1, len(table.columns))), range(len(table.rows))
            assert found == [(x, y) for y in down for x in across]
        if key == "chen2023/table-3":
            assert [*found[:2], *found[8:10]] == [(0, 0), (1, 0), (2, 0), (3, 0)]
    for paper in PAPERS:
        keys = [key for key in catalogue() if key.startswith(f"{paper}/")]
        shown = rp.contents(paper)._repr_html_()
        cells = sum(len(library()[key].cells) for key in keys if key in library())
        assert shown.count('class="rp-hit"') == cells
        assert not any(other in shown for other in PAPERS if other != paper)
        index = tags(rp.contents(paper).index._repr_html_(), "a")
        starts = [f"#{'figure-' * (key not in library())}{anchor(key)}" for key in keys]
        assert [tag["href"] for tag in index] == starts


def drawn(html):
    """Return the dial of a sweep, and the heights of its points and dashed lines."""
    (dial,) = tags(html, "input")
    dashed = re.findall(r'class="rp-dashed" d="M\d+ ([\d.]+)H', html)
    return dial, re.findall(r'cy="([\d.]+)"', html), dashed


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
    dial, heights, dashed = drawn(html)
    assert (dial["type"], dial["max"], dial["value"]) == ("range", "2", "1")
    assert "hidden" in next(p for p in tags(html, "p") if p["class"] == "rp-dial")
    assert html.count("<tr") == 1 + len(values)
    # Blue does not depend on the focal length of red.
    assert len(set(heights[3:])) == 1 < len(set(heights[:3]))
    assert abs(float(heights[3]) - float(dashed[1])) < 10


def test_a_sweep_of_a_supplementary_table_selects_rows_and_columns():
    values, column = ["0.02 px", "0.05 px", "0.1 px"], "similarity (px)"
    swept = rp.table(STARS).sweep(NOISE, values, [column], {"Stars": [50, 137]})
    computed = swept.frame()["computed"]
    assert len(computed) == 2 * len(values)
    for value in values:
        single = rp.table(STARS).rerun({NOISE: value}).frame().set_index("Stars")
        for stars in (50, 137):
            expected = single.loc[stars, column]
            assert computed[(value, f"Stars {stars}: {column}")] == expected
    _, heights, dashed = drawn(swept._repr_html_())
    assert dashed == [heights[1], heights[4]]


def test_a_sweep_of_a_prediction_shows_its_intervals():
    table, values = rp.table("niu2024/table-3"), ["0.02 px", "0.2 px"]
    swept = table.sweep(NOISE, values, ["rotation.red"], replicates=20)
    single = table.rerun({NOISE: "0.2 px"}, replicates=20).frame()
    frame, html = swept.frame(), swept._repr_html_()
    assert frame["computed"].iloc[1] == single.loc["rotation.red", "changed"]
    assert "<figcaption>rotation.red (°)</figcaption>" in html
    low, high, *ends = re.findall(r"<text [^>]*>([^<]*)</text>", html)
    assert ends == values
    assert float(low) == pytest.approx(frame["low"].min(), rel=0.02)
    assert float(high) == pytest.approx(frame["high"].max(), rel=0.02)
    assert re.search(r"0\.\d+ \(0\.\d+ to 0\.\d+\)°", html), "a unit with its number"
    # Both ends keep a margin of 8 px from the picture and from its axis.
    assert re.findall(r'<text x="52" y="([\d.]+)"', swept._repr_html_()) == [
        "86.0",
        "8.0",
    ]
    whole = table.sweep(NOISE, values, replicates=20)
    lines = repr(whole).splitlines()
    assert max(map(len, lines)) <= 80
    for row in whole.grid.rows:
        block = " ".join(lines[lines.index(row[0]) :])
        assert all(text in block for text in row[1:])


REJECTED = {
    NOISE: [(TABLE, NOISE, ["0.1 px"]), (TABLE, [FOCAL, NOISE], ["37"])],
    "value": [(TABLE, FOCAL, [])],
    "expected": [("niu2024/table-3", NOISE, "0.2 px")],
    "scale.green": [(TABLE, FOCAL, ["25 mm"], ["scale.green"])],
    "similarity": [(STARS, NOISE, ["0.1 px"], ["similarity"], {})],
    "Star": [(STARS, NOISE, ["0.1 px"], [], {"Star": 50})],
    "rows": [(STARS, NOISE, ["0.1 px"], [], {"Stars": 51})],
    "missing": [(STARS, "missing", [1], [], {})],
    "Axis": [
        (
            "chen2023/dichroic",
            BORESIGHTS,
            ["90°"],
            ["Axis of the mirror's rotation"],
            {},
        )
    ],
}


def test_a_sweep_names_a_wrong_argument():
    for named, cases in REJECTED.items():
        for key, *arguments in cases:
            with pytest.raises((ValueError, KeyError), match=re.escape(named)):
                rp.table(key).sweep(*arguments)
    with pytest.raises(CannotChangeError, match="speed"):
        rp.table(STARS).rerun(speed=1)
