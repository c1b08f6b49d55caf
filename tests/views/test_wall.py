"""The marks of all printed numbers, the index of items, and the slider over a printed input."""

import re
from collections import Counter
from html.parser import HTMLParser

import pytest

import reproduce as rp
from reproduce.judge.ledger import build
from reproduce.judge.rerun import CannotChangeError
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views import contents

TABLE = "niu2024/table-2"
FOCAL = "niu2024/table-1#focal-length.red"
VALUES = ["24.9 mm", "25.0601 mm", "25.2 mm"]
STARS, NOISE = "niu2024/stars", "niu2024/text-simulation#noise"
BORESIGHTS = "chen2023/text-satellite#boresight-angle"


class Tags(HTMLParser):
    """All tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(str(text))

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def all(self, tag):
        return [attrs for name, attrs in self.found if name == tag]


def places(drawing):
    """Return the column and the row of each mark."""
    moved = re.findall(r"translate\((\d+) (\d+)\)", str(drawing))
    return [tuple(int(end) // contents.PITCH_PIXELS for end in one) for one in moved]


def test_every_number_is_a_mark_that_leads_to_its_cell():
    """With the shape and the class of its verdict; the legend counts them."""
    records = build(["niu2024/table-2", "niu2024/text-optics"]).records
    drawn, _, legend = contents._overview_grid(records).partition(
        '<ul class="rp-wall-legend">'
    )
    tags = Tags(drawn)
    links = [a["href"] for a in tags.all("a") if a.get("tabindex") == "-1"]
    assert links == [f"#{anchor(record.cell)}" for record in records]
    heads = [a["href"] for a in tags.all("a") if "tabindex" not in a]
    assert heads == ["#niu2024-text-optics", "#niu2024-table-2"]
    marks = [one for one in tags.all("path") if one["class"] != "rp-hit"]
    verdicts = [one["class"].split()[0].removeprefix("rp-mark-") for one in marks]
    assert verdicts == [record.verdict for record in records]
    shapes = {verdict: one["d"] for verdict, one in zip(verdicts, marks, strict=True)}
    assert shapes.items() <= contents.SHAPES.items()
    assert len(set(contents.SHAPES.values())) == len(contents.SHAPES)
    counts = re.findall(r"<strong>(\d+) (\w+)</strong>", legend)
    assert {n: int(count) for count, n in counts if count != "0"} == Counter(verdicts)


def test_an_item_has_the_layout_of_the_paper_and_all_have_one_height():
    """A long table continues in further columns; no two marks are in one place."""
    for key, table in library().items():
        drawn = contents._overview_grid(build([key]).records)
        heights = {high for _, high in re.findall(r'viewBox="0 0 (\d+) (\d+)"', drawn)}
        assert heights == {str(contents.MAX_ROWS * contents.PITCH_PIXELS)}
        found, across = places(drawn), max(1, len(table.columns))
        assert len(set(found)) == len(found) == len(table.cells)
        assert all(row < contents.MAX_ROWS for _, row in found)
        if len(table.rows) <= contents.MAX_ROWS:
            rows = range(len(table.rows))
            assert found == [(x, y) for y in rows for x in range(across)]
        if key == "chen2023/table-3":
            assert [*found[:2], *found[8:10]] == [(0, 0), (1, 0), (2, 0), (3, 0)]


def test_contents_show_the_marks_and_the_index_of_their_papers():
    for paper in PAPERS:
        keys = [key for key in catalogue() if key.startswith(f"{paper}/")]
        shown = rp.contents(paper)._repr_html_()
        cells = sum(len(library()[key].cells) for key in keys if key in library())
        assert shown.count('class="rp-hit"') == cells
        assert not any(other in shown for other in PAPERS if other != paper)
        links = [
            a["href"] for a in Tags(rp.contents(paper).index._repr_html_()).all("a")
        ]
        starts = (f"#{'figure-' * (key not in library())}" for key in keys)
        assert links == [a + anchor(key) for a, key in zip(starts, keys, strict=True)]


@pytest.mark.parametrize(
    ("key", "moved", "values", "shown", "labels"),
    [
        (TABLE, FOCAL, VALUES, (["scale.red", "scale.blue"],), ["scale.red"]),
        (
            STARS,
            NOISE,
            ["0.02 px", "0.05 px", "0.1 px"],
            (["similarity (px)"], {"Stars": [50, 137]}),
            ["Stars 50: similarity (px)", "Stars 137: similarity (px)"],
        ),
    ],
)
def test_a_sweep_holds_what_each_rerun_gives(key, moved, values, shown, labels):
    """The dial begins at the printed value; the dashed line is at the mark of that value."""
    swept = rp.table(key).sweep(moved, values, *shown)
    computed = swept.frame()["computed"]
    assert len(computed) == 2 * len(values)
    for value in values:
        alone = rp.table(key).rerun({moved: value}).frame()
        for label in labels:
            if key == TABLE:
                expected = alone.loc[label, "changed"]
            else:
                stars = int(label.split()[1].rstrip(":"))
                expected = alone.set_index("Stars").loc[stars, "similarity (px)"]
            assert computed[(value, label)] == expected
    assert f"{values[1]} (printed)" in repr(swept)
    html = swept._repr_html_()
    tags, (dial,) = Tags(html), Tags(html).all("input")
    assert (dial["type"], dial["max"], dial["value"]) == ("range", "2", "1")
    assert "hidden" in next(p for p in tags.all("p") if p["class"] == "rp-dial")
    assert html.count("<tr") == 1 + len(values)
    dashed = re.findall(r'class="rp-dashed" d="M\d+ ([\d.]+)H', html)
    heights = re.findall(r'cy="([\d.]+)"', html)
    if key == STARS:
        assert dashed == [heights[1], heights[4]]
    else:  # blue does not depend on the focal length of red
        assert len(set(heights[3:])) == 1 < len(set(heights[:3]))
        assert abs(float(heights[3]) - float(dashed[1])) < 10


def test_a_sweep_of_a_prediction_shows_its_intervals():
    """Simulated with as many tables as asked; each value is a block of lines in a terminal."""
    table, values = rp.table("niu2024/table-3"), ["0.02 px", "0.2 px"]
    swept = table.sweep(NOISE, values, ["rotation.red"], replicates=20)
    alone = table.rerun({NOISE: "0.2 px"}, replicates=20).frame()
    frame = swept.frame()
    assert frame["computed"].iloc[1] == alone.loc["rotation.red", "changed"]
    html = swept._repr_html_()
    assert "all 2 settings were computed beforehand" in html
    assert "<figcaption>rotation.red (°)</figcaption>" in html
    below, above, first, last = re.findall(r"<text [^>]*>([^<]*)</text>", html)
    assert [first, last] == values
    ends = frame[["low", "high"]].to_numpy()
    assert float(below) == pytest.approx(ends.min(), rel=0.02)
    assert float(above) == pytest.approx(ends.max(), rel=0.02)
    # Both ends keep a margin of 8 px from the picture and from its axis.
    assert re.findall(r'<text x="52" y="([\d.]+)"', html) == ["86.0", "8.0"]
    assert re.search(r"0\.\d+ \(0\.\d+ to 0\.\d+\)°", html), "a unit with its number"
    whole = table.sweep(NOISE, values, replicates=20)
    lines = repr(whole).splitlines()
    assert max(map(len, lines)) <= 80
    for row in whole.grid.rows:
        block = " ".join(lines[lines.index(row[0]) :])
        assert all(text in block for text in row[1:])


def test_cells_that_depend_on_each_other_move_together():
    """The count of angles follows from their step; printed values are found in other units."""
    moved = [f"niu2024/text-simulation#{name}" for name in ("angle-count", "step")]
    steps = [("37", "1.8 deg"), ("137", "3240 arcsec")]
    table = rp.table("niu2024/table-3")
    swept = table.sweep(moved, steps, ["scale.red"], replicates=20)
    found = swept.frame().loc[(slice(None), "scale.red"), :]
    few, many = found["high"] - found["low"]
    assert few > many
    assert "137, 3240 arcsec (printed)" in str(swept)


def test_a_sweep_names_rows_in_few_words_and_leaves_out_infinite_values():
    swept = rp.table("chen2023/dichroic").sweep(BORESIGHTS, ["90°", "120°"])
    html = swept._repr_html_()
    assert "its normal: turn as large as the accuracy (arcsec)" in html
    assert not re.search(r"[ ,\"]-?(nan|inf)", html)
    drawings = html.split("<figure>")[1:]
    for mark, count in (("<circle", 2), ("rp-dashed", 1)):
        assert [one.count(mark) for one in drawings] == [count] * 7 + [0] * 2


@pytest.mark.parametrize(
    ("key", "moved", "values", "columns", "rows", "named"),
    [
        (TABLE, NOISE, ["0.1 px"], [], None, NOISE),
        (TABLE, FOCAL, [], [], None, "value"),
        (TABLE, [FOCAL, NOISE], ["37"], [], None, NOISE),
        (TABLE, FOCAL, VALUES, ["scale.green"], None, "scale.green"),
        (STARS, NOISE, ["0.1 px"], ["similarity"], {}, "similarity"),
        (STARS, NOISE, ["0.1 px"], [], {"Star": 50}, "Star"),
        (STARS, NOISE, ["0.1 px"], [], {"Stars": 51}, "rows"),
        (STARS, "wants", [1], [], {}, "wants"),
        (
            "chen2023/dichroic",
            BORESIGHTS,
            ["90°"],
            ["Turn of the mirror about"],
            {},
            "Turn",
        ),
    ],
)
def test_a_sweep_rejects_what_it_cannot_compute(
    key, moved, values, columns, rows, named
):
    others = () if rows is None else (rows,)
    with pytest.raises((ValueError, KeyError), match=re.escape(named)):
        rp.table(key).sweep(moved, values, columns, *others)
    if key == STARS:
        with pytest.raises(CannotChangeError, match="speed"):
            rp.table(STARS).rerun(speed=1)
