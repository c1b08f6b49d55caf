"""The wall of all printed numbers, the index of items, and the slider over a printed input."""

import re
from collections import Counter
from html.parser import HTMLParser

import pytest

import reproduce as rp
from reproduce.judge.ledger import build
from reproduce.judge.rerun import CannotChangeError
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import anchor, library
from reproduce.views import contents as wall

TABLE = "niu2024/table-2"
FOCAL = "niu2024/table-1#focal-length.red"
VALUES = ["24.9 mm", "25.0601 mm", "25.2 mm"]


class Tags(HTMLParser):
    """All tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def all(self, tag):
        return [attrs for name, attrs in self.found if name == tag]


def marks(picture):
    """Return the column and the row of each mark."""
    moved = re.findall(r"translate\((\d+) (\d+)\)", picture)
    return [(int(x) // wall.PITCH, int(y) // wall.PITCH) for x, y in moved]


@pytest.fixture(scope="module")
def records():
    return build(["niu2024/table-2", "niu2024/text-optics"]).records


def test_every_number_is_one_mark_that_leads_to_its_cell(records):
    tags = Tags(str(wall.wall(records)))
    leads = [a["href"] for a in tags.all("a") if a.get("tabindex") == "-1"]
    assert leads == [f"#{anchor(record.cell)}" for record in records]
    heads = [a["href"] for a in tags.all("a") if "tabindex" not in a]
    assert heads == ["#niu2024-text-optics", "#niu2024-table-2"]


def test_marks_tell_verdicts_by_shape_and_class(records):
    assert len(set(wall.SHAPES.values())) == len(wall.SHAPES)
    paths = [
        p for p in Tags(str(wall.wall(records))).all("path") if p["class"] != "rp-hit"
    ]
    shown = Counter(p["class"].split()[0].removeprefix("rp-mark-") for p in paths)
    assert shown == Counter(record.verdict for record in records)
    for path in paths:
        assert (
            path["d"] == wall.SHAPES[path["class"].split()[0].removeprefix("rp-mark-")]
        )


def test_a_table_keeps_its_shape(records):
    picture = str(wall.wall(r for r in records if r.key == TABLE))
    rows, columns = len(library()[TABLE].rows), len(library()[TABLE].columns)
    assert f'viewBox="0 0 {columns * wall.PITCH} {wall.DEEP * wall.PITCH}"' in picture
    assert marks(picture) == [(x, y) for y in range(rows) for x in range(columns)]


def test_all_items_are_as_high_and_a_long_one_goes_on_beside_itself():
    """Sixteen quoted numbers in three columns of six at most, no two in one place."""
    text = str(rp.contents()._repr_html_())
    assert {high for _, high in re.findall(r'viewBox="0 0 (\d+) (\d+)"', text)} == {
        str(wall.DEEP * wall.PITCH)
    }
    for key, table in library().items():
        picture = (
            str(wall.wall(build([key]).records)) if len(table.rows) > wall.DEEP else ""
        )
        places = marks(picture)
        assert len(set(places)) == len(places)
        assert all(y < wall.DEEP for _, y in places)
        if key == "chen2023/table-3":
            assert places[:2] == [(0, 0), (1, 0)]
            assert places[8:10] == [(2, 0), (3, 0)]


def test_the_legend_counts_what_the_wall_shows(records):
    told = dict(
        re.findall(r"<strong>(\d+) ([a-z ]+)</strong>", str(wall.legend(records)))
    )
    by_verdict = Counter(record.verdict for record in records)
    assert {
        name: int(count) for count, name in told.items() if name in by_verdict
    } == by_verdict


def test_contents_show_the_walls_of_their_papers():
    html = rp.contents("niu2024")._repr_html_()
    cells = sum(
        len(t.cells) for key, t in library().items() if key.startswith("niu2024/")
    )
    assert html.count('class="rp-hit"') == cells
    assert "chen2023" not in html


@pytest.mark.parametrize("paper", ["niu2024", "chen2023"])
def test_the_index_leads_to_every_item_in_order_of_print(paper):
    keys = [key for key in catalogue() if key.startswith(f"{paper}/")]
    leads = [
        a["href"] for a in Tags(str(rp.contents(paper).index._repr_html_())).all("a")
    ]
    expected = [
        anchor(key) if key in library() else f"figure-{anchor(key)}" for key in keys
    ]
    assert leads == [f"#{name}" for name in expected]


def test_a_sweep_holds_what_each_rerun_gives():
    swept = rp.table(TABLE).sweep(FOCAL, VALUES, ["scale.red", "scale.blue"])
    frame = swept.frame()
    assert len(frame) == 2 * len(VALUES)
    for value in VALUES:
        alone = (
            rp.table(TABLE).rerun({FOCAL: value}).frame().loc["scale.red", "changed"]
        )
        assert frame.loc[(value, "scale.red"), "computed"] == alone
    assert frame["computed"].xs("scale.red", level="cell").is_monotonic_decreasing
    assert "25.0601 mm (printed)" in repr(swept)


def test_a_slider_says_that_it_was_computed_and_its_pictures_have_values_and_units():
    swept = rp.table("niu2024/table-3").sweep(
        "niu2024/text-simulation#noise",
        ["0.02 px", "0.2 px"],
        ["rotation.red"],
        replicates=20,
    )
    html = str(swept._repr_html_())
    assert "all 2 settings were computed beforehand" in html
    assert "<figcaption>rotation.red (°)</figcaption>" in html
    below, above, first, last = re.findall(r"<text [^>]*>([^<]*)</text>", html)
    assert (first, last) == ("0.02 px", "0.2 px")
    ends = swept.frame()[["low", "high"]].to_numpy()
    assert float(below) == pytest.approx(ends.min(), rel=0.02)
    assert float(above) == pytest.approx(ends.max(), rel=0.02)
    assert re.search(r"0\.\d+ \(0\.\d+ to 0\.\d+\)°", html), (
        "a unit stays with its number"
    )


def test_a_sweep_simulates_as_many_tables_as_asked():
    noise, changes = (
        "niu2024/text-simulation#noise",
        {"niu2024/text-simulation#noise": "0.1 px"},
    )
    few = rp.table("niu2024/table-3").sweep(
        noise, ["0.1 px"], ["scale.red"], replicates=20
    )
    alone = rp.table("niu2024/table-3").rerun(changes, replicates=20).frame()
    assert few.frame()["computed"].iloc[0] == alone.loc["scale.red", "changed"]


def test_a_sweep_that_is_too_wide_for_a_terminal_is_a_block_for_each_value():
    """No number is broken, and each value has a line for each cell."""
    noise, values = "niu2024/text-simulation#noise", ("0.05 px", "0.2 px")
    swept = rp.table("niu2024/table-3").sweep(noise, values, replicates=20)
    lines = repr(swept).splitlines()
    assert max(map(len, lines)) <= 80
    blocks = [lines[lines.index(row[0]) :] for row in swept.grid.rows]
    for row, block in zip(swept.grid.rows, blocks, strict=True):
        for name, entry in zip(swept.grid.head[1:], row[1:], strict=True):
            assert any(entry in line for line in block), name
    assert "central 99 % of the prediction" in " ".join(lines)


def test_a_sweep_is_a_table_first_and_a_slider_with_a_script():
    html = (
        rp.table(TABLE).sweep(FOCAL, VALUES, ["scale.red", "scale.blue"])._repr_html_()
    )
    tags = Tags(html)
    dial = tags.all("input")[0]
    assert (dial["type"], dial["max"], dial["value"]) == ("range", "2", "1")
    assert "hidden" in next(p for p in tags.all("p") if p["class"] == "rp-dial")
    assert html.count("<tr") == 1 + len(VALUES)
    # Blue does not read the red focal length, and agrees: its marks lie near the line of the print.
    heights = [float(y) for y in re.findall(r'cy="([\d.]+)"', html)]
    red, blue = heights[: len(VALUES)], heights[len(VALUES) :]
    printed = float(re.findall(r'class="rp-dashed" d="M\d+ ([\d.]+)H', html)[1])
    assert len(set(blue)) == 1 < len(set(red))
    assert abs(blue[0] - printed) < 10


def test_a_sweep_refuses_what_a_rerun_refuses():
    with pytest.raises(ValueError, match="expected an input"):
        rp.table(TABLE).sweep("niu2024/text-simulation#noise", ["0.1 px"])
    with pytest.raises(KeyError):
        rp.table(TABLE).sweep(FOCAL, VALUES, ["scale.green"])
    with pytest.raises(ValueError, match="one value"):
        rp.table(TABLE).sweep(FOCAL, [])


def test_cells_that_depend_on_each_other_move_together():
    """The count of angles follows from their step; the printed pair is found in other units too."""
    moved = [f"niu2024/text-simulation#{name}" for name in ("angle-count", "step")]
    steps = [("37", "1.8 deg"), ("137", "3240 arcsec")]
    swept = rp.table("niu2024/table-3").sweep(
        moved, steps, ["scale.red"], replicates=20
    )
    found = swept.frame().loc[(slice(None), "scale.red"), :]
    width = (found["high"] - found["low"]).to_list()
    assert width[0] > width[1]
    assert "137, 3240 arcsec (printed)" in str(swept)
    with pytest.raises(ValueError, match="values: expected 2"):
        rp.table("niu2024/table-3").sweep(moved, ["37"])


BORESIGHTS = "chen2023/text-satellite#boresight-angle"
STARS, NOISE = "niu2024/stars", "niu2024/text-simulation#noise"


def test_a_sweep_over_a_table_of_our_own_holds_what_each_rerun_gives():
    values = ["0.02 px", "0.05 px", "0.1 px"]
    swept = rp.table(STARS).sweep(
        NOISE, values, ["similarity (px)"], {"Stars": [50, 137]}
    )
    found = swept.frame()["computed"]
    assert len(found) == 2 * len(values)
    for value in values:
        alone = rp.table(STARS).rerun({NOISE: value}).frame().set_index("Stars")
        for count in (50, 137):
            expected = alone.loc[count, "similarity (px)"]
            assert found[(value, f"Stars {count}: similarity (px)")] == expected
    assert "0.05 px (printed)" in repr(swept)
    html = swept._repr_html_()
    tags = Tags(html)
    assert next(one["value"] for one in tags.all("input")) == "1"
    # The dashed line is what the printed noise gives: the mark of the middle lies on it.
    dashed = [
        float(y) for y in re.findall(r'class="rp-dashed" d="M\d+ ([\d.]+)H', html)
    ]
    heights = [float(y) for y in re.findall(r'cy="([\d.]+)"', html)]
    assert dashed == [heights[1], heights[4]]


def test_a_supplementary_table_has_no_other_settings():
    with pytest.raises(CannotChangeError, match="speed"):
        rp.table(STARS).rerun(speed=1)


def test_rows_of_a_sweep_are_told_apart_by_as_few_words_as_it_takes():
    """And a number without limit has no mark."""
    swept = rp.table("chen2023/dichroic").sweep(BORESIGHTS, ["90°", "120°"])
    html = swept._repr_html_()
    assert "its normal: turn as large as the accuracy (arcsec)" in html
    assert not re.search(r"[ ,\"]-?(nan|inf)", html)
    drawn = [part.count("<circle") for part in html.split("<figure>")[1:]]
    assert drawn == [2] * 7 + [0] * 2
    assert [part.count("rp-dashed") for part in html.split("<figure>")[1:]] == [
        1
    ] * 7 + [0] * 2


@pytest.mark.parametrize(
    ("moved", "values", "asked", "told"),
    [
        (
            NOISE,
            ["0.1 px"],
            {"columns": ["similarity"]},
            "similarity: expected a column",
        ),
        (NOISE, ["0.1 px"], {"rows": {"Star": 50}}, "Star: expected a column"),
        (NOISE, ["0.1 px"], {"rows": {"Stars": 51}}, "same rows"),
        ("wants", [1], {}, "wants: expected"),
        (NOISE, [], {}, "at least one value"),
    ],
)
def test_a_sweep_over_a_table_of_our_own_refuses_in_one_sentence(
    moved, values, asked, told
):
    with pytest.raises(ValueError, match=re.escape(told)):
        rp.table(STARS).sweep(moved, values, **asked)


def test_a_sweep_over_words_is_refused():
    with pytest.raises(ValueError, match="Turn of the mirror about: expected"):
        rp.table("chen2023/dichroic").sweep(
            BORESIGHTS, ["90°"], ["Turn of the mirror about"]
        )
