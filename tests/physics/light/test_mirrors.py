"""The fold mirror against the law of reflection."""

import numpy as np
import pytest

from reproduce.physics.light import fold_mirror_tilt


@pytest.mark.parametrize("angle", [0.3, np.pi / 2, 2 * np.pi / 3, 3.0])
def test_the_mirror_reflects_the_returning_light_onto_the_boresight(angle):
    """Build the mirror from its tilt and reflect: the light must run down the second boresight."""
    camera = np.array([np.sin(angle), 0.0, np.cos(angle)])  # the tracker looks along z
    tilt = float(fold_mirror_tilt(angle))
    normal = np.array([-np.sin(tilt), 0.0, np.cos(tilt)])
    light = -camera
    reflected = light - 2 * (light @ normal) * normal
    np.testing.assert_allclose(reflected, [0, 0, -1], atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, -0.1, 4.0])
def test_angles_that_no_mirror_folds_are_refused(angle):
    with pytest.raises(ValueError, match="expected above 0 and at most pi"):
        fold_mirror_tilt(angle)


def test_not_a_number_is_refused():
    with pytest.raises(ValueError, match="NaN or infinite"):
        fold_mirror_tilt(np.nan)
