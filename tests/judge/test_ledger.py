"""The ledger: complete, frozen, documented, and equal for any way of building it."""

import json
from dataclasses import replace

import pytest

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger, item_ledger, record_of
from reproduce.judge.readings import evaluate
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023 import effectiveness
from reproduce.papers.declare import computation_for
from reproduce.printed.cells import find, library
from reproduce.printed.inputs import load_inputs
from reproduce.views._blocks import LOOKS
from reproduce.views._verdicts import _joint_chance

WEAK = {"rounding", "copy", "difference", "tolerance", "wide"}
QUALIFIED = {"about", "nominal"}


@pytest.fixture(scope="module")
def whole():
    return ledger.build()


def test_every_printed_cell_has_one_record_and_a_frozen_verdict(whole):
    tables = (library()[key] for key in catalogue() if key in library())
    printed = [cell.address for table in tables for cell in table.cells]
    assert [record.cell for record in whole.records] == printed
    assert len(set(printed)) == len(printed) == 343
    assert set(ledger.frozen()) == set(printed)
    assert whole.changed_verdicts() == []
    changed = whole.records[0].model_copy(update={"verdict": "exact"})
    (found,) = Ledger(records=(changed,), tables=()).changed_verdicts()
    assert found == (printed[0], "input", "exact")


def test_numbers_fit_their_verdicts(whole):
    for record in whole.records:
        verdict, share = record.verdict, record.share
        assert (record.probability is not None) == (record.seed is not None)
        if verdict == "exact" and share is not None:
            wide = {"rounding", "tolerance"} & {*record.flags}
            assert wide or share <= 1 + 1e-9, record.cell
        elif verdict == "input":
            assert record.computed is None
        elif verdict == "differs":
            assert share is None


def test_stochastic_tables_have_a_joint_probability(whole):
    drawn = {record.key for record in whole.records if record.probability is not None}
    assert {table.key for table in whole.tables} == drawn
    for table in whole.tables:
        assert 0 < table.joint_probability <= 1
        assert table.expected_outside == pytest.approx(0.01 * table.cells)
        assert table.replicates >= 2000
        fits = table.outside == 0 and table.joint_probability > 0.01
        assert table.readings > 1 or table.fitting == fits
    # It is a bound if no replicate is so far from the prediction.
    (table,) = item_ledger("niu2024/table-3").tables
    assert _joint_chance(table.joint_probability, table) == "below 1/2,000"
    assert _joint_chance(0.03, table) == "0.030"


def test_a_reading_has_the_same_joint_probability_in_the_ledger_and_in_a_rerun():
    chosen = {"columns": "motions", "telescope": "common", "images": "with-ramp"}
    (rerun,) = item_ledger("chen2023/table-5", **chosen).tables
    found = evaluate(effectiveness.monitored_angle)
    place = found.computation.readings.index(chosen)
    assert rerun.joint_probability == pytest.approx(found.joint[place, 0], rel=1e-9)


def test_one_item_is_judged_as_in_the_whole(whole):
    item_ledger.cache_clear()
    single = ledger.build(["chen2023/table-5"])
    known = [one for one in whole.records if one.key == "chen2023/table-5"]
    assert [*single.records] == known
    (table,) = single.tables
    assert table in whole.tables


def test_the_json_reads_back_and_fits_the_schema_in_data(whole):
    assert Ledger.model_validate_json(whole.model_dump_json()) == whole
    schema = (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    assert json.loads(schema) == Ledger.model_json_schema(mode="serialization")


def test_unknown_keys_and_faults_in_the_frozen_verdicts_are_named(
    tmp_path, monkeypatch
):
    for name, call in (
        ("scale.green", lambda: record_of("niu2024/table-3#scale.green")),
        ("table-9", lambda: ledger.build(["niu2024/table-9"])),
    ):
        with pytest.raises(KeyError, match=name):
            call()
    monkeypatch.setattr(ledger, "data_files", tmp_path.glob)
    for verdict, cells, named in (
        ("maybe", ["niu2024/table-1"], "maybe"),
        ("differs", ["niu2024/table-1"], "reason"),
        ("input", ["niu2024/table-1"] * 2, "focal-length.red"),
    ):
        entry = f'[[expect]]\nverdict = "{verdict}"\ncells = {cells}'
        (tmp_path / "verdicts.toml").write_text(entry.replace("'", '"'))
        with pytest.raises(ValueError, match=named):
            ledger.frozen.__wrapped__()


def test_strong_agreement_is_within_the_digits(whole):
    """By rule, from the printed numbers and the records only; README has the counts."""
    agree = [r for r in whole.records if r.verdict in {"exact", "consistent"}]
    for record in (r for r in agree if WEAK.isdisjoint(r.flags)):
        number, (low, high) = find(record.cell)[0].number, record.interval
        if record.verdict == "consistent":
            assert high - low <= abs(number.value), record.cell
            continue
        off = abs(record.computed - number.value)
        assert number.is_bound or off <= number.half_unit * (1 + 1e-9), record.cell
        if number.qualifier in QUALIFIED:
            assert number.half_width <= abs(number.value) / 10, record.cell


def test_a_reason_states_that_a_value_rounds_only_if_it_does(whole):
    reason = "rounds to the printed digits"
    for record in (r for r in whole.records if r.why.endswith(reason)):
        digits = replace(find(record.cell)[0].number, qualifier="")
        assert digits.overlaps(record.computed, record.computed), record.cell
    about = [record for record in whole.records if "of the word" in record.why]
    assert len(about) > 1
    for record in about:
        number = find(record.cell)[0].number
        assert number.qualifier == record.why.rpartition(" ")[2], record.cell
        assert abs(record.computed - number.value) > number.half_unit, record.cell
    assert not any("99%" in record.why for record in whole.records)
    # The meaning of the verdict applies to weak agreement too.
    assert reason not in LOOKS["exact"]["meaning"]


def test_rounding_is_never_the_word_for_a_wider_tolerance(whole):
    """Cells that agree through rounding have no number that is printed as about or nominal."""
    rounded = [record for record in whole.records if "rounding" in record.flags]
    assert rounded
    for record in rounded:
        (cell,) = find(record.cell)
        assert cell.number.qualifier not in QUALIFIED
        computation = computation_for(record.cell)
        inputs = load_inputs(computation.inputs)
        centre = computation(inputs)[cell.name]
        for other in inputs.rounded():
            if inputs.cells[other].number.qualifier in QUALIFIED:
                moved = computation(inputs.shifted({other: 1.0}))[cell.name]
                assert moved == centre, (record.cell, other)
