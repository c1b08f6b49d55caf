"""The ground platform of chen2023 as printed, independent of the data of the project."""

import numpy as np

ARCSEC = np.pi / 180 / 3600
# Mean spots of the four lasers in px, and the tracker of Table II.
SPOTS = np.array(
    [[544.822, 435.751], [520.724, 459.788], [569.035, 459.876], [544.579, 483.940]]
)
TRACKER = {
    "principal_point": (511.5, 511.5),
    "pixel_pitch": 13e-6,
    "focal_length": 60e-3,
}
# The designed lasers in m, at the corners of an upright cross.
LASERS = 11e-3 * np.array([[0, -1], [-1, 0], [1, 0], [0, 1]])
