"""The registration experiment with the real camera (niu2024, section 4.3)."""

from __future__ import annotations

from reproduce.papers.declare import Blocked, Results, reproduces
from reproduce.physics.optics import camera, chromatic
from reproduce.printed.given import Given

CALIBRATION = "niu2024/table-4"
OUTCOME = "niu2024/text-experiment"
OPTICS = "niu2024/text-optics"
CHANNELS = ("red", "blue")
AXES = "xy"


@reproduces(
    CALIBRATION,
    cells=["scale.*"],
    given=[f"{CALIBRATION}#focal-length.*"],
    equations=["6"],
)
def scale_factors(given: Given) -> Results:
    """Scale factors: fitted to unpublished centroids; the ratios of focal lengths stand in."""
    centroids = (
        "the star centroids measured on the three detectors, to which scale factors and focal "
        "lengths are fitted apart; our stand-in is the ratio of the focal lengths"
    )
    green = given[f"{CALIBRATION}#focal-length.green"]
    return {
        f"scale.{channel}": Blocked(
            centroids,
            float(chromatic.scale_factor(green, given[f"{CALIBRATION}#focal-length.{channel}"])),
        )
        for channel in CHANNELS
    }


@reproduces(CALIBRATION, cells=["rotation.*", "translation-*", "radial-distortion.*"])
def fitted_parameters(given: Given) -> Results:
    """Rotation, translation and distortion: fitted to centroids that are not published."""
    centroids = Blocked("the star centroids measured on the three detectors")
    fitted = [
        f"{row}.{channel}"
        for row in ("rotation", "translation-x", "translation-y")
        for channel in CHANNELS
    ]
    fitted += [f"radial-distortion.{channel}" for channel in ("red", "green", "blue")]
    return dict.fromkeys(fitted, centroids)


@reproduces(
    OUTCOME,
    cells=["pointing-error-*"],
    given=[
        f"{OUTCOME}#rmse-after-*",
        f"{OPTICS}#pixel-pitch-*",
        f"{CALIBRATION}#focal-length.green",
    ],
)
def pointing_errors(given: Given) -> Results:
    """Residuals in pixels as angles: they lie in the green image, so its focal length applies."""
    focal_length = given[f"{CALIBRATION}#focal-length.green"]
    return {
        f"pointing-error-{channel}-{axis}": float(
            camera.angle_from_pixels(
                given[f"{OUTCOME}#rmse-after-{channel}-{axis}"],
                given[f"{OPTICS}#pixel-pitch-{axis}"],
                focal_length,
            )
        )
        for channel in CHANNELS
        for axis in AXES
    }
