"""Tests of the warnings about faults of spots, and of their absence for clean spots."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.attitude import Platform, monitored
from reproduce.physics.attitude.diagnosis import diagnose_spots
from reproduce.physics.attitude.monitoring import _correlation
from reproduce.units import ARCSEC_PER_RADIAN

CORNERS = 0.011 * np.array([[0.0, -1], [-1, 0], [1, 0], [0, 1]])
CENTRE = (511.5, 511.5)
SQUARE = Platform(CORNERS, 2.0, 0.06, 13e-6, CENTRE, 2180 * CORNERS + [545, 460])
RAYS = [[0, 0, 1], [0.1, 0, 1], [0, 0.07, 1], [-0.05, -0.06, 1], [0.03, 0.02, 1]]
WIDE = Platform.of_directions(RAYS, 0.05, 5e-6, (1000, 1000))
THREE, PAIR = (
    Platform.of_directions(RAYS[:n], 0.05, 5e-6, (1000, 1000)) for n in (3, 2)
)
TURN = np.array([15, -25, 400]) / ARCSEC_PER_RADIAN
NOISE = 0.017


def noise(rng, shape, correlation=0.0):
    """Unit noise of images, the first axis, of an autoregressive process of first order."""
    found = rng.normal(size=shape)
    for image in range(1, len(found)):
        found[image] *= np.sqrt(1 - correlation**2)
        found[image] += correlation * found[image - 1]
    return found


def drawn(platform, frames, rng, correlation=0.0):
    """Images at the zero point and at the present, each of shape (frames, n, 2)."""
    groups = []
    for turn in (0 * TURN, TURN):
        spots = platform.predicted(turn)
        groups.append(spots + NOISE * noise(rng, (frames, *spots.shape), correlation))
    return groups


def moved(light, by, groups=(1,)):
    def change(images):
        for group in groups:
            images[group][:, light] += by
        return images

    return change


def of_both(change):
    return lambda images: [change(one) for one in images]


def order(*lights, both=True):
    place = list(lights)
    return lambda zero_now: [
        zero_now[0][:, place] if both else zero_now[0],
        zero_now[1][:, place],
    ]


def drifting(images):
    images[1] += np.linspace(0, 0.13, len(images[1]))[:, None, None]
    return images


def stray(images):
    images[1][3, 2] = 0  # where some programs write a lost spot
    return images


def one_wrong(images):
    images[0][2, 1] += [5, 0]
    return images


def repeated(images):
    images[0][4:7] = images[0][:3]
    return images


LONGER = replace(SQUARE, tracker_focal_length=0.066)
LINE = Platform(CORNERS[[1, 0, 2]] * [1, 0], 2.0, 0.06, 13e-6, CENTRE)
# Platform, change of its images, kind, words; and a wrong factor of the focal length.
FAULTS = {
    "displaced since": (
        SQUARE,
        moved(2, [3, 0]),
        "displaced",
        "present.* light 3 is displ.* 3 px",
    ),
    "displaced ever": (
        WIDE,
        moved(3, [0, 3], (0, 1)),
        "displaced",
        "^at the zero.* light 4 is",
    ),
    "one of three": (THREE, moved(2, [3, 0]), "displaced", "light 3 is displ"),
    "focal length": (SQUARE, list, "scale", r"0\.909\d* of its expected size", 1.1),
    "two lights": (PAIR, list, "scale", r"0\.909\d* of its expected size", 1.1),
    "millimetres": (
        SQUARE,
        of_both(lambda one: 0.013 * one),
        "scale",
        "unit of the spots",
    ),
    "motion": (SQUARE, drifting, "correlated", "drift"),
    "lost as zero": (SQUARE, stray, "stray", "present, light 3 in image 4 .*lost"),
    "same files": (WIDE, repeated, "repeated", "^3 of 100 images repeat"),
    "same group": (WIDE, lambda two: [two[0]] * 2, "repeated", "^50 of 100 images"),
    "stray of two": (PAIR, one_wrong, "stray", "light 1 or 2 in image 3"),
    "two at once": (
        WIDE,
        lambda images: moved(1, 2)(moved(3, [-2, 3])(images)),
        "pattern",
        "no single light",
    ),
}
# Faults that leave no angle of any use.
REFUSED = {
    "sign of x": (WIDE, of_both(lambda one: one * [-1, 1]), "mirrored"),
    "x and y": (SQUARE, of_both(lambda one: one[..., ::-1]), "mirrored"),
    "neighbours": (SQUARE, order(1, 0, 2, 3), "lights 1 and 2 look swapped"),
    "corners": (SQUARE, order(0, 2, 1, 3), "mirrored.* or lights 2 and 3 look swapped"),
    "now": (
        SQUARE,
        order(1, 0, 2, 3, both=False),
        "present.* lights 1 and 2 look swapped",
    ),
    "two of three": (THREE, order(1, 0, 2), "lights 1 and 2 look swapped"),
    "ends of a line": (LINE, order(2, 1, 0), "lights 1 and 3 look swapped"),
    "both": (PAIR, order(1, 0), "lights 1 and 2 look swapped"),
    "another instrument": (WIDE, of_both(lambda one: one * [1, 2]), "another platform"),
    "metres": (PAIR, of_both(lambda one: one * 1e-6), "Give pixels"),
    "one place": (THREE, of_both(lambda one: one[:, [0, 1, 1]]), "lights 2 and 3"),
}


def interval(platform, images, turn=TURN):
    """Diagnosis of images, whether the 95 % intervals contain the angles, and their widths."""
    found = diagnose_spots(platform, tuple(images))
    uncertain = found.widening, found.freedom, found.design_variance
    low, high = monitored(*images, platform, *uncertain).interval(0.95)
    return found, (low < turn) & (high > turn), high - low


def kinds(platform, images):
    return [one.kind for one in diagnose_spots(platform, tuple(images)).findings]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(fault):
    platform, change, kind, words, *longer = FAULTS[fault]
    images = change(drawn(platform, 50, default_rng(1)))
    for factor in longer:
        length = factor * platform.tracker_focal_length
        platform = replace(platform, tracker_focal_length=length)
    found = diagnose_spots(platform, tuple(images)).findings
    assert found[0].kind == kind
    assert re.search(words, found[0].text), found[0].text


@pytest.mark.parametrize("fault", REFUSED)
def test_spots_without_usable_angles_are_refused(fault):
    platform, change, words = REFUSED[fault]
    images = change(drawn(platform, 50, default_rng(1)))
    with pytest.raises(ValueError, match=f"^spots: .*{words}"):
        diagnose_spots(platform, tuple(images))


@pytest.mark.parametrize("count", [3, 4, 6])
def test_spots_of_another_platform_are_refused(count):
    """Random patterns of lights of the same extent."""
    rng = default_rng(count)
    for _ in range(20):
        one, other = (
            Platform(0.011 * rng.uniform(-1, 1, (count, 2)), 2.0, 0.06, 13e-6, CENTRE)
            for _ in range(2)
        )
        with pytest.raises(ValueError, match=r"^spots: "):
            diagnose_spots(one, tuple(drawn(other, 10, rng)))


@pytest.mark.parametrize(
    ("platform", "frames"),
    [(SQUARE, 2), (SQUARE, 3), (SQUARE, 40), (WIDE, 5), (THREE, 3), (PAIR, 6)],
)
def test_clean_spots_give_no_warning(platform, frames):
    """The rate of false warnings is 0.001, so that three of 300 have a probability of 0.004."""
    rng = default_rng(frames + 1)
    found = [kinds(platform, drawn(platform, frames, rng)) for _ in range(300)]
    assert sum(map(bool, found)) <= 2


@pytest.mark.parametrize("jitter", [0.0, 5.0])
@pytest.mark.parametrize("frames", [5, 10, 60])
def test_the_correlation_has_a_known_false_alarm_rate(frames, jitter):
    """White noise, of which all spots of an image may have a common part."""
    rng, scores = default_rng(frames), []
    for _ in range(2000):
        groups = rng.normal(size=(2, frames, 8)) + jitter * rng.normal(
            size=(2, frames, 1)
        )
        scores.append(_correlation(groups - groups.mean(axis=1, keepdims=True))[0])
    # Four standard errors above one in a hundred.
    assert np.mean(np.array(scores) > 2.326) < 0.01 + 4 * np.sqrt(0.01 / 2000)
    assert np.mean(scores) == pytest.approx(0, abs=4 / np.sqrt(2000))


def test_correlated_images_accuse_no_light():
    rng = default_rng(1)
    for frames, fewest in ((10, 76), (60, 80)):
        found = [kinds(SQUARE, drawn(SQUARE, frames, rng, 0.8)) for _ in range(80)]
        assert sum(one == ["correlated"] for one in found) >= fewest


@pytest.mark.parametrize(
    ("platform", "frames", "shift", "correlation", "least"),
    [
        (PAIR, 10, 0.0, 0.0, 0.92),
        (SQUARE, 10, 0.0, 0.0, 0.92),
        (PAIR, 10, 0.0, 0.8, 0.87),
        (SQUARE, 10, 0.0, 0.8, 0.9),
        (SQUARE, 60, 0.0, 0.8, 0.9),
        (SQUARE, 10, 1.7, 0.0, 0.83),
        (SQUARE, 60, 1.7, 0.0, 0.92),
    ],
)
def test_intervals_cover_correlated_images_and_small_displacements(
    platform, frames, shift, correlation, least
):
    """Coverage of 95 % intervals; a light is displaced by so many standard deviations of a spot."""
    rng, inside = default_rng(2), []
    for _ in range(100):
        images = drawn(platform, frames, rng, correlation)
        angle = rng.uniform(0, 2 * np.pi)
        moved(1, shift * NOISE * np.array([np.cos(angle), np.sin(angle)]))(images)
        inside.append(interval(platform, images)[1])
    assert np.mean(inside) > least


def test_axes_of_lights_off_their_design_are_uncertain():
    """A light off by two standard deviations of a spot: without axes, 15 % about X and Y."""
    rng, turn = default_rng(1), np.radians([1, -1, 0])
    true = np.stack([SQUARE.predicted(0 * turn), SQUARE.predicted(turn)])
    design = replace(SQUARE, lasers=CORNERS + 17e-6 * np.eye(4, 2, -1))
    sets = true[:, None] + 0.02 * rng.normal(size=(100, 2, 10, 4, 2))
    assert np.mean([interval(design, one, turn)[1] for one in sets]) > 0.8
    # A wrong size rotates no axis.
    assert diagnose_spots(LONGER, tuple(drawn(SQUARE, 9, rng))).design_variance < 1e-3


def test_groups_of_other_noise_are_named_and_widen_intervals():
    """Without it, intervals of 95 % cover 88 %, and a light seems displaced."""
    rng, inside = default_rng(3), []
    for _ in range(100):
        zero, present = drawn(SQUARE, 30, rng)
        noisy = present[:5] + 5 * NOISE * rng.normal(size=(5, 4, 2))
        found, hits, _ = interval(SQUARE, (zero, noisy))
        assert [one.kind for one in found.findings] == ["uneven"]
        inside.append(hits)
    assert np.mean(inside) > 0.92


@pytest.mark.parametrize("moved_axes", [[1, 0], [1, 1]])
def test_equal_motions_of_all_spots_are_no_other_noise(moved_axes):
    """A vibration about one axis has half the degrees of freedom of independent coordinates."""
    rng, named = default_rng(0), 0
    for _ in range(400):
        images = [
            one + 10 * NOISE * rng.normal(size=(8, 1, 2)) * moved_axes
            for one in drawn(SQUARE, 8, rng)
        ]
        named += "uneven" in kinds(SQUARE, images)
    assert named < 2


def test_images_without_spots_do_not_count():
    rng = default_rng(7)
    zero, present = drawn(SQUARE, 6, rng)
    zero += 20 * NOISE * rng.normal(size=(6, 1, 2))
    zero[3:] = np.nan
    with_lost, without = (
        diagnose_spots(SQUARE, (group, present)) for group in (zero, zero[:3])
    )
    assert with_lost.widening == without.widening
    assert with_lost.freedom == without.freedom


def test_a_motion_of_short_series_widens_intervals_without_a_finding():
    """The correlation of eight images is uncertain; intervals stay far below a full circle."""
    rng, inside, named = default_rng(1), [], 0
    for _ in range(100):
        images = drawn(SQUARE, 8, rng)
        for group in images:
            group += 3 * NOISE * noise(rng, (8, 1, 2), 0.7)
        found, hits, width = interval(SQUARE, images)
        named += len(found.findings)
        inside.append(hits[:2])
        assert width[:2].max() < np.radians(1)
    # Five standard errors below 0.85; 0.6 if only a finding widens the intervals.
    assert np.mean(inside) > 0.72
    assert named < 10


def test_chi_square_lies_in_its_range():
    """In 95 % of clean sets; four standard errors."""
    rng, inside = default_rng(4), []
    for _ in range(400):
        found = diagnose_spots(WIDE, tuple(drawn(WIDE, 20, rng))).agreement
        inside.append(found["low"] < found["chi_square"] < found["high"])
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 400))


@pytest.mark.parametrize("step", [1, 0.5, 0.1])
def test_rounded_spots_are_no_strays(step):
    """Before rounding, the noise is a quarter of a step."""
    rng = default_rng(1)
    images = (
        one + 0.25 * step * noise(rng, one.shape) for one in drawn(SQUARE, 200, rng)
    )
    rounded = [step * np.round(one / step) for one in images]
    assert "stray" not in kinds(SQUARE, rounded)
    rounded[1][7, 2] += [6, 9]
    assert "stray" in kinds(SQUARE, rounded)


def test_one_image_still_tells_a_mirror_and_a_focal_length():
    """Without scatter a pixel is taken for the noise."""
    images = drawn(SQUARE, 1, default_rng(1))
    with pytest.raises(ValueError, match=r"^spots: .*mirrored"):
        diagnose_spots(SQUARE, tuple(one * [-1, 1] for one in images))
    assert kinds(LONGER, images) == ["scale", "spare"]
    assert kinds(SQUARE, images) == ["spare"]


def test_lights_keep_their_numbers_when_others_are_lost():
    images = moved(4, [3, 0])(drawn(WIDE, 9, default_rng(1)))
    images[1][:, 0] = np.nan
    found, lost = diagnose_spots(WIDE, tuple(images)).findings
    assert "light 5 is displaced" in found.text
    assert lost.text.startswith("9 of 90 spots")
    images[1][4] *= 0
    with pytest.raises(ValueError, match=r"^spots: .* one place"):
        interval(WIDE, images)
    images[1][:, 1:4] = np.nan
    with pytest.raises(
        ValueError, match=r"^spots: expected two lights or more .* got 1"
    ):
        diagnose_spots(WIDE, tuple(images))


def test_lost_images_and_uneven_lights_are_no_fault():
    """Images without any spot repeat none; a light that few images show has a larger error.

    The only spot of an image has no distance from other spots.
    """
    rng, other, found = default_rng(5), default_rng(6), []
    for _ in range(60):
        images = drawn(WIDE, 40, rng)
        images[1][[3, 7]] = np.nan
        images[1][1:, 2] = np.nan
        pair = drawn(PAIR, 40, other)
        pair[1][:28, 0] = np.nan
        found += kinds(WIDE, images) + kinds(PAIR, pair)
    assert found == 120 * ["lost"]


def test_what_is_no_platform_is_refused():
    tracker = (0.06, 13e-6, CENTRE)
    for make, lights, *others in (
        (Platform, [[0.0, 0]], 2.0, *tracker),
        (Platform, CORNERS[[0, 1, 0]], 2.0, *tracker),
        (Platform, CORNERS, 2.0, 0.06, 13.0, CENTRE),
        (Platform, CORNERS, -2.0, *tracker),
        (Platform, CORNERS, 2.0, *tracker, np.zeros((3, 2))),
        (Platform.of_spots, [[9, 4], [9, 4]], *tracker),
        (Platform.of_directions, [[0, 0, -1], [0, 1, 1]], *tracker),
    ):
        with pytest.raises(ValueError, match="expected"):
            make(lights, *others)


def test_a_platform_is_the_same_however_its_lights_are_known():
    spots = SQUARE.predicted(np.zeros(3))
    rays = np.column_stack([-CORNERS, np.full(4, 2.0)])
    by_rays = Platform.of_directions(7 * rays, 0.06, 13e-6, CENTRE)
    assert_allclose(by_rays.directions, SQUARE.directions, atol=1e-15)
    assert_allclose(Platform.of_spots(spots, 0.06, 13e-6, CENTRE).spots, spots)
