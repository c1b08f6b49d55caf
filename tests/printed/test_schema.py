"""Every fault in a data file is named with its place."""

import copy

import pytest

from reproduce.printed.cells import PrintedFileError, build, read

GROUP = {
    "title": "A group",
    "place": "Text",
    "section": "2",
    "cell": [
        {"id": "a", "label": "A", "value": "1.50", "unit": "mm", "role": "setting"},
        {"id": "b", "label": "B", "text": "a word", "role": "citation"},
    ],
}
TABLE = {
    "title": "A table",
    "place": "Table 1",
    "page": "3",
    "column": [{"id": "x", "label": "X"}, {"id": "y", "label": "Y"}],
    "row": [
        {
            "id": "one",
            "label": "One",
            "unit": "px",
            "role": "setting",
            "cells": ["1.0", "2.0"],
        },
        {
            "id": "two",
            "label": "Two",
            "unit": "px",
            "role": "setting",
            "cells": ["3", "4"],
        },
    ],
}


def changed(base, change):
    content = copy.deepcopy(base)
    change(content)
    return content


FAULTS = [
    (
        TABLE,
        lambda c: c["row"][0]["cells"].__setitem__(1, 2.0),
        r"row\.0\.cells\.1.*unquoted number.*2\.0",
    ),
    (
        TABLE,
        lambda c: c["row"][1]["cells"].pop(),
        r"row 'two': expected 2 cells.*got 1",
    ),
    (
        GROUP,
        lambda c: c["cell"][0].update(role="result"),
        r"cell\.0\.role: Input should be 'setting'",
    ),
    (
        GROUP,
        lambda c: c["cell"][0].update(unit="furlong"),
        r"cell\.0\.unit: .*'furlong'",
    ),
    (
        GROUP,
        lambda c: c["cell"][0].update(colour="red"),
        r"cell\.0\.colour: Extra inputs",
    ),
    (GROUP, lambda c: c.update(colour="red"), r"colour: Extra inputs"),
    (TABLE, lambda c: c["row"][1].update(id="one"), r"duplicate row one"),
    (TABLE, lambda c: c["column"][1].update(id="x"), r"duplicate column x"),
    (GROUP, lambda c: c["cell"][1].update(id="a"), r"duplicate cell a"),
    (
        GROUP,
        lambda c: c["cell"][0].update(value="1.5 mm"),
        r"cell\.0.*digits of a number",
    ),
    (
        TABLE,
        lambda c: c["row"][0]["cells"].__setitem__(0, "-"),
        r"row\.0\.cells.*digits of a",
    ),
    (GROUP, lambda c: c.pop("section"), r"missing page or section"),
    (
        GROUP,
        lambda c: c["cell"][0].update(qualifier="roughly"),
        r"qualifier: Input should be",
    ),
    (GROUP, lambda c: c["cell"][0].update(sigma=2), r"sigma: Input should be 1 or 3"),
    (
        GROUP,
        lambda c: c["cell"][0].update(id="A b"),
        r"id: String should match pattern",
    ),
    (GROUP, lambda c: c["cell"][0].update(text="and a word"), r"exactly one of value"),
    (
        GROUP,
        lambda c: c["cell"][0].update(value=1.5),
        r"value: Input should be a valid string",
    ),
    (GROUP, lambda c: c.pop("cell"), r"either \[\[column\]\] and \[\[row\]\]"),
]


@pytest.mark.parametrize(("base", "change", "message"), FAULTS)
def test_faults_are_named(base, change, message):
    with pytest.raises(PrintedFileError, match=message) as error:
        build(changed(base, change), "p/text-a", "paper/file.toml")
    assert all(
        line.startswith("paper/file.toml: ") for line in str(error.value).splitlines()
    )


def test_sound_files_pass():
    assert len(build(GROUP, "p/text-a").cells) == 2
    assert len(build(TABLE, "p/table-1").cells) == 4


def test_all_faults_are_told_at_once():
    def two_faults(content):
        content["cell"][0].update(unit="furlong")
        content["cell"][1].update(colour="red")

    with pytest.raises(PrintedFileError) as error:
        build(changed(GROUP, two_faults), "x")
    assert len(str(error.value).splitlines()) == 2


@pytest.mark.parametrize("missing", ["unit", "role"])
def test_a_number_needs_unit_and_role(missing):
    content = changed(GROUP, lambda c: c["cell"][0].pop(missing))
    with pytest.raises(PrintedFileError, match=f"#a: missing {missing}"):
        build(content, "p/text-a")


def test_broken_toml_is_told_with_its_file(tmp_path):
    path = tmp_path / "table-1.toml"
    path.write_text('title = "unclosed')
    with pytest.raises(PrintedFileError, match=r"table-1\.toml: not valid TOML"):
        read(path, "p/table-1")


def test_traits_come_from_cell_then_row_then_column():
    def traits(content):
        content["column"][0].update(unit="mm", sigma=3)
        content["row"][0].pop("unit")
        content["column"][1].update(unit="um")
        content["row"][1]["cells"][0] = {
            "value": "3",
            "unit": "deg",
            "qualifier": "about",
        }

    table = build(changed(TABLE, traits), "p/table-1")
    assert [cell.unit for cell in table.cells] == ["mm", "um", "deg", "px"]
    assert table["two.x"].number.qualifier == "about"
    assert (table["one.x"].sigma, table["one.y"].sigma) == (3, None)
