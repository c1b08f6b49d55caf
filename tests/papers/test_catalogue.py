"""Declarations: complete, free of circles, blind to their answers."""

import fnmatch
from dataclasses import replace

import numpy as np
import pytest

from reproduce.papers.catalogue import catalogue, studies
from reproduce.papers.declare import Prediction, reproduces
from reproduce.printed.cells import find, library
from reproduce.printed.inputs import UndeclaredInputError, load_inputs

ITEMS = catalogue()
COMPUTATIONS = [c for item in ITEMS.values() for c in item.computations]
NAMES = [c.name.split(".", 2)[-1] for c in COMPUTATIONS]


def edges():
    """Map every computed cell to the cells that it is computed from."""
    inputs = {}
    for computation in COMPUTATIONS:
        sources = {
            cell.address for pattern in computation.inputs for cell in find(pattern)
        }
        for cell in library()[computation.key].cells:
            if computation.makes(cell.name):
                inputs.setdefault(cell.address, set()).update(sources)
    return inputs


def reaches_itself(address, inputs):
    """Tell whether following the inputs of a cell leads back to it."""
    seen, ahead = set(), list(inputs.get(address, ()))
    while ahead:
        here = ahead.pop()
        if here == address:
            return True
        if here not in seen:
            seen.add(here)
            ahead.extend(inputs.get(here, ()))
    return False


def test_every_printed_file_is_an_item():
    assert set(library()) <= set(ITEMS)
    figures = set(ITEMS) - set(library())
    assert all("/fig-" in key and ITEMS[key].draw for key in figures)


def test_items_and_computations_carry_the_same_key():
    for key, item in ITEMS.items():
        assert all(computation.key == key for computation in item.computations)


def test_no_cell_reaches_itself():
    inputs = edges()
    assert [address for address in inputs if reaches_itself(address, inputs)] == []


def test_a_circle_would_be_seen():
    assert reaches_itself("a", {"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert not reaches_itself("a", {"a": {"b"}, "b": {"c"}})


def test_no_cell_is_made_twice():
    for key, item in ITEMS.items():
        for cell in library()[key].cells if key in library() else ():
            makers = [c.name for c in item.computations if c.makes(cell.name)]
            assert len(makers) <= 1, cell.address


@pytest.mark.parametrize("computation", COMPUTATIONS, ids=NAMES)
def test_results_are_cells_of_the_item(computation):
    few = 3 if computation.replicates else None
    results = computation(load_inputs(computation.inputs), few)
    table = library()[computation.key]
    assert results
    for name, result in results.items():
        assert computation.makes(name)
        assert table[name].is_number
        if isinstance(result, Prediction):
            assert result.draws.shape == (few,)
            assert np.isfinite(result.draws).all()
        else:
            assert isinstance(result, float), name
    made = [c.name for c in table.cells if computation.makes(c.name) and c.is_number]
    assert sorted(made) == sorted(results), (
        "the declared patterns and the results must agree"
    )


@pytest.mark.parametrize("computation", COMPUTATIONS, ids=NAMES)
def test_every_declared_input_is_needed(computation):
    """Without any one of its inputs, a computation fails at the door, under some reading."""
    for pattern in computation.inputs:
        others = [p for p in computation.inputs if p != pattern]
        dropped = {c.address for c in find(pattern)} - {
            c.address for other in others for c in find(other)
        }
        assert dropped, f"{pattern} is covered by another pattern"
        for choices in computation.readings:
            try:
                computation.with_options(choices)(
                    load_inputs(others), 3 if computation.replicates else None
                )
            except UndeclaredInputError:
                break
        else:
            pytest.fail(f"{pattern} is needed under no reading")


@pytest.mark.parametrize("key", studies())
def test_a_study_computes_what_it_declares(key):
    study = studies()[key]
    frame = study()
    assert study.key == key
    assert list(frame.columns) == [column.name for column in study.columns]
    assert len(set(frame.columns)) == len(study.columns)
    assert study.title
    assert "{" not in frame.attrs["caption"]
    for column in study.columns:
        numeric = frame[column.name].dtype.kind in "if"
        assert numeric == bool(column.form), (
            f"{column.name}: numbers are written by a form"
        )
        assert column.error in {"", *frame.columns}


def computed(study, inputs):
    """Compute a study and the facts that sentences quote of it."""
    return study(inputs), study.named and study.named(inputs)


@pytest.mark.parametrize("key", studies())
def test_every_declared_input_of_a_study_is_needed(key):
    study = studies()[key]
    assert len(set(study.inputs)) == len(study.inputs)
    for pattern in study.inputs:
        others = [p for p in study.inputs if p != pattern]
        with pytest.raises(UndeclaredInputError):
            computed(study, load_inputs(others))


def test_seeds_differ_between_computations():
    seeds = [c.entropy for c in COMPUTATIONS if c.replicates]
    assert len(set(seeds)) == len(seeds) > 0


def test_draws_repeat_with_a_root_seed_and_change_with_another():
    for computation in COMPUTATIONS:
        if computation.replicates:
            inputs = load_inputs(computation.inputs)
            one, same, other = (
                computation(replace(inputs, root=root), 3) for root in (None, None, 7)
            )
            for name, result in one.items():
                np.testing.assert_array_equal(result.draws, same[name].draws)
            assert any(
                (result.draws != other[name].draws).any()
                for name, result in one.items()
            )


def test_stochastic_computations_draw_at_least_2000_replicates():
    assert all(c.replicates >= 2000 for c in COMPUTATIONS if c.replicates)


def test_patterns_match_names_only():
    @reproduces("niu2024/table-3", cells=["scale.*"])
    def scales(inputs):
        return {}

    assert scales.makes("scale.red")
    assert not scales.makes("rotation.red")
    assert fnmatch.fnmatchcase("scale.red", scales.cells[0])
