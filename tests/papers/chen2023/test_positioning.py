"""Positions on the ground: the budget by formula, by draws and by hand."""

import numpy as np
import pytest
from bench import ARCSEC

import reproduce as rp
from book_facts import of_study
from reproduce.papers.chen2023 import positioning
from reproduce.papers.declare import seed_of
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.ground import (
    circular_error,
    imaged_position,
    local_axes,
)
from reproduce.printed.inputs import load_inputs

DRAWS = 20_000
INPUTS = load_inputs(positioning.INPUTS)
TERMS = positioning._terms(INPUTS)
COVARIANCES = positioning._covariances(INPUTS)
BUDGET = {name: [name] for name in TERMS} | {
    f"all together, {mean}": [
        name for name in TERMS if "misalignment" not in name or name.endswith(mean)
    ]
    for mean in ("one frame", "averaged")
}


def simulated(view, names, look):
    """Return east and north of the true place, (draws, 2), through the whole imaging model."""
    noise = {kind: np.zeros((DRAWS, 3)) for kind in positioning._UNITS}
    for name in names:
        kind, sigma = TERMS[name]
        generator = np.random.default_rng(seed_of(f"budget {look} {name}", INPUTS.root))
        noise[kind] += sigma * generator.normal(size=(DRAWS, 3))
    vectors, place, chain = view
    found = imaged_position(
        vectors + noise["image"][:, np.newaxis],
        place + noise["satellite"],
        chain @ rotation_from_vector(noise["turn"]),
    )[:, 0]
    true = imaged_position(*view)[0]
    return (found - true) @ local_axes(true)[:2].T


@pytest.mark.parametrize("look", range(3))
def test_the_budget_by_formula_and_by_draws_agree(look):
    view = positioning.LOOKS[look]
    budget = rp.table("chen2023/budget").frame()
    shown = budget.set_index("Term").iloc[:, 2 + look]
    name = shown.name.removesuffix(" (m)")
    assert list(shown.index) == list(BUDGET)
    for line, names in BUDGET.items():
        exact = COVARIANCES[line][look]
        drawn = simulated(positioning._look(INPUTS, *view), names, name)
        spread = np.sqrt(np.outer(exact.diagonal(), exact.diagonal()) + exact**2)
        error = 4.5 * spread / np.sqrt(DRAWS) + 1e-6
        assert (np.abs(np.cov(drawn.T) - exact) < error).all()
        error = 4.5 * np.sqrt(exact.diagonal() / DRAWS) + 1e-3
        assert (np.abs(drawn.mean(axis=0)) < error).all()
        if np.trace(exact) > 1e-4:
            inside = np.linalg.norm(drawn, axis=1) < shown[line]
            assert inside.mean() == pytest.approx(0.9, abs=4.5 * 0.3 / np.sqrt(DRAWS))


def test_at_nadir_an_angle_is_worth_the_altitude():
    found = circular_error(COVARIANCES["attitude of the tracker, at its limit"][0])
    assert found == pytest.approx(2.14597 * 500e3 * ARCSEC / 3, rel=1e-5)
    facts = of_study("chen2023/budget")
    assert facts["tracker"] == pytest.approx(found)
    assert facts["total"] > facts["tracker"]


def test_the_roll_moves_the_ground_by_its_arm():
    name = "misalignment about Z (roll), one frame"
    found = np.sqrt(np.trace(COVARIANCES[name][1]))
    assert found == pytest.approx(5e3 * TERMS[name][1][2], rel=1e-3)
