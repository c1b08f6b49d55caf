"""Faults of spots, planted one by one, are named with their cure; clean spots hear nothing."""

import re
from dataclasses import replace

import numpy as np
import pytest

from reproduce.physics.attitude import Platform, monitored
from reproduce.physics.attitude.diagnosis import diagnose, refuse, seen
from reproduce.units import ARCSEC_PER_RADIAN

CORNERS = 0.011 * np.array([[0.0, -1], [-1, 0], [1, 0], [0, 1]])
CENTRE = (511.5, 511.5)
SQUARE = Platform(CORNERS, 2.0, 0.06, 13e-6, CENTRE, 2180 * CORNERS + [545, 460])
RAYS = [[0, 0, 1], [0.1, 0, 1], [0, 0.07, 1], [-0.05, -0.06, 1], [0.03, 0.02, 1]]
WIDE = Platform.of_directions(RAYS, 0.05, 5e-6, (1000, 1000))
THREE, PAIR = (Platform.of_directions(RAYS[:n], 0.05, 5e-6, (1000, 1000)) for n in (3, 2))
TURN = np.array([15, -25, 400]) / ARCSEC_PER_RADIAN
NOISE = 0.017


def drawn(platform, frames, rng):
    """Images at the zero point and at the present, each of shape (frames, n, 2)."""
    groups = []
    for turn in (0 * TURN, TURN):
        still = np.zeros((1, 3))
        spots = platform.predicted(still, turn[None, None])
        groups.append(spots[0, 0] + rng.normal(0, NOISE, (frames, *spots.shape[2:])))
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
    return lambda zero_now: [zero_now[0][:, place] if both else zero_now[0], zero_now[1][:, place]]


def far(images):
    images[1][16, 1] += [3, 4]
    images[0][2, 0] -= 5
    return images


def drifting(images):
    images[1] += np.linspace(0, 0.13, len(images[1]))[:, None, None]
    return images


def twice(images):
    return [images[0], np.concatenate([images[1], images[1][:1]])]


LONGER = replace(SQUARE, tracker_focal_length=0.066)
# Platform, what happens to its images, kind, words; and a wrong factor of the focal length.
FAULTS = {
    "displaced since": (SQUARE, moved(2, [3, 0]), "displaced", "since .* light 3 is displ.* 3 px"),
    "displaced ever": (WIDE, moved(3, [0, 3], (0, 1)), "displaced", "^at the zero.* light 4 is"),
    "sign of x": (WIDE, of_both(lambda one: one * [-1, 1]), "mirrored", "change the sign of x"),
    "x and y": (SQUARE, of_both(lambda one: one[..., ::-1]), "mirrored", "swap x and y"),
    "neighbours": (SQUARE, order(1, 0, 2, 3), "swapped", "^at .* lights 1 and 2 look swapped"),
    "corners": (SQUARE, order(0, 2, 1, 3), "mirrored", "or lights 2 and 3 look swapped"),
    "now": (SQUARE, order(1, 0, 2, 3, both=False), "swapped", "^since .* 1 and 2 look swapped"),
    "two of five": (WIDE, order(0, 3, 2, 1, 4), "swapped", "lights 2 and 4 look swapped"),
    "focal length": (SQUARE, list, "scale", r"is 0\.909\d* of its expected size: a focal", 1.1),
    "two lights": (PAIR, list, "scale", r"is 0\.909\d* of its expected size: a focal", 1.1),
    "millimetres": (SQUARE, of_both(lambda one: 0.013 * one), "scale", "look like millimetres"),
    "far spots": (SQUARE, far, "spot", "2 spots lie up to 7.1 px .* light 2 in image 17 of gr"),
    "motion": (SQUARE, drifting, "moving", "move within group 1, by 0.1"),
    "image twice": (SQUARE, twice, "repeated", r"1 of 51 images of group 1 .* \(51\)"),
    "two at once": (
        WIDE, lambda images: moved(1, 2)(moved(3, [-2, 3])(images)), "pattern", "no single light",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(fault):
    platform, change, kind, words, *longer = FAULTS[fault]
    images = change(drawn(platform, 50, np.random.default_rng(1)))
    for factor in longer:
        length = factor * platform.tracker_focal_length
        platform = replace(platform, tracker_focal_length=length)
    found = diagnose(platform, tuple(images))
    assert found[0].kind == kind
    assert re.search(words, found[0].text), found[0].text


@pytest.mark.parametrize(
    ("platform", "frames"),
    [(SQUARE, 2), (SQUARE, 3), (SQUARE, 40), (WIDE, 5), (THREE, 10), (PAIR, 6)],
)
def test_clean_spots_hear_nothing(platform, frames):
    """One set in a thousand may; of 300, three would be one time in four hundred thousand."""
    rng = np.random.default_rng(frames)
    found = [diagnose(platform, tuple(drawn(platform, frames, rng))) for _ in range(300)]
    assert sum(map(bool, found)) <= 2


def test_one_image_still_tells_a_mirror_and_a_focal_length():
    """Without scatter a pixel is taken for the noise."""
    images = drawn(SQUARE, 1, np.random.default_rng(1))
    assert diagnose(SQUARE, tuple(one * [-1, 1] for one in images))[0].kind == "mirrored"
    assert diagnose(LONGER, tuple(images))[0].kind == "scale"
    (found,) = diagnose(SQUARE, tuple(images))
    assert "no light is seen twice in a group" in found.text


def test_a_displaced_light_is_said_and_without_it_the_interval_covers():
    rng, inside, named = np.random.default_rng(3), [], []
    for _ in range(60):
        images = moved(2, [3, 0])(drawn(SQUARE, 8, rng))
        named += [one.text for one in diagnose(SQUARE, tuple(images))]
        images[1][:, 2] = np.nan
        platform, others, numbers = seen(SQUARE, tuple(images))
        assert numbers == (1, 2, 4)
        low, high = monitored(*others, platform).interval(0.95)
        inside.append((low < TURN) & (high > TURN))
    assert sum("light 3 is displaced" in one for one in named) == len(inside)
    np.testing.assert_allclose(np.mean(inside, axis=0), 0.95, atol=3.5 * np.sqrt(0.95 * 0.05 / 60))


def test_lights_keep_their_numbers_when_others_are_lost():
    images = moved(4, [3, 0])(drawn(WIDE, 9, np.random.default_rng(1)))
    images[1][:, 0] = np.nan
    platform, others, numbers = seen(WIDE, tuple(images))
    (found,) = diagnose(platform, others, numbers=numbers)
    assert "light 5 is displaced" in found.text
    images[1][:, 1:4] = np.nan
    with pytest.raises(ValueError, match="two lights or more in both groups, got 1"):
        seen(WIDE, tuple(images))


def test_mirrored_spots_are_refused_with_the_words_of_the_finding():
    images = [one * [-1, 1] for one in drawn(SQUARE, 5, np.random.default_rng(1))]
    found = diagnose(SQUARE, tuple(images))
    with pytest.raises(ValueError, match=r"^spots\.csv: at the zero point.* mirrored"):
        refuse(found, "spots.csv")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Platform([[0.0, 0]], 2.0, 0.06, 13e-6, CENTRE), "expected two lights or more"),
        (lambda: Platform(CORNERS, 2.0, 0.06, 13.0, CENTRE), "pixel_pitch: expected metres"),
        (lambda: Platform(CORNERS, -2.0, 0.06, 13e-6, CENTRE), "camera_focal_length"),
        (lambda: Platform(CORNERS, 2.0, 0.06, 13e-6, CENTRE, np.zeros((3, 2))), "expected 4, one"),
        (lambda: Platform.of_directions([[0, 0, -1], [0, 1, 1]], 1, 1e-6, CENTRE), "above zero"),
    ],
)
def test_what_is_no_platform_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_platform_is_the_same_however_its_lights_are_known():
    spots = SQUARE.predicted(np.zeros((1, 3)), np.zeros((1, 1, 3)))[0, 0]
    rays = np.column_stack([-CORNERS, np.full(4, 2.0)])
    by_rays = Platform.of_directions(7 * rays, 0.06, 13e-6, CENTRE)
    np.testing.assert_allclose(by_rays.directions, SQUARE.directions, atol=1e-15)
    np.testing.assert_allclose(Platform.of_spots(spots, 0.06, 13e-6, CENTRE).spots, spots)
