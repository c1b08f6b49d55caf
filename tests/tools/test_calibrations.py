"""Simulation-based calibration: a small run, the band, a broken model, the stored studies."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest

import calibrations as stored
import reproduce as rp
from calibrations import (
    DRAWS,
    LEVELS,
    Ranks,
    calibrate,
    intervals,
    named,
    power,
    replicate,
    simulated,
)
from reproduce.inference.models import GaussianRegistration
from reproduce.papers.posteriors import posteriors
from reproduce.store import studies
from reproduce.views.posterior import book_posterior

SMALL = 12
# The main models have more replicates than the others.
REPLICATES = {
    "misalignment": 2000,
    "registration": 2000,
    "registration-joint": 2000,
}
REDONE = (1, 2, 7)
STUDIES = list(posteriors())


@pytest.fixture(scope="module")
def small():
    return calibrate(posteriors()["registration"].model(), stored.SEED, SMALL)


def even(count, seed=1, names=3):
    ranks = np.random.default_rng(seed).integers(0, DRAWS + 1, (count, names))
    covered = np.zeros((count, len(LEVELS), 2), np.int8)
    return Ranks(("a", "b", "c"), ranks, np.zeros(count, bool), covered)


def test_small_calibration_is_even(small):
    assert small.ranks.shape == (SMALL, 9)
    assert small.names[:5] == posteriors()["registration"].model().names
    assert small.probabilities().min() > 0.001
    assert not small.failed.any()


def test_stored_study_begins_with_the_same_replicates(small):
    """Redone here; the chains may differ in the last bits on another machine, the ranks hardly."""
    ranks = stored.load("registration").ranks[:SMALL]
    assert (np.abs(small.ranks - ranks) <= 2).mean() > 0.95


@dataclass(frozen=True, eq=False)
class TooSure(GaussianRegistration):
    """Claims two thirds of the noise it has."""

    def simulate(self, parameters, generator):
        louder = parameters.copy()
        louder[4] *= 1.5
        return super().simulate(louder, generator)


def test_broken_model_is_found_out():
    model = posteriors()["registration"].model()
    plain = model.likelihood
    broken = replace(model, likelihood=TooSure(plain.problem))
    assert calibrate(broken, 1, 10).probabilities().min() < 0.001


def test_replicate_does_not_depend_on_the_others():
    model = posteriors()["registration"].model()
    one, _, _ = replicate(model, 5, 2)
    np.testing.assert_array_equal(calibrate(model, 5, 3).ranks[2], one)


def test_probabilities_of_even_ranks_are_even():
    found = np.concatenate([even(150, seed).probabilities() for seed in range(40)])
    assert abs((found < 0.2).mean() - 0.2) < 4 * np.sqrt(0.16 / len(found))


def test_power_is_the_share_of_calibrations_that_find_a_wrong_width():
    """Against ranks drawn one by one, among so many draws of a posterior that is too narrow."""
    generator = np.random.default_rng(3)
    found = 0
    for _ in range(60):
        truths, draws = (
            generator.normal(size=(200, 3)),
            generator.normal(size=(200, 3, DRAWS)),
        )
        ranks = (0.8 * draws < truths[..., None]).sum(axis=-1)
        found += (replace(even(200), ranks=ranks).probabilities() < 0.05).mean() / 60
    told = power(200, 0.8)
    variance = told * (1 - told) / stored.TRIALS + found * (1 - found) / 180
    assert abs(told - found) < 4 * np.sqrt(variance)
    assert 0.3 < told < 0.9  # else the comparison would be of no weight


@pytest.mark.parametrize("level", LEVELS)
def test_even_ranks_cover_exactly(level):
    """Each rank once: the ends of an interval that cut a rank in half count half."""
    ranks = np.repeat(np.arange(DRAWS + 1)[:, None], 3, axis=1)
    np.testing.assert_allclose(
        replace(even(100), ranks=ranks).coverage(level), level, atol=1e-12
    )


@pytest.mark.parametrize("name", STUDIES)
def test_stored_calibrations(name):
    """Enough replicates, whole files, few failures, and ranks inside their bands."""
    found = stored.load(name)
    model = posteriors()[name].model()
    assert found.replicates >= REPLICATES.get(name, 1000)
    assert found.names == named(model)
    assert found.names[: model.dimension] == model.names
    assert found.ranks.min() >= 0
    assert found.ranks.max() <= DRAWS
    # One band per quantity: the smallest of so many probabilities, one false alarm in a thousand.
    assert found.probabilities().min() > 0.001 / len(found.names)
    assert found.failed.mean() < 0.02
    note = studies.read(f"sbc-{name}").note
    assert f"{stored.COMMAND} {name} " in str(note["command"])


@pytest.mark.parametrize("name", STUDIES)
def test_stored_calibrations_are_those_of_the_present_models(name):
    """Replicates redone: another prior, likelihood or sampler ranks all of them otherwise.

    In an ensemble rounding grows from step to step: on other processors one chain in dozens goes
    another way at a narrow decision. So one of the three may rank otherwise.
    """
    found, model = stored.load(name), posteriors()[name].model()
    same = []
    for index in REDONE:
        ranks, failed, covered = replicate(model, stored.SEED, index)
        same.append(np.abs(ranks - found.ranks[index]).max() <= 2)
        assert failed == found.failed[index]
        np.testing.assert_array_equal(covered, found.covered[index])
    assert sum(same) >= 2, same


@pytest.mark.parametrize("name", STUDIES)
def test_stored_calibrations_know_their_models(name):
    """To a billionth: data, priors, likelihood and simulation are those that were calibrated."""
    kept = studies.read(f"sbc-{name}").arrays
    found = stored.log_posteriors(name, kept["points"], stored.SEED)
    np.testing.assert_allclose(found, kept["log_posterior"], rtol=1e-9)


def test_every_model_has_random_numbers_of_its_own():
    """The same prior, first in line, and the same seed: another truth."""
    models = [
        posteriors()[name].model()
        for name in ("registration", "registration-distortion")
    ]
    assert models[0].parameters[0].prior == models[1].parameters[0].prior
    one, other = (
        [simulated(model, stored.SEED, index)[0][0] for index in range(20)]
        for model in models
    )
    assert not set(one) & set(other)


@pytest.mark.parametrize("name", STUDIES)
def test_stored_intervals_are_those_of_the_present_estimators(name):
    """Redone without sampling; a parameter has an estimate in all replicates or in none."""
    found = stored.load(name).covered
    assert found.shape[1:] == (len(LEVELS), posteriors()[name].model().dimension)
    redone = intervals(posteriors()[name].model(), stored.SEED, 5)
    np.testing.assert_array_equal(redone, found[:5])
    np.testing.assert_array_equal((found < 0).all(axis=0), (found < 0).any(axis=0))
    # A wider interval covers whatever a narrower one does.
    assert (np.diff(found, axis=1) >= 0).all()


def test_intervals_alone_are_those_of_the_calibration(small):
    model = posteriors()["registration"].model()
    np.testing.assert_array_equal(intervals(model, stored.SEED, SMALL), small.covered)
    assert small.covered.mean() > 0.5


def with_parts(found):
    """The calibration as if the estimator gave nothing of the second parameter."""
    covered = found.covered.copy()
    covered[..., 1] = -1
    return replace(found, covered=covered)


def test_round_trip(tmp_path, small):
    found = with_parts(small)
    stored.store("registration", found, 7, tmp_path)
    again = stored.load("registration", tmp_path)
    np.testing.assert_array_equal(again.ranks, found.ranks)
    np.testing.assert_array_equal(again.covered, found.covered)
    assert again.names == found.names


def test_an_interval_is_missing_where_the_estimator_gives_nothing(small):
    coverage = with_parts(small).estimator_coverage(0.95)
    assert np.isnan(coverage).tolist() == [False, True, False, False, False]
    assert coverage[0] == small.covered[:, LEVELS.index(0.95), 0].mean()


def test_the_table_of_the_book_is_that_of_the_stored_ranks():
    pd.testing.assert_frame_equal(stored.table(), studies.table(stored.NAME), rtol=1e-9)


def test_every_model_has_its_line_in_the_table_of_its_paper():
    paper = "chen2023"
    shown = rp.posterior().diagnostics(paper)._repr_html_()
    lines = [
        [name, *re.findall(r"<td>(.*?)</td>", rest)]
        for name, rest in re.findall(
            r'<th scope="row">(.*?)</th>(.*?)</tr>', shown, re.DOTALL
        )
    ]
    assert [line[0] for line in lines] == [
        key for key, one in posteriors().items() if one.paper == paper
    ]
    for name, rhat, times, size, _, *rest in lines:
        one, found = stored.load(name), book_posterior(name)
        assert float(rhat) == pytest.approx(max(d.rhat for d in found.rows), abs=1e-4)
        assert float(times) == pytest.approx(
            found.chain.shape[1] / found.time, abs=0.51
        )
        smallest = min(min(d.bulk, d.tail) for d in found.rows)
        assert float(size.replace(",", "")) == pytest.approx(smallest, abs=0.51)
        counts = [
            f"{one.replicates:,}",
            str(int(one.failed.sum())),
            str(len(one.names)),
        ]
        assert rest[:3] == counts
        assert len(rest) == 7
