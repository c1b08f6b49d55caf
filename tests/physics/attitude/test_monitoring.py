"""Mean misalignment from spots of lights: its intervals against replicates, spots lost and not."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.attitude import Platform, monitored
from reproduce.units import ARCSEC_PER_RADIAN

SQUARE = 0.02 * np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
LINE = 0.02 * np.array([[-1.0, 0.1], [1, 0.3]])
RING = 0.03 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(6)]) + [0.05, -0.02]
TURN = np.array([15, -25, 400]) / ARCSEC_PER_RADIAN
NOISE = 0.1
# Lights, images at the zero point and at the present, fraction of lost spots, jitter of all in px.
CASES = {
    "two and two images": (SQUARE, 2, 2, 0.0, 0.0),
    "three and three": (SQUARE, 3, 3, 0.0, 0.0),
    "one and five": (SQUARE, 1, 5, 0.0, 0.0),
    "forty and two": (SQUARE, 40, 2, 0.0, 0.0),
    "jitter": (SQUARE, 5, 5, 0.0, 0.5),
    "two lights": (LINE, 4, 6, 0.0, 0.0),
    "six lights off the axis": (RING, 4, 4, 0.0, 0.0),
    "a tenth lost": (SQUARE, 5, 5, 0.1, 0.0),
    "a quarter lost": (SQUARE, 12, 6, 0.25, 0.0),
    "a quarter lost of six": (RING, 4, 8, 0.25, 0.0),
    "jitter, a quarter lost": (SQUARE, 20, 15, 0.25, 0.5),
}
REPLICATES = 250


def platform(lasers):
    return Platform(lasers, 4.0, 0.05, 5.5e-6, (500.0, 400.0))


def drawn(design, frames, turn, share, jitter, rng):
    """Spots of lights that sit by a pixel or so off their design, some lost."""
    off = default_rng(0).normal(0, 1, design.spots.shape)
    spots = off + design.predicted(turn)
    images = spots + rng.normal(0, NOISE, (frames, *spots.shape))
    images += rng.normal(0, jitter, (frames, 1, 2))
    lost = rng.random((frames, len(spots))) < share
    lost[0] = False
    images[lost] = np.nan
    return images


@pytest.mark.parametrize("case", CASES)
def test_intervals_cover(case):
    """The errors count the noise of the zero point, and of how many images both are estimated."""
    lasers, zero, now, share, jitter = CASES[case]
    design, rng = platform(lasers), default_rng(5)
    inside = {0.68: [], 0.95: []}
    for _ in range(REPLICATES):
        before, after = (
            drawn(design, frames, turn, share, jitter, rng)
            for frames, turn in ((zero, 0 * TURN), (now, TURN))
        )
        found = monitored(before, after, design)
        for level, hits in inside.items():
            low, high = found.interval(level)
            hits.append((low < TURN) & (high > TURN))
    for level, hits in inside.items():
        error = np.sqrt(level * (1 - level) / REPLICATES)
        assert_allclose(np.mean(hits, axis=0), level, atol=3.5 * error)


def test_errors_of_a_large_rotation_are_those_of_replicates():
    """The error about Z, 200 times larger, adds to the others."""
    design, turn = platform(SQUARE), np.array([[0, 0, 0], [0.01, -0.02, 0.03]])
    spots = design.predicted(turn)[:, None]
    noise = default_rng(3).normal(0, NOISE, (REPLICATES, 2, 5, 4, 2))
    found = [monitored(*(spots + one), design) for one in noise]
    expected = np.mean([one.error**2 for one in found], axis=0)
    variance = np.var([one.mean for one in found], axis=0)
    assert_allclose(variance / expected, 1, atol=4 * np.sqrt(2 / REPLICATES))
