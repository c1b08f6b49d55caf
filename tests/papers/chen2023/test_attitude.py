"""The order of the product against whole solutions of Wahba's problem."""

import numpy as np
import pytest
from bench import ARCSEC, LASERS, SPOTS, TRACKER

import reproduce as rp
from book_facts import of_study
from reproduce.papers.chen2023.platform import scatter
from reproduce.physics.attitude import (
    emitted_directions,
    laser_transform,
    misalignment_between,
    received_directions,
    vector_from_rotation,
)
from reproduce.printed.inputs import load_inputs


def test_the_orders_of_the_product_are_those_of_simulated_transforms():
    """Whole solutions of Wahba's problem, multiplied either way, for both principal points."""
    orders = rp.table("chen2023/orders").frame()
    study = orders.set_index(["Principal point", "axes of the error"])
    assert study.loc["printed"].to_numpy().ravel() == pytest.approx([1.16, 1.14])
    noise = (
        3
        * np.random.default_rng(6).normal(size=(6000, 4, 2))
        * scatter(load_inputs(["chen2023/table-3"]), 1)
    )
    camera = emitted_directions(LASERS, 2.0)
    rows = iter(study.to_numpy())
    for point in (TRACKER["principal_point"], SPOTS.mean(axis=0)):
        tracker = TRACKER | {"principal_point": point}
        reference = laser_transform(camera, received_directions(SPOTS, **tracker))
        found = laser_transform(camera, received_directions(SPOTS + noise, **tracker))
        for error in (
            misalignment_between(found, reference),
            found @ reference.mT,
        ):
            spread = vector_from_rotation(error)[:, :2].std(axis=0) / ARCSEC
            assert next(rows) == pytest.approx(spread, rel=0.04)


def test_the_roll_is_worse_by_the_focal_length_over_the_size_of_the_pattern():
    """4,615 px over 24.1 px, and the distances of the spots from the best square."""
    facts = of_study("chen2023/orders")
    arm = np.linalg.norm(SPOTS - SPOTS.mean(axis=0), axis=1).mean()
    assert facts["roll"] == pytest.approx(60e-3 / 13e-6 / arm, rel=0.02)
    assert facts["misfit"] == pytest.approx(0.10, abs=0.02)
