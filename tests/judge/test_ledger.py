"""The ledger: complete, frozen, documented, and the same however it is built."""

import json

import pytest

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger, reread
from reproduce.judge.readings import evaluate
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023 import effectiveness
from reproduce.printed.cells import find, library
from reproduce.printed.inputs import load_inputs
from reproduce.views.verdicts import _joint_chance


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
    assert ledger.changed_verdicts(whole) == []


def test_every_frozen_cell_is_printed_and_every_printed_cell_frozen(whole):
    assert set(ledger.frozen()) == {record.cell for record in whole.records}


def test_a_changed_verdict_is_told(whole):
    changed = whole.records[0].model_copy(update={"verdict": "exact"})
    found = ledger.changed_verdicts(Ledger(records=(changed,), tables=()))
    assert [(s.cell, s.expected, s.found) for s in found] == [
        (changed.cell, "input", "exact")
    ]


def test_numbers_fit_their_verdicts(whole):
    for record in whole.records:
        exact, consistent = record.verdict == "exact", record.verdict == "consistent"
        drawn = record.seed is not None
        assert (record.probability is not None) == drawn, record.cell
        if consistent:
            assert 0.01 <= record.probability <= 1.0
            assert record.share == pytest.approx((1 - record.probability) / 0.99)
        if (
            exact
            and record.share is not None
            and {"rounding", "tolerance"}.isdisjoint(record.flags)
        ):
            assert record.share <= 1 + 1e-9, record.cell
        if record.verdict == "input":
            assert record.computed is None
        if record.verdict == "differs":
            assert record.share is None


def test_stochastic_tables_get_a_joint_probability(whole):
    stochastic = {
        record.key for record in whole.records if record.probability is not None
    }
    assert {table.key for table in whole.tables} == stochastic
    for table in whole.tables:
        assert 0 < table.joint_probability <= 1
        assert table.expected_outside == pytest.approx(0.01 * table.cells)
        assert table.replicates >= 2000


def test_a_joint_probability_is_a_bound_where_no_replicate_lies_so_far_out(whole):
    table = whole.table("niu2024/table-3")
    assert _joint_chance(table.joint_probability, table) == "below 1/2,000"
    assert _joint_chance(0.03, table) == "0.030"


def test_a_reading_has_one_joint_probability_wherever_it_is_shown(whole):
    """Of the readings of Table V, and of the same cells under a rerun with that reading."""
    chosen = {"columns": "motions", "telescope": "common", "images": "with-ramp"}
    (rerun,) = reread("chen2023/table-5", chosen).tables
    found = evaluate(effectiveness.monitored_angle)
    place = found.computation.readings.index(chosen)
    assert rerun.joint_probability == pytest.approx(found.joint[place, 0], rel=1e-9)


def test_one_item_alone_is_judged_as_in_the_whole(whole):
    ledger._judged.cache_clear()
    alone = ledger.build(["chen2023/table-5"])
    assert alone.records == whole.of("chen2023/table-5")
    assert alone.tables == (whole.table("chen2023/table-5"),)


def test_the_json_reads_back(whole):
    assert Ledger.model_validate_json(whole.model_dump_json()) == whole


def test_the_schema_in_data_is_the_ledgers_own():
    """Other programs read the ledger by this file."""
    written = json.loads(
        (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    )
    assert written == Ledger.model_json_schema()


def test_unknown_cells_and_keys_are_refused(whole):
    with pytest.raises(KeyError, match="no record of"):
        whole.cell("niu2024/table-3#scale.green")
    with pytest.raises(KeyError, match="unknown key"):
        ledger.build(["niu2024/table-9"])


def test_faults_in_the_frozen_verdicts_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(ledger, "data_folders", lambda: (tmp_path,))
    for verdict, cells, named in (
        ("maybe", ["niu2024/table-1"], "maybe"),
        ("differs", ["niu2024/table-1"], "reason"),
        ("input", ["niu2024/table-1"] * 2, "focal-length.red"),
    ):
        entry = f'[[expect]]\nverdict = "{verdict}"\ncells = {cells}'
        (tmp_path / "verdicts.toml").write_text(entry.replace("'", '"'))
        with pytest.raises(ValueError, match=named):
            ledger.frozen.__wrapped__()


WEAK = {"rounding", "copy", "difference", "tolerance", "wide"}
QUALIFIED = {"about", "nominal"}


def test_39_of_79_cells_that_agree_are_strong(whole):
    """By rule, from the printed numbers and the records only."""
    agree = [r for r in whole.records if r.verdict in {"exact", "consistent"}]
    strong = [r for r in agree if WEAK.isdisjoint(r.flags)]
    assert (len(agree), len(strong)) == (79, 39)
    for record in strong:
        number, (low, high) = find(record.cell)[0].number, record.interval
        if record.verdict == "exact":
            off = abs(record.computed - number.value)
            assert number.is_bound or off <= number.half_unit * (1 + 1e-9), record.cell
            if number.qualifier in QUALIFIED:
                assert number.half_width <= abs(number.value) / 10, record.cell
        else:
            assert high - low <= abs(number.value), record.cell


def test_rounding_is_never_the_word_for_a_wider_tolerance(whole):
    """Cells that agree through rounding read no input, and are no cell, with such a qualifier."""
    rounded = [record for record in whole.records if "rounding" in record.flags]
    assert rounded
    for record in rounded:
        (cell,) = find(record.cell)
        assert cell.number.qualifier not in QUALIFIED
        computation = next(
            one for one in catalogue()[record.key].computations if one.makes(cell.name)
        )
        inputs = load_inputs(computation.inputs)
        centre = computation(inputs)[cell.name]
        for other in inputs.numbers():
            if other.number.qualifier in QUALIFIED:
                moved = computation(inputs.shifted({other.address: 1.0}))[cell.name]
                assert moved == centre, (record.cell, other.address)
