"""Your data: every model that accepts a table finds the truth, or raises an error that names it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from simulated import SHIFT, spot_table, star_table, stars

import reproduce as rp
from reproduce.inference import Normal
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import fit_registration
from reproduce.units import ARCSEC_PER_RADIAN


def test_your_data_lead_to_their_truth():
    """By the rough estimate that starts the sampler, within four of its errors."""
    for name, table, parameter, truth in (
        ("registration", star_table(truth=SHIFT), "shift-x", 3.0),
        ("misalignment", spot_table(), "angle-y", -20 / ARCSEC_PER_RADIAN),
        ("misalignment-drift", spot_table(), "drift-x", 0.0),
    ):
        model = rp.posterior(name, table).model
        centre, spread = model.likelihood.start()
        i = model.names.index(parameter)
        assert abs(centre[i] - truth) < 4 * spread[i]
        assert spread[i] < 0.1 * max(abs(truth), 1e-4)
        for value, one in zip(centre, model.parameters, strict=True):
            if isinstance(one.prior, Normal):
                away = abs(value - one.prior.mean)
                assert away < 4 * one.prior.sigma, one.name


def test_wrong_files_are_rejected_by_row_and_column():
    for name, column, value, message in (
        ("misalignment", "group", 2, r"row 9, column group"),
        ("misalignment-drift", "laser", 5, r"row 9, column laser: .* 1 to 4"),
        ("misalignment", "laser", 3, r"column laser: .* column frame"),
    ):
        table = spot_table()
        table.loc[9, column] = value
        with pytest.raises(ValueError, match=message):
            rp.posterior(name, table)
    for column, message in (("frame", "row 4, column laser"), ("group", "one group")):
        with pytest.raises(ValueError, match=message):
            rp.posterior("misalignment", spot_table().assign(**{column: 1}))
    for name, declared in posteriors().items():
        if not declared.columns:
            with pytest.raises(ValueError, match=f"{name} takes no file"):
                rp.posterior(name, star_table())


@pytest.mark.parametrize("count", [1, 3])
def test_too_few_stars_are_counted(count):
    with pytest.raises(ValueError, match=f"expected at least 4 points, got {count}"):
        rp.posterior("registration", star_table().head(count))


def test_priors_follow_the_data_and_not_the_paper():
    """In a field ten times as large the priors in px are ten times as wide."""
    widths = []
    for scale in (1, 10):
        model = rp.posterior("registration", scale * star_table()).model
        widths.append([one.prior.high for one in model.parameters[2:]])
        residual = model.likelihood.start()[0][-1]
        assert_allclose(widths[-1][-1], 1e3 * residual)
    assert_allclose(np.array(widths[1]) / widths[0], 10)


def test_weights_are_those_of_the_fit():
    """A star of weight zero is left out, by the registration and by the mixture."""
    weight = np.random.default_rng(5).uniform(0.1, 10, 30) * (np.arange(30) > 2)
    frame = star_table(30).assign(weight=weight)
    fit = fit_registration(*stars(30), (0.0, 0.0), weight)
    for name in ("registration", "registration-mixture"):
        found = rp.posterior(name, data=frame, pivot=(0.0, 0.0))
        likelihood = found.model.likelihood
        assert len(likelihood.source) == 27
        centre, spread = likelihood.start()
        assert_allclose(centre[:4], fit.parameters, rtol=1e-9)
        assert_allclose(spread[:4], fit.standard_errors, rtol=1e-9)
    assert found.stars()["row"].tolist() == list(range(3, 30))
    for bad in (0.0, -weight):
        with pytest.raises(ValueError, match=r"^weights: "):
            rp.posterior("registration", data=frame.assign(weight=bad))
