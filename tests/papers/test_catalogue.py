"""Declarations: complete, free of circles, blind to their answers."""

from dataclasses import replace
from functools import partial
from graphlib import CycleError, TopologicalSorter

import numpy as np
import pytest

from reproduce.papers.catalogue import catalogue, studies
from reproduce.papers.declare import Prediction, reproduces
from reproduce.printed.cells import library
from reproduce.printed.inputs import UndeclaredInputError, load_inputs

ITEMS = catalogue()
COMPUTATIONS = [c for item in ITEMS.values() for c in item.computations]


def test_every_printed_file_is_an_item():
    assert set(library()) <= set(ITEMS)
    figures = set(ITEMS) - set(library())
    assert all("/fig-" in key and ITEMS[key].draw for key in figures)


def test_items_and_computations_carry_the_same_key():
    for key, item in ITEMS.items():
        assert all(computation.key == key for computation in item.computations)


def test_no_cell_is_an_input_of_itself():
    graph = {}
    for computation in COMPUTATIONS:
        sources = load_inputs(computation.inputs).cells
        for cell in library()[computation.key].cells:
            if computation.makes(cell.name):
                graph.setdefault(cell.address, set()).update(sources)
    TopologicalSorter(graph).prepare()
    address, sources = next((a, s) for a, s in graph.items() if s)
    with pytest.raises(CycleError):
        TopologicalSorter({**graph, next(iter(sources)): {address}}).prepare()


def test_no_cell_is_made_twice():
    for key, item in ITEMS.items():
        for cell in library()[key].cells if key in library() else ():
            makers = [c.name for c in item.computations if c.makes(cell.name)]
            assert len(makers) <= 1, cell.address


def test_results_are_the_declared_cells():
    for computation in COMPUTATIONS:
        few = 3 if computation.replicates else None
        results = computation(load_inputs(computation.inputs), few)
        cells = library()[computation.key].cells
        declared = [c.name for c in cells if c.is_number and computation.makes(c.name)]
        assert sorted(declared) == sorted(results), computation.name
        for result in results.values():
            if isinstance(result, Prediction):
                assert result.draws.shape == (few,)
                assert np.isfinite(result.draws).all()
            else:
                assert isinstance(result, float), computation.name


def is_needed(pattern, patterns, compute):
    """Return whether a pattern adds cells without which a computation fails."""
    others = load_inputs([one for one in patterns if one != pattern])
    try:
        compute(others)
    except UndeclaredInputError:
        return set(load_inputs([pattern]).cells) - set(others.cells)
    return False


def test_every_declared_input_is_needed():
    """Under some reading, and for the facts of a supplementary table."""
    for computation in COMPUTATIONS:
        few = 3 if computation.replicates else None
        readings = [computation.with_options(one) for one in computation.readings]
        for pattern in computation.inputs:
            assert any(
                is_needed(
                    pattern,
                    computation.inputs,
                    partial(one, replicates=few),
                )
                for one in readings
            ), f"{computation.name}: {pattern}"
    for study in studies().values():

        def whole(inputs, study=study):
            return study(inputs), study.named and study.named(inputs)

        for pattern in study.inputs:
            assert is_needed(pattern, study.inputs, whole), f"{study.key}: {pattern}"


def test_a_study_computes_the_declared_columns():
    for key, study in studies().items():
        frame = study()
        heads = [column.name for column in study.columns]
        assert study.key == key
        assert study.title
        assert list(frame.columns) == heads
        assert len(set(heads)) == len(heads)
        assert "{" not in frame.attrs["caption"]
        for column in study.columns:
            numeric = frame[column.name].dtype.kind in "if"
            assert numeric == bool(column.form), f"{key}: {column.name}"
            assert column.error in {"", *heads}


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
