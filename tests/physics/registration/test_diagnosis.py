"""One diagnosis of stars: what is named, what is cured, and how often it errs."""

import numpy as np
import pytest
import simulated
from numpy.random import default_rng
from scipy.stats import kstest
from simulated import PIVOT

from reproduce.physics.registration import Registration, diagnosis, fit_registration

TRUE = {
    "similarity": [0.9976, 0.01, 3.0, -2.0],
    "similarity+radial": [1.0, 0.002, 3.0, 1.0, 5e-10],
    "affine": [1.001, 0.0, 0.0003, 1.0, 3.0, 1.0],
}


def stars(seed, count, model="similarity", noise=0.05, **settings):
    """The same stars in both images."""
    truth = Registration(model, np.array(TRUE[model]), PIVOT)
    return simulated.stars(count, noise, [seed, count], truth, **settings)


def diagnosed(source, target, brightness=None, **settings):
    fit = fit_registration(source, target, PIVOT, **settings)
    return diagnosis.diagnose_fit(fit, brightness)[0]


def kinds(source, target, **settings):
    """The kinds of all warnings; a note on the sensitivity is not a warning."""
    found = diagnosed(source, target, **settings)
    return [one.kind for one in found if one.kind != "sensitive"]


@pytest.mark.parametrize("model", ["similarity+radial", "affine"])
def test_distortion_is_called_distortion_and_the_cure_can_be_followed(model):
    source, target = stars(1, 845, model, 0.02)
    (found,) = diagnosed(source, target)
    assert found.kind == "model"
    assert f'model="{model}"' in found.text
    assert "p = 0)" not in found.text
    assert kinds(source, target, model=model) == []


@pytest.mark.parametrize("model", ["similarity+radial", "affine"])
def test_a_distortion_that_no_model_contains_has_no_cure(model):
    """A radial term and a shear, and for the affine model a mirror image."""
    source, target = stars(1, 845, "similarity+radial", 0.02)
    target[:, 0] += 1e-4 * target[:, 1]
    target *= [-1 if model == "affine" else 1, 1]
    (found,) = diagnosed(source, target, model=model)
    assert found.kind == "model"
    assert "Pass" not in found.text


def test_distortion_hides_no_wrong_match():
    source, target = stars(2, 200, "similarity+radial", 0.02)
    target[[7, 30]] += [[5, 0], [0, 9]]
    model, wrong = diagnosed(source, target)
    assert model.kind == "model"
    assert set(wrong.rows) == {7, 30}
    assert wrong.rows[0] == 30  # the furthest first


def test_a_wrong_match_among_exact_stars_is_named():
    source, _ = stars(3, 20)
    target = source.round() + 3
    target[4] += 50
    (found,) = diagnosed(source.round(), target)
    assert (found.kind, found.rows) == ("mismatched", (4,))
    assert "exactly" in found.text


def test_many_wrong_matches_of_a_large_field_are_named():
    """They increase the median of the residuals, so that none is far above it."""
    source, target = stars(3, 10_000, wrong=4500)
    (found,) = (one for one in diagnosed(source, target) if one.kind == "mismatched")
    assert len(found.rows) == pytest.approx(4500, abs=10)


def test_right_fields_get_a_warning_as_often_as_stated():
    doubted = 0
    for seed in range(400):
        source, target = stars(seed, (10, 12, 20, 50)[seed % 4])
        doubted += bool(kinds(source, target))
    # 20 expected; four standard deviations on each side.
    assert 3 <= doubted <= 38


def test_a_change_is_that_of_the_richer_fit():
    source, target = stars(9, 60)
    target = source + 1e-3 * (
        target - source
    )  # a step of Gauss-Newton is exact for small terms
    plain = fit_registration(source, target, PIVOT)
    rich = fit_registration(source, target, PIVOT, model="affine").parameters
    factor = (rich[0] + rich[3]) / 2 + 1j * (rich[2] - rich[1]) / 2
    found = np.array([abs(factor), np.angle(factor), *rich[4:]])
    expected = (found - plain.parameters) / plain.standard_errors
    assert np.abs(expected).max() > 0.1
    terms = {one.term: one for one in diagnosis.sensitivities(plain)}
    assert terms["affine"].change == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("known", [False, True])
def test_p_values_of_right_fields_are_uniform(known):
    settings = {"target_covariance": 0.05**2 * np.eye(2)} if known else {}
    found = []
    for seed in range(300):
        source, target = stars(seed, 12)
        fit = fit_registration(source, target, PIVOT, **settings)
        flux = np.arange(12)
        terms = diagnosis.sensitivities(fit, flux)
        found.append([one.p_value for one in terms])
    names = ["radial", "tilt", "affine", "bright - faint"]
    assert [one.term for one in terms] == names
    assert kstest(np.array(found), "uniform", axis=0).pvalue.min() > 1e-3


def test_halves_that_differ_hide_no_term():
    """By chance the halves differ by 2.8 standard errors, and a tilt changes the scale by 2.6."""
    (found,) = diagnosed(*stars(281, 12), np.arange(12))
    assert (found.kind, "no tilt term" in found.text) == ("sensitive", True)


@pytest.mark.parametrize("model", ["similarity", "similarity+radial"])
def test_intervals_that_allow_a_radial_term_cover_with_and_without_it(model):
    """Also if the centre of the distortion is another point than the pivot."""
    inside = []
    for seed in range(300):
        source, target = stars(seed, 20, noise=0.07)
        field = (source - PIVOT - [150, 100]) / 1000
        bend = 0.3 * (seed % 2) * field * np.square(field).sum(axis=1, keepdims=True)
        fit = fit_registration(source, target + bend, PIVOT, model=model)
        terms = {one.term: one for one in diagnosis.sensitivities(fit)}
        term = terms["radial" if model == "similarity" else "decentring"]
        error, half = fit.standard_errors, fit.interval(0.95, term.number)[:, 1]
        half = (half - fit.parameters) * term.error
        centre = fit.parameters + term.change * error
        inside.append(np.abs(centre[:4] - TRUE["similarity"]) < half[:4])
    for part in (inside[::2], inside[1::2]):
        sigma = np.sqrt(0.95 * 0.05 / len(part))
        assert np.abs(np.mean(part, axis=0) - 0.95).max() < 4 * sigma


def test_a_radial_term_or_tilt_is_reported_where_it_spoils_an_interval():
    """Of wrong intervals, few have neither a warning nor a note (97 % before)."""
    silent = 0
    for seed in range(100):
        source, target = stars(seed, 20, noise=0.07)
        field = (source - PIVOT) / 1000
        bent = target + 0.2 * field * np.square(field).sum(axis=1, keepdims=True)
        fit = fit_registration(source, bent, PIVOT)
        low, high = fit.interval().T
        wrong = ((TRUE["similarity"] < low) | (TRUE["similarity"] > high)).any()
        silent += wrong and not diagnosed(source, bent)
    assert silent <= 10


@pytest.mark.parametrize("degrees", [0, 30])
def test_noise_that_depends_on_the_direction_is_reported(degrees):
    """For three times the noise along x, a 95 % interval of the shift contains 83 to 90 %."""
    axes, reported = Registration.similarity(1, np.radians(degrees), (0, 0), (0, 0)), 0
    for seed in range(20):
        source, target = stars(seed, 60, noise=0.0)
        noise = default_rng(seed).normal(0, [0.3, 0.1], source.shape)
        target += axes.apply(noise)
        reported += "uneven" in kinds(source, target)
        sigma = np.diag([0.3, 0.1]) @ axes.matrix.T
        known = kinds(source, target, target_covariance=sigma.T @ sigma)
        assert "uneven" not in known
    assert reported >= 17  # a term is found by chance in one of twenty fields


def test_stars_that_move_with_their_flux_are_reported():
    source, target = stars(10, 40)
    flux = np.arange(40.0)
    target[flux > 20] += [0.3, 0.0]
    assert kinds(source, target, brightness=flux) == ["brightness"]
    fit = fit_registration(source, target, PIVOT)
    change = diagnosis.sensitivities(fit, flux)[-1].change
    # By hand: 0.3 px over the error of the difference of two means of 20 stars.
    assert abs(change[2]) == pytest.approx(0.3 / (0.05 * np.sqrt(2 / 20)), rel=0.3)
    assert "brightness" not in kinds(source, target, brightness=flux % 2)


@pytest.mark.parametrize("count", [8, 20, 100])
def test_a_star_ten_deviations_off_is_found(count):
    found, generator = 0, default_rng(1)
    for seed in range(50):
        source, target = stars(seed, count)
        turn = generator.uniform(0, 2 * np.pi)
        target[3] += 0.6 * np.array([np.cos(turn), np.sin(turn)])
        warnings = diagnosed(source, target)
        found += any(3 in one.rows for one in warnings if one.kind == "mismatched")
    assert found >= {8: 30, 20: 49, 100: 50}[count]


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("unit", lambda s, t: (s / 100, t / 100)),
        ("unit", lambda s, t: (s, t / 150)),
        ("duplicate", lambda s, t: (np.vstack([s, s[:2]]), np.vstack([t, t[:2]]))),
        (
            "duplicate",
            lambda s, t: (np.vstack([s, s[:2]]), np.vstack([t, t[:2] + 0.01])),
        ),
        ("line", lambda s, t: (s * [1, 0], s * [1, 0] + 0.05 * np.sin(s[:, 1:]))),
        ("exact", lambda s, _: (s, s + 3)),
        ("few", lambda s, t: (s[:2], t[:2])),
        ("unmatched", lambda s, t: (s, t[::-1])),
    ],
)
def test_every_other_doubt_is_named(kind, change):
    source, target = stars(4, 40)
    assert kind in kinds(*change(source, target))
    assert kinds(source, target) == []
    assert kinds(source[:5], target[:5], robust=True) == ["few"]
    few = np.arange(40) < 7  # a star of weight zero is none
    assert kinds(source, target, weights=few, robust=True) == ["few"]
    assert "few" in kinds(source[:1], target[:1], model="shift")


def test_given_errors_are_held_against_the_scatter():
    source, target = stars(5, 60)
    assert kinds(source, target, target_covariance=0.05**2 * np.eye(2)) == []
    settings = {"target_covariance": 0.025**2 * np.eye(2)}
    assert kinds(source, target, **settings) == ["errors"]
    found = diagnosed(source, target, **settings)[0]
    assert float(found.text.split()[3]) == pytest.approx(2, rel=0.2)


# Stars, wrong ones of them. One wrong of three, and two of four or five, cannot be recognised.
COVERED = [
    *((n, 0) for n in (3, 4, 5, 8, 10, 20, 80)),
    *((4, 1), (5, 1), (8, 2), (8, 3), (10, 2), (10, 4), (20, 1), (20, 4), (20, 8)),
    *((80, 4), (80, 16), (80, 32)),
]


@pytest.mark.parametrize(("count", "wrong"), COVERED)
def test_intervals_cover(count, wrong):
    """Plain fits without wrong matches, robust ones with: shares within Monte Carlo error."""
    sets = 1000
    source, target = stars(6, count, batch=(sets,), wrong=wrong)
    for robust in (False, True) if count > 3 and not wrong else (wrong > 0,):
        fit = fit_registration(source, target, PIVOT, robust=robust)
        for level in (0.6827, 0.95):
            low, high = np.moveaxis(fit.interval(level), -1, 0)
            held = ((low <= TRUE["similarity"]) & (TRUE["similarity"] <= high)).mean(
                axis=0
            )
            # Four deviations: one of some 300 fractions exceeds them with a probability of 0.02.
            assert np.abs(held - level).max() < 4 * np.sqrt(level * (1 - level) / sets)


def test_a_pivot_that_takes_the_digits_is_refused():
    source, _ = stars(8, 5)
    for wrong in (np.array([1e15, 0.0]), PIVOT[None]):
        with pytest.raises(ValueError, match="pivot: expected"):
            diagnosis.checked_pivot(wrong, source)
