"""The ledger: complete, frozen, documented, and the same however it is built."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger, Record, reread
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Blocked, Prediction, Reading, reproduces
from reproduce.printed.cells import library
from reproduce.views.verdicts import joint_chance

ROOT = Path(__file__).resolve().parents[2]
FIELDS = (
    "key cell printed unit role computed verdict flags tolerance share probability mcse why "
    "function equations seed"
).split()


@pytest.fixture(scope="module")
def whole():
    return ledger.build()


def test_every_printed_cell_has_one_record(whole):
    printed = [cell.address for item in catalogue() for cell in cells(item)]
    assert [record.cell for record in whole.records] == printed
    assert len(set(printed)) == len(printed) == 343


def cells(key):
    return library()[key].cells if key in library() else ()


def test_every_verdict_is_as_frozen(whole):
    assert ledger.surprises(whole) == []


def test_every_frozen_cell_is_printed_and_every_printed_cell_frozen(whole):
    assert set(ledger.frozen()) == {record.cell for record in whole.records}


def test_what_differs_has_its_reason(whole):
    for record in whole.records:
        if record.verdict == "differs":
            assert len(ledger.reason(record.cell)) > 60, record.cell


def test_a_changed_verdict_is_told(whole):
    changed = whole.records[0].model_copy(update={"verdict": "exact"})
    found = ledger.surprises(Ledger(records=(changed,), tables=()))
    assert [(s.cell, s.expected, s.found) for s in found] == [(changed.cell, "input", "exact")]


def test_records_carry_the_fields_of_the_design():
    assert set(FIELDS) <= set(Record.model_fields)


def test_roles_follow_from_use(whole):
    for record in whole.records:
        assert (record.role == "result") == (record.function is not None), record.cell
        assert (record.verdict == "input") == (record.role == "given"), record.cell


def test_numbers_fit_their_verdicts(whole):
    for record in whole.records:
        exact, consistent = record.verdict == "exact", record.verdict == "consistent"
        drawn = record.seed is not None and record.verdict != "blocked"
        assert (record.probability is not None) == drawn, record.cell
        if consistent:
            assert 0.01 <= record.probability <= 1.0
            assert record.share == pytest.approx((1 - record.probability) / 0.99)
        if exact and record.share is not None and "through_rounding" not in record.flags:
            assert record.share <= 1 + 1e-9, record.cell
        if record.verdict == "input":
            assert record.computed is None
        if record.verdict == "differs":
            assert record.share is None


def test_stochastic_tables_get_a_joint_probability(whole):
    stochastic = {record.key for record in whole.records if record.probability is not None}
    assert {table.key for table in whole.tables} == stochastic
    for table in whole.tables:
        assert 0 < table.joint_probability <= 1
        assert table.expected_outside == pytest.approx(0.01 * table.cells)
        assert table.replicates >= 2000


def test_a_joint_probability_is_a_bound_where_no_replicate_lies_so_far_out(whole):
    table = whole.table("niu2024/table-3")
    assert joint_chance(table) == "below 1 in 2,000"
    likelier = table.model_copy(update={"joint_probability": 0.03, "mcse": 0.004})
    assert joint_chance(likelier) == "0.030"


def test_a_reading_has_one_joint_probability_wherever_it_is_shown(whole):
    """Of the readings of Table V, and of the same cells under a rerun with that reading."""
    chosen = {"columns": "motions", "telescope": "common", "images": "ramp"}
    (rerun,) = reread("chen2023/table-5", chosen).tables
    shown = [one.joint_probability for one in whole.whole_readings("chen2023/table-5")]
    assert rerun.joint_probability in shown


def test_what_repeats_another_cell_is_flagged(whole):
    """Each flagged cell prints what some other cell of its paper prints, in its own rounding."""
    flagged = [record for record in whole.records if "repeated" in record.flags]
    assert flagged
    for record in flagged:
        assert record.verdict == "exact", record.cell
        others = [c for t in library().values() for c in t.cells if c.is_number]
        values = [c.number.value for c in others if c.unit == record.unit and c.key != record.key]
        assert any(record.computed == pytest.approx(value) for value in values), record.cell


def test_one_item_alone_is_judged_as_in_the_whole(whole):
    ledger._judged.cache_clear()
    alone = ledger.build(["chen2023/table-5"])
    assert alone.records == whole.of("chen2023/table-5")
    assert alone.tables == (whole.table("chen2023/table-5"),)


def test_the_json_reads_back(whole):
    assert Ledger.model_validate_json(whole.model_dump_json()) == whole


def test_the_schema_in_data_is_the_ledgers_own():
    """Other programs read the ledger by this file."""
    written = json.loads((data_folder() / "ledger.schema.json").read_text(encoding="utf-8"))
    assert written == Ledger.model_json_schema()


def test_every_field_is_documented():
    undocumented = [
        name
        for name, entry in Record.model_json_schema()["properties"].items()
        if "description" not in entry
    ]
    assert undocumented == []


def test_unknown_cells_and_keys_are_refused(whole):
    with pytest.raises(KeyError, match="no record of"):
        whole.cell("niu2024/table-3#scale.green")
    with pytest.raises(KeyError, match="unknown key"):
        ledger.build(["niu2024/table-9"])


def test_functions_named_in_the_ledger_exist(whole):
    from importlib import import_module

    for name in {record.function for record in whole.records if record.function}:
        module, _, function = name.rpartition(".")
        assert re.fullmatch(r"reproduce\.papers\.(niu2024|chen2023)\.\w+", module)
        assert hasattr(import_module(module), function)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('verdict = "maybe"\ncells = ["niu2024/table-1"]', "unknown verdict 'maybe'"),
        ('verdict = "differs"\ncells = ["niu2024/table-1"]', "a differs needs its reason"),
        (
            'verdict = "input"\ncells = ["niu2024/table-1", "niu2024/table-1#focal-length.red"]',
            "stands twice",
        ),
    ],
)
def test_faults_in_the_frozen_verdicts_are_told(tmp_path, monkeypatch, entry, message):
    (tmp_path / "verdicts.toml").write_text(f"[[expect]]\n{entry}\n")
    monkeypatch.setattr(ledger, "data_folders", lambda: (tmp_path,))
    with pytest.raises(ValueError, match=message):
        ledger.frozen.__wrapped__()


def test_no_prediction_is_degenerate(whole):
    for record in whole.records:
        if record.probability is not None:
            assert np.ptp(record.interval) > 0, record.cell


def made_up(readings):
    """Judge the saturation of chen2023, 40 arcsec, by readings of our own."""

    @reproduces("chen2023/text-resolution", cells=["saturation"], given=[FAR, NEAR])
    def computation(given):
        results = [Reading(name, "V-D", function(given)) for name, function in readings.items()]
        return {"saturation": Blocked("the rule", readings=tuple(results))}

    table = library()["chen2023/text-resolution"]
    return ledger._run(computation, table)[0]["saturation"]


NEAR = "chen2023/text-resolution#resolution-low"
FAR = "chen2023/text-resolution#resolution-high"


def test_a_cell_that_depends_on_its_reading_is_blocked_and_shows_them_all():
    draws = np.radians(np.linspace(30, 50, 1000) / 3600)
    record = made_up(
        {
            "half": lambda given: given[FAR] / 2,
            "whole": lambda given: given[FAR],
            "drawn": lambda given: Prediction(draws),
        }
    )
    assert record.verdict == "blocked"
    assert record.computed is None
    assert [reading.verdict for reading in record.readings] == ["exact", "differs", "consistent"]
    assert [reading.agrees for reading in record.readings] == [True, False, True]
    assert record.readings[0].computed == pytest.approx(40)
    assert record.readings[0].interval == pytest.approx((39.75, 40.25)), "inputs are rounded"
    assert record.readings[2].probability == pytest.approx(1.0, abs=0.1)
    assert record.why == "depends on the rule: the print agrees with 2 of 3 readings"


def test_readings_that_agree_among_themselves_do_not_block():
    both = {"far": lambda given: given[FAR], "near": lambda given: given[NEAR]}
    record = made_up(both)
    assert (record.verdict, record.computed) == ("differs", pytest.approx(80))
    assert [reading.verdict for reading in record.readings] == ["differs", "differs"]


def test_a_changed_input_that_leaves_no_reading_is_judged(monkeypatch):
    """1.0286 px entered as 3.0286 px: no reading of the text gives that."""
    key, name = "niu2024/text-simulation", "rmse-before-red"
    table = library()[key]
    cell = replace(table[name], content=replace(table[name].number, text="3.0286"))
    cells = tuple(cell if one.name == name else one for one in table.cells)
    changed = dict(library()) | {key: replace(table, cells=cells)}
    monkeypatch.setattr(ledger, "library", lambda: changed)
    record = ledger._judged.__wrapped__(key).cell(f"{key}#{name}")
    assert record.verdict == "differs"
    assert not any(reading.agrees for reading in record.readings)


def test_every_cell_with_readings_follows_one_rule(whole):
    """Several verdicts block; one verdict stands, whichever side it is on."""
    for record in whole.records:
        if record.readings:
            several = len({reading.agrees for reading in record.readings}) == 2
            assert (record.verdict == "blocked") == several, record.cell


def test_every_reading_has_a_day_of_the_history(whole):
    """A copy without its history cannot be held to it."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("no history")
    log = ["git", "-C", str(ROOT), "log", "--format=%as", "--", "src/reproduce/papers"]
    days = set(subprocess.run(log, capture_output=True, text=True, check=True).stdout.split())
    if len(days) < 2:
        pytest.skip("no whole history")
    found = {reading.added for record in whole.records for reading in record.readings}
    assert found <= days
    assert len(found) > 1


def test_no_one_reading_fits_table_v_the_laboratory_or_the_study(whole):
    for key in ("chen2023/table-5", "niu2024/text-experiment", "chen2023/text-resolution"):
        assert whole.whole_readings(key)
        assert not any(one.fits for one in whole.whole_readings(key))
    translations = {one.name: one.fits for one in whole.whole_readings("niu2024/table-3")}
    assert translations == {"principal points of Table 1": False, "translations of Table 2": True}


def test_readings_that_agree_one_by_one_through_rounding_alone_do_not_fit(whole):
    """Each reference angle allows another nominal length; no one length gives all of them."""
    found = {one.name: one for one in whole.whole_readings("chen2023/table-5")}
    nominal = found["columns as printed; nominal 2000 mm"]
    assert nominal.agreeing == nominal.cells == nominal.apart == 8
    assert not nominal.fits


def test_whole_readings_are_tested_together_and_not_one_by_one():
    """Two numbers that move as one, printed apart: each is likely, both together are not."""
    moved = np.random.default_rng(2).normal(40, 1, 4000)
    noise = np.random.default_rng(3).normal(0, 0.05, (2, 4000))

    def together(printed):
        names = ("resolution-high", "resolution-low")
        texts = dict(zip(names, printed, strict=True))
        cells = [library()["chen2023/text-resolution"][name] for name in names]
        cells = [replace(c, content=replace(c.number, text=texts[c.name])) for c in cells]
        draws = [Prediction(np.radians(row / 3600)) for row in moved + noise]
        return ledger._together(zip(cells, draws, strict=True))["joint_probability"]

    assert together(("40.5", "40.5")) > 0.3
    assert together(("41.0", "39.0")) < 0.01
