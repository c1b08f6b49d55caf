"""Declarations: complete, free of circles, blind to their answers."""

from graphlib import TopologicalSorter

import numpy as np

from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computations, drawing, study
from reproduce.printed.cells import library
from reproduce.printed.inputs import Inputs, load_inputs

ITEMS = catalogue()
COMPUTATIONS = [made for key in ITEMS for made in computations(key)]
STUDIES = [study(key) for key in catalogue("studies")]


def test_tables_contain_no_rounding_noise():
    for one in STUDIES:
        frame = one(load_inputs(one.inputs)).drop(
            columns="Probability", errors="ignore"
        )
        sizes = frame.select_dtypes("number").abs()
        assert not ((sizes > 0) & (sizes < 1e-9)).any(axis=None), one.key


def test_every_printed_file_is_an_item():
    assert set(library()) <= set(ITEMS)
    figures = set(ITEMS) - set(library())
    assert all("/fig-" in key and drawing(key) for key in figures)


def test_no_cell_is_an_input_of_itself():
    graph = {}
    for computation in COMPUTATIONS:
        sources = load_inputs(computation.inputs).cells
        for cell in library()[computation.key].cells:
            if computation.makes(cell.name):
                graph.setdefault(cell.address, set()).update(sources)
    TopologicalSorter(graph).prepare()


def test_no_cell_is_made_twice():
    for key in ITEMS:
        for cell in library()[key].cells if key in library() else ():
            makers = [c.name for c in computations(key) if c.makes(cell.name)]
            assert len(makers) <= 1, cell.address


def test_results_are_the_declared_cells():
    for computation in COMPUTATIONS:
        few = 3 if computation.replicates else None
        results = computation(load_inputs(computation.inputs), few)
        cells = library()[computation.key].cells
        declared = [c.name for c in cells if c.is_number and computation.makes(c.name)]
        assert sorted(declared) == sorted(results), computation.name
        for result in results.values():
            if computation.replicates:
                assert result.shape == (few,)
                assert np.isfinite(result).all()
            else:
                assert isinstance(result, float), computation.name


def unread(patterns, addresses):
    """Return the patterns of which no cell, unless another pattern has it, is among addresses."""
    return [
        one
        for one in patterns
        if not addresses
        & {*load_inputs([one]).cells}
        - {*load_inputs([other for other in patterns if other != one]).cells}
    ]


def test_every_declared_input_is_read(monkeypatch):
    """Under some reading, and for the facts of a supplementary table."""
    addresses, cell = set(), Inputs._cell

    def recorded(inputs, address):
        addresses.add(address)
        return cell(inputs, address)

    monkeypatch.setattr(Inputs, "_cell", recorded)
    # A separate seed for each of them, so that no result comes from a cache.
    for root, computation in enumerate(COMPUTATIONS):
        addresses.clear()
        for choices in computation.readings:
            inputs = load_inputs(computation.inputs, root)
            few = 3 if computation.replicates else None
            computation.with_options(choices)(inputs, few)
            if not unread(computation.inputs, addresses):
                break
        assert not unread(computation.inputs, addresses), computation.name
    for root, one in enumerate(STUDIES, len(COMPUTATIONS)):
        addresses.clear()
        inputs = load_inputs(one.inputs, root)
        one(inputs)
        one.named(inputs)
        assert not unread(one.inputs, addresses), one.key


def test_a_study_computes_the_declared_columns():
    for one in STUDIES:
        frame = one(load_inputs(one.inputs))
        heads = [column.name for column in one.text.columns]
        assert one.title
        assert list(frame.columns) == heads
        assert len(set(heads)) == len(heads)
        assert "{" not in frame.attrs["caption"]
        for column in one.text.columns:
            numeric = frame[column.name].dtype.kind in "if"
            assert numeric == bool(column.form), f"{one.key}: {column.name}"
