"""The two papers' numbers: complete, entered twice, guarded by a checksum."""

import csv
import re
import shutil

import pint
import pytest
from made_up import PINT

from reproduce.locate import data_folder
from reproduce.printed import cells
from reproduce.printed.cells import altered_files, anchor, find, library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import UNITS, si_factor

PRINTED = data_folder() / "printed"
CELLS = {cell.address: cell for table in library().values() for cell in table.cells}


def test_a_second_entry_agrees_cell_by_cell():
    with (PRINTED / "second-entry.csv").open(encoding="utf-8", newline="") as file:
        second = {row["address"]: row["value"] for row in csv.DictReader(file)}
    assert second == {address: cell.text for address, cell in CELLS.items()}


def test_the_checksums_hold():
    assert altered_files() == (), (
        "a printed number changed: check it, then `make checksums`"
    )


def test_files_that_are_missing_or_of_no_checksum_are_altered(tmp_path, monkeypatch):
    shutil.copytree(PRINTED, tmp_path / "printed")
    (tmp_path / "printed" / "niu2024" / "table-1.toml").rename(
        tmp_path / "printed" / "more.toml"
    )
    monkeypatch.setattr(cells, "data_folders", lambda: (tmp_path,))
    assert altered_files() == ("more.toml", "niu2024/table-1.toml")
    sums = tmp_path / "printed" / "SHA256SUMS"
    sums.write_text("no sum\n", encoding="utf-8")
    assert "sum" in altered_files()
    sums.unlink()
    with pytest.raises(FileNotFoundError, match="SHA256SUMS"):
        altered_files()


def test_anchors_are_unique():
    anchors = [anchor(name) for name in [*library(), *CELLS]]
    assert len(set(anchors)) == len(anchors)
    assert re.fullmatch(r"[a-z0-9-]+", "".join(anchors))


def test_every_cell_says_where_it_stands():
    for cell in CELLS.values():
        assert re.search(r"(section|page) \S", cell.place), cell.address


def test_units_have_the_values_and_dimensions_of_pint():
    """Units of one dimension may be exchanged, except pixels, angles and pure numbers."""
    targets = {"px": "pixel", "percent": "dimensionless"}
    dimensions = {}
    for unit in UNITS:
        quantity = pint.application_registry.Quantity(1.0, PINT.get(unit, unit))
        value = (
            quantity.to(targets[unit]) if unit in targets else quantity.to_base_units()
        )
        assert si_factor(unit) == pytest.approx(value.magnitude, rel=1e-15), unit
        dimensions.setdefault(quantity.dimensionality, set()).add(unit)
    for dimension, units in dimensions.items():
        if dimension and len(units) > 1 and "px" not in units:
            [kind] = {UNITS[unit]["kind"] for unit in units}
            assert units == {u for u in UNITS if UNITS[u]["kind"] == kind}


def test_the_door_hands_out_what_is_declared_and_nothing_else():
    inputs = load_inputs(["niu2024/table-1#focal-length.*"])
    assert inputs["niu2024/table-1#focal-length.red"] == pytest.approx(0.0250601)
    with pytest.raises(LookupError, match="declared input"):
        inputs["niu2024/table-2#scale.red"]
    with pytest.raises(LookupError, match="declared input"):
        inputs.array("niu2024/table-1#*.red")


def test_cells_of_text_have_no_number():
    (dash,) = find("niu2024/table-4#scale.green")
    with pytest.raises(TypeError, match="scale"):
        _ = dash.number


def test_only_rounded_numbers_are_moved():
    """A count is a point, and a limit has no end on one side or is symmetric around zero."""
    for key in library():
        inputs = load_inputs([key])
        for address, cell in inputs.cells.items():
            number = cell.content if cell.is_number else None
            limits = {"less", "greater", "at-least", "within"}
            rounded = number and not number.exact and number.qualifier not in limits
            assert (address in inputs.rounded()) == bool(rounded), address
