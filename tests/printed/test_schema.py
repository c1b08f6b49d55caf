"""Every fault in a data file is named with its place."""

import copy

import pytest

from reproduce.printed.cells import _build, _File

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
    "unit": "px",
    "role": "setting",
    "column": [{"id": "x", "label": "X"}, {"id": "y", "label": "Y"}],
    "row": [
        {"id": "one", "label": "One", "cells": ["1.0", "2.0"]},
        {"id": "two", "label": "Two", "cells": ["3", "4"]},
    ],
}


def build(content, key):
    return _build(_File.model_validate(content), key)


def changed(base, change):
    content = copy.deepcopy(base)
    change(content)
    return content


FAULTS = [
    (TABLE, lambda c: c["row"][0]["cells"].__setitem__(1, 2.0), r"row\.0\.cells\.1"),
    (TABLE, lambda c: c["row"][1]["cells"].pop(), "row 'two'"),
    (TABLE, lambda c: c["row"][1].update(id="one"), "duplicate"),
    (TABLE, lambda c: c["row"][0]["cells"].__setitem__(0, "-"), r"row\.0\.cells"),
    (GROUP, lambda c: c["cell"][1].update(id="a"), "duplicate"),
    (GROUP, lambda c: c.update(colour="red"), "colour"),
    (GROUP, lambda c: c.pop("section"), "section"),
    (GROUP, lambda c: c["cell"][0].pop("unit"), "#a: missing unit"),
]


VALUES = {
    "role": "result",
    "unit": "furlong",
    "colour": "red",
    "value": 1.5,
    "qualifier": "roughly",
    "sigma": 2,
    "id": "A b",
    "text": "and a word",
}


def test_faults_are_named():
    for base, change, named in FAULTS:
        with pytest.raises(ValueError, match=named):
            build(changed(base, change), "p/text-a")
    for field, value in VALUES.items():
        faulty = changed(GROUP, lambda c, v=(field, value): c["cell"][0].update([v]))
        with pytest.raises(ValueError, match=field):
            build(faulty, "p/text-a")


def test_all_faults_are_listed_at_once():
    faulty = changed(GROUP, lambda c: [one.update(unit="furlong") for one in c["cell"]])
    with pytest.raises(ValueError, match=r"(?s)cell\.0\.unit.*cell\.1\.unit"):
        build(faulty, "x")


def test_traits_come_from_cell_then_row_then_column_then_file():
    content = copy.deepcopy(TABLE)
    content["column"][0].update(unit="mm", sigma=3)
    content["row"][1].update(unit="um")
    content["row"][1]["cells"][0] = {
        "value": "3",
        "unit": "deg",
        "qualifier": "about",
    }
    table = build(content, "p/table-1")
    assert [cell.unit for cell in table.cells] == ["mm", "px", "deg", "um"]
    assert table["two.x"].number.qualifier == "about"
    assert (table["one.x"].sigma, table["one.y"].sigma) == (3, None)
