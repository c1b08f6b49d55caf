"""What the figures of chen2023 leave out, and why that changes no number."""

import numpy as np
import pytest

from reproduce.papers.chen2023 import accuracy, figures_monitoring, twin
from reproduce.physics.attitude.misalignment import misalignment, misalignment_angles
from reproduce.physics.attitude.wahba import mean_rotation
from reproduce.printed.given import given

ARCSEC = np.degrees(1.0) * 3600


@pytest.mark.parametrize("offset", [(5.0, -8.0, 0.0), (20.0, 15.0, 30.0)])
def test_an_offset_moves_the_series_of_figure_9_and_leaves_its_scatter(offset):
    """The paper says that its angles are not near zero, and prints no number for it."""
    door = given(figures_monitoring.READS)
    platform, frames = twin.bench(door), door.count(accuracy.FRAMES)
    generator = np.random.default_rng(3)
    light = platform.light
    first = twin.centroids(platform, platform.spots, light[0], frames, generator)
    moved = platform.turned(np.array(offset) / ARCSEC)
    second = twin.centroids(platform, moved, light[1], frames, generator)
    zero = mean_rotation(platform.transform(first))
    found = misalignment(platform.camera_directions, platform.directions(second), zero)
    series = misalignment_angles(found)[:, :2] * ARCSEC
    without = figures_monitoring.groups(door).misalignment[:, :2] * ARCSEC
    # Both means and both scatters come from as many frames: four standard errors of each.
    scatter = without.std(axis=0)
    assert np.abs(series.mean(axis=0) - offset[:2]).max() < 4 * scatter.max() * np.sqrt(2 / frames)
    assert series.std(axis=0) == pytest.approx(scatter, rel=4 / np.sqrt(frames))
