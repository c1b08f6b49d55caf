"""What stray light may do, term by term as the paper lists them (chen2023, II-B).

The paper keeps stray light from the Sun and the Earth out with a baffle, light of the landscape
with the narrow filter, and laser light out of the camera by matching the beam to its aperture. It
prints the bands and mean transmissions of the mirror, and no power, width or attenuation. So what
can be said is how much of each light the mirror may send on, and how much a spot tolerates.
"""

from __future__ import annotations

import numpy as np

from reproduce.papers.chen2023 import lasers, light_study, resolution
from reproduce.papers.study import Study
from reproduce.physics.images.centroid_theory import centre_of_gravity_error
from reproduce.physics.images.centroids import centre_of_gravity
from reproduce.physics.images.spots import spot_windows
from reproduce.printed.given import Given, given

MIRROR = f"{lasers.PLATFORM}#dichroic-"
SEEN = f"{lasers.PLATFORM}#tracker-band-high.value"
READS = (*resolution.READS, f"{MIRROR}*.value", SEEN, light_study.ACCURACY)
# No width of the narrow filter is printed; this one stands in, in metres.
FILTER_WIDTH = 10e-9
# How much an even background may add to the noise of a centroid.
ADDED = 0.1


def stray() -> Study:
    """Stray terms: what the printed bands and scatters allow to be said of each."""
    door = given(READS)
    passed, reflected = (door[f"{MIRROR}{n}-average.value"] for n in ("transmission", "reflection"))
    # The mirror reflects further into the infrared than the detector sees.
    band = min(door[f"{MIRROR}reflection-high.value"], door[SEEN])
    band -= door[f"{MIRROR}reflection-low.value"]
    signal, background, slope = tolerances(door)
    rows = (
        ("laser light that the mirror loses", f"{1 - reflected:.1%}"),
        ("noise of a spot's centroid that this adds", f"{reflected**-0.5 - 1:.1%}"),
        ("starlight that the mirror loses", f"{1 - passed:.1%}"),
        ("noise of a star's centroid that this adds", f"{passed**-0.5 - 1:.1%}"),
        ("visible light of the landscape that the mirror sends on", f"{1 - passed:.1%}"),
        (
            "near-infrared light of the landscape that a filter of "
            f"{FILTER_WIDTH * 1e9:.0f} nm lets through",
            f"{FILTER_WIDTH / band:.1%}",
        ),
        (
            f"even background that adds {ADDED:.0%} to the noise of a centroid",
            f"{background:.1f} electrons per px, of {signal:.0f} in a spot",
        ),
        (
            "slope of the background that mimics the averaged accuracy",
            f"{slope:.2f} electrons per px from one px to the next",
        ),
    )
    caption = (
        "Stray light. Shares follow from the mean transmission and reflection of Table II, which "
        "are limits; the width of the filter is ours. The last two take the light that Table III "
        "implies by photon noise alone."
    )
    return Study(caption, ("Term", "at most"), rows)


def tolerances(door: Given) -> tuple[float, float, float]:
    """Return the light of a spot and how much stray light its centroid tolerates."""
    light, size = resolution.light_for_table(door), resolution.window(door)
    radius = float(door[f"{resolution.STUDY}#spot-radius"] / door[resolution.PIXEL])
    corner = np.full(2, -float(size // 2))
    plain, lit = (
        centre_of_gravity_error([0.0, 0.0], light.signal, radius, corner, size, noise).variance[0]
        for noise in (0.0, 1.0)
    )
    # The shot noise of an even background acts as read noise; variance goes with its light.
    background = ((1.0 + ADDED) ** 2 - 1.0) * plain / (lit - plain)
    window = spot_windows([0.0, 0.0], light.signal, radius, corner, size)
    tilted = window + np.arange(size) + corner[0]
    moved = float(centre_of_gravity(tilted, corner)[0])
    pixel = float(door[resolution.PIXEL] / door[resolution.FOCAL_LENGTH])
    accuracy = float(door.array(light_study.ACCURACY).max())
    return light.signal, float(background), accuracy / pixel / moved
