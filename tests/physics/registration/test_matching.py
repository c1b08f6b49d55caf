"""Matches of lists of stars, against the true pairs; unrelated lists must not match."""

import time

import numpy as np
import pandas as pd
import pytest
from astropy.table import Table
from numpy.random import default_rng

import reproduce as rp
from reproduce.physics.registration import Registration, match_points

FIELD = 1000.0
MIDDLE = (FIELD / 2, FIELD / 2)


def lists(
    seed,
    common,
    unmatched=0,
    *,
    scale=1.0,
    degrees=0.0,
    shift=(0, 0),
    noise=0.05,
    flip=1,
):
    """Return two lists of stars in random order of rows, and the true row of the target of each."""
    rng = default_rng([36, seed])
    stars = rng.uniform(0, FIELD, (common, 2))
    motion = Registration.similarity(scale, np.radians(degrees), shift, MIDDLE)
    both = [
        np.vstack(
            [
                places + rng.normal(0, noise, places.shape),
                rng.uniform(0, FIELD, (unmatched, 2)),
            ]
        )
        for places in (stars, motion.apply(stars * (1, flip)))
    ]
    orders = [rng.permutation(common + unmatched) for _ in both]
    rows = (np.argsort(order)[:common].tolist() for order in orders)
    true = dict(zip(*rows, strict=True))
    return both[0][orders[0]], both[1][orders[1]], true


def found_of(source, target, true):
    """Return the fractions of true pairs that are found, and of found pairs that are true."""
    rows, _ = match_points(source, target, 3.0)
    right = sum(true.get(a) == b for a, b in rows.tolist())
    return right / len(true), right / len(rows)


@pytest.mark.parametrize("count", [4, 5, 6, 8])
@pytest.mark.parametrize("noise", [1e-6, 1e-3])
@pytest.mark.parametrize("flip", [1, -1])
def test_few_stars_that_agree_are_found(count, noise, flip):
    for seed in range(10):
        made = lists(
            seed,
            count,
            scale=1.2,
            degrees=28.6,
            shift=(-30, 20),
            noise=noise,
            flip=flip,
        )
        assert found_of(*made) == (1, 1)


def test_three_stars_are_rejected_with_their_number():
    with pytest.raises(ValueError, match=r"4 or more .* 3 and 3"):
        rp.match(*lists(0, 3, noise=1e-6)[:2])


@pytest.mark.parametrize(
    "motion",
    [
        {},
        {"shift": (13, -8)},
        {"degrees": 0.7},
        {"degrees": 3},
        {"degrees": 90},
        {"degrees": 180},
        {"scale": 1.1, "degrees": 60},
        {"degrees": 60, "flip": -1},
    ],
)
@pytest.mark.parametrize("count", [40, 1500])
def test_lists_in_any_order_of_rows_are_matched(motion, count):
    source, target, true = lists(1, count, count // 10, **motion)
    complete, pure = found_of(source, target, true)
    assert complete > 0.97
    assert pure > 0.95


@pytest.mark.parametrize("degrees", [90, 180])
def test_many_stars_in_the_order_of_y_are_matched_as_fast_as_shuffled_stars(degrees):
    stars = default_rng(5).uniform(0, FIELD, (5000, 2))
    turned = Registration.similarity(1, np.radians(degrees), (0, 0), MIDDLE)
    noise = default_rng(6).normal(0, 0.05, stars.shape)
    target = turned.apply(stars) + noise
    ordered = tuple(places[np.argsort(places[:, 1])] for places in (stars, target))
    times = {True: [], False: []}
    for is_ordered in (False, True) * 2:
        start = time.process_time()
        pairs = rp.match(*(ordered if is_ordered else (stars, target)))
        times[is_ordered].append(time.process_time() - start)
    assert min(times[True]) < 5 * min(times[False])
    places = (
        pairs[["x", "y"]].to_numpy(),
        pairs[["x_reference", "y_reference"]].to_numpy(),
    )
    assert np.abs(turned.apply(places[0]) - places[1]).max() < 0.5
    assert len(pairs) > 4900


@pytest.mark.parametrize("unmatched", [30, 100, 400])
def test_a_shift_is_found_among_many_unmatched_stars(unmatched):
    assert found_of(*lists(2, 40, unmatched, shift=(13, -8)))[0] == 1


def test_the_distance_of_the_lists_does_not_widen_the_radius():
    source, target, _ = lists(2, 40, 5)
    found = rp.match(source, target + 1e5)
    assert found.attrs["log"] == rp.match(source, target).attrs["log"]


@pytest.mark.parametrize("kind", [Table, pd.DataFrame])
def test_the_magnitude_selects_the_bright_stars(kind):
    """Twenty bright stars are common, and three hundred faint ones are not."""
    source, target, true = lists(3, 20, 300, degrees=75, noise=0.2)
    common = (
        np.isin(np.arange(320), list(true)),
        np.isin(np.arange(320), list(true.values())),
    )
    faint = [np.where(bright, 10.0, 15.0) + np.linspace(0, 1, 320) for bright in common]
    tables = [kind({"x": x, "y": y}) for x, y in (source.T, target.T)]
    with pytest.raises(ValueError, match="common stars"):
        rp.match(*tables)
    named = [("mag", faint), ("flux", [10 ** (-0.4 * one) for one in faint])]
    for name, values in named:
        for table, value in zip(tables, values, strict=True):
            table[name] = value
        assert (
            np.diff(rp.stars(tables[0]).frame()[name]).max()
            * (1 if name == "flux" else -1)
            <= 0
        )
        pairs = rp.match(*tables)
        assert len(pairs) >= 20
        for table in tables:
            del table[name]


@pytest.mark.parametrize("kind", ["cut", "displaced", "whole"])
@pytest.mark.parametrize("degrees", [0, 170])
def test_a_grid_is_not_matched_to_its_neighbours(kind, degrees):
    """Stars on a grid agree under many transforms, but those of a whole grid under one shift."""
    rng = default_rng(0)
    steps = np.arange(0.5, 7) * FIELD / 7
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    grid += 5 * (kind == "displaced") * rng.normal(size=grid.shape)
    motion = Registration.similarity(1, np.radians(degrees), (60, -90), MIDDLE)
    target = motion.apply(grid) + rng.normal(0, 0.05, grid.shape)
    kept = (np.abs(target - FIELD / 2) < FIELD / 2).all(axis=1) | (kind == "whole")
    order = rng.permutation(np.flatnonzero(kept))
    if kind == "displaced" or (kind == "whole" and not degrees):
        rows, _ = match_points(grid, target[order], 3.0)
        assert len(rows) == len(order)
        assert (order[rows[:, 1]] == rows[:, 0]).all()
    else:
        with pytest.raises(ValueError, match=r"several .* start"):
            match_points(grid, target[order], 3.0)


@pytest.mark.parametrize("degrees", [0, 40])
def test_hot_pixels_are_not_taken_for_stars(degrees):
    """They do not move with the stars. Two detections of a star are no other transform."""
    source, target, _ = lists(8, 60, degrees=degrees, shift=(20, -10))
    hot = default_rng(8).uniform(0, FIELD, (50, 2))
    with pytest.raises(ValueError, match=r"several .* start"):
        match_points(np.vstack([source, hot]), np.vstack([target, hot]), 3.0)
    twice = [np.vstack([one, one + np.array([0.4, 0])]) for one in (source, target)]
    assert len(match_points(*twice, 3.0)[0]) > 50


def test_a_wrong_start_is_rejected_in_a_dense_field():
    """With the other sign of the shift, hundreds of unrelated stars are neighbours."""
    source, target, _ = lists(9, 2000, shift=(13, -8))
    start = Registration.similarity(1, 0, (-13, 8), MIDDLE)
    with pytest.raises(ValueError, match="common stars"):
        match_points(source, target, 3.0, start)


# Of 24 seeds with 40 stars and of 6 with 300, those whose fields agree most by chance.
CLOSEST = {40: (11, 13, 15, 16, 20, 21), 300: (1, 2, 5)}


@pytest.mark.parametrize("count", [4, 6, 12, 40, 300])
def test_unrelated_fields_are_rejected(count):
    """Also if both have a cluster at one place, or whole numbers as positions."""
    for seed in CLOSEST.get(count, range(24)):
        rng = default_rng([7, count, seed])
        uniform, whole = (
            rng.uniform(0, FIELD, (2, count, 2)),
            rng.integers(0, 60, (2, count, 2)),
        )
        clustered = uniform.copy()
        clustered[:, ::2] = FIELD / 2 + 30 * rng.standard_t(3, clustered[:, ::2].shape)
        for source, target in (uniform, clustered, 1.0 * whole):
            with pytest.raises(ValueError, match="common stars"):
                match_points(source, target, 3.0)


@pytest.mark.parametrize("seed", [2, 5, 7, 8])
def test_unrelated_points_in_columns_are_rejected(seed):
    """One coordinate of many pairs agrees under several transforms, the other one by chance."""
    rng = default_rng([seed, 99])
    source, target = (
        np.column_stack([100.0 * rng.integers(0, 8, 80), rng.uniform(0, FIELD, 80)])
        for _ in range(2)
    )
    with pytest.raises(ValueError, match="common stars"):
        match_points(source, target, 3.0)


def test_channels_with_other_bright_stars_are_matched():
    """Stars at the same places, of which the bright ones of one channel are the faint others."""
    places, _, _ = lists(4, 600)
    flux = np.where(np.arange(600) < 200, 200.0, 20.0) + np.arange(600) / 100
    tables = [
        pd.DataFrame(places, columns=["x", "y"]).assign(flux=one)
        for one in (flux, flux[::-1])
    ]
    assert len(rp.match(*tables)) == 600
