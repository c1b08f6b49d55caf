"""Posteriors of a user's data: right widths, warnings, and errors in one line."""

import hashlib
import json
import re
from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest
import xarray
from commands import run, words
from simulated import (
    PIVOT,
    SHIFT,
    TRUTH,
    registered,
    spot_table,
    star_table,
    stars,
    table_of,
)

import reproduce as rp
from reproduce.inference import (
    LogUniform,
    Normal,
    PosteriorSamples,
)
from reproduce.inference.sampling import Plan, run_ensemble
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration, fit_registration
from reproduce.printed.inputs import load_inputs

MIXTURE = "registration-mixture"


@pytest.fixture
def stored(tmp_path):
    """Write stars to a file and return its path."""

    def write(table=None, **settings):
        path = tmp_path / "data.csv"
        table = star_table(**settings) if table is None else table
        table.to_csv(path, index=False)
        return path

    return write


def sampled(name, path, *arguments):
    """Return the JSON of a run, and its parameters by name."""
    result = run(["posterior", name, "--data", path, "--json", *arguments])
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    return record, {row["name"]: row for row in record["parameters"]}


def drawn(model):
    """Return the draws of one short ensemble, for widths to a few per cent."""
    chain, acceptance = run_ensemble(model, Plan(1, 1, 0, 250, 150), 0)
    return PosteriorSamples(model, 1, chain[None], np.array([acceptance]))


def moments(found, name):
    """Return the mean and standard deviation of a parameter, in its shown unit."""
    index = found.model.names.index(name)
    values = found.chain[..., index] * found.model.parameters[index].shown
    return values.mean(), values.std()


def test_the_prior_of_noise_follows_the_spots():
    """3 px are beyond the prior of the simulated spots of the book."""
    model = rp.posterior("misalignment", spot_table(3.0)).model
    (noise,) = (one.prior for one in model.parameters if one.name == "noise")
    assert noise.low < 0.3
    assert noise.high > 30


def test_spots_that_drift_inside_a_group_give_a_warning():
    """6 arcsec, a tenth of a pixel. One model contains a drift of group 1."""
    for drift, constant, drifting in (
        ((0, 0), 0, 0),
        ((0, 6), 1, 0),
        ((6, 0), 1, 1),
    ):
        table = spot_table(drift=drift)
        view = rp.misalignment(table)
        for remarks, count, advised in (
            (rp.posterior("misalignment", table).remarks, constant, constant),
            (rp.posterior("misalignment-drift", table).remarks, drifting, 0),
            (view.remarks, constant, constant),
        ):
            found = sum("correlation" in text for text in remarks)
            assert found == len(remarks) == count
            assert "".join(remarks).count("use misalignment-drift") == advised
        assert view._repr_html_().count("Warning: ") == constant


def test_only_a_drift_needs_different_times():
    rows = spot_table().assign(frame=np.arange(400) // 4, time=1.0)
    assert rp.posterior("misalignment", rows).remarks == []
    with pytest.raises(ValueError, match=r"^data: .* times"):
        rp.posterior("misalignment-drift", rows)


def test_a_prior_that_cuts_the_posterior_is_reported():
    """A bound at four standard deviations and more has no effect."""
    free = registered(*stars())
    found = drawn(free)
    assert [*found.prior_warnings()] == []
    mean, deviation = moments(found, "noise")
    for reach, names in ((1.0, ["noise"]), (4.5, [])):
        prior = LogUniform(1e-6, mean + reach * deviation, "cut")
        warnings = drawn(free.with_priors({"noise": prior})).prior_warnings()
        assert [text.split()[0] for text in warnings] == names


def test_a_prior_that_contradicts_the_data_is_reported_with_its_distance(stored):
    """The distance of the estimate from the nearest bound, or from the mean, in degrees."""
    source, target = stars()
    path, unit = stored(), 180 / np.pi
    fit = fit_registration(source, target, source.mean(axis=0))
    value, error = unit * fit.parameters[1], unit * fit.standard_errors[1]
    normal = Normal(3.0, 1e-3, "a test")
    for prior, steps, distance in (
        (normal, 240, (3.0 - value) / np.hypot(1e-3, error)),
        ((5, 6), 800, (5 - value) / error),
    ):
        plan = {"steps": steps, "walkers": 96}
        found = rp.posterior("registration", path, priors={"rotation": prior}, **plan)
        mean, deviation = found.frame().loc["rotation", ["mean", "deviation"]]
        width = 1e-3 if prior is normal else 1.0
        assert deviation < 1.5 * width
        assert prior is normal or 5 < mean < 6
        (text,) = (text for text in found.findings if "disagree on rotation" in text)
        assert f", {distance:.3g} standard deviations" in text
        assert text in found.record()["warnings"]


def test_any_rotation_and_scale_is_sampled(stored):
    scale, rotation = 0.1, 3.1415
    path = stored(truth=Registration.similarity(scale, rotation, (3, 1), PIVOT))
    options = ("--steps", "220", "--pivot", *PIVOT)
    record, rows = sampled("registration", path, *options)
    truth = {"scale": scale, "rotation": np.degrees(rotation)}
    for name, value in (truth | {"shift-x": 3.0, "shift-y": 1.0}).items():
        assert abs(rows[name]["mean"] - value) < 4 * rows[name]["deviation"]
    data = {"kind": "file", "file": str(path), "rows": 60}
    data["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    assert record["data"] == data | {"pivot": PIVOT.tolist()}


def test_the_mixture_needs_digits_that_resolve_the_noise(stored):
    """Equal motions to the last digit have no residual, and a density without a bound."""
    for digits, noise, refused in ((0, 0.35, True), (1, 0.05, True), (2, 0.05, False)):
        path = stored(star_table(noise=noise, truth=SHIFT).round(digits))
        if refused:
            with pytest.raises(ValueError, match=r"^data: .* more digits"):
                rp.posterior(MIXTURE, path)
        else:
            assert rp.posterior(MIXTURE, path).remarks == []


def test_the_mixture_counts_the_used_stars_and_accepts_the_advised_model():
    source, target = stars(wrong=6, noise=0.05)
    target[:, 0] += 1e-3 * source[:, 0]
    frame = table_of(source, target)
    with pytest.raises(ValueError, match=r"^data: .*10 or more stars, got 9"):
        rp.posterior(MIXTURE, frame, weights=np.arange(60) > 50)
    (advice,) = rp.posterior(MIXTURE, frame).remarks
    assert advice.endswith('Pass model="affine"')
    found = rp.posterior(MIXTURE, frame, model="affine")
    assert found.remarks == []
    assert np.flatnonzero(found.stars()["probability_false"] > 0.5).tolist() == [
        *range(6)
    ]
    row = found.frame().loc["xx"]
    assert abs(row["mean"] - TRUTH.matrix[0, 0] - 1e-3) < 4 * row["deviation"]


def test_one_star_with_a_known_error_determines_a_shift():
    star = star_table(1).assign(sigma=0.1)
    found = drawn(rp.posterior("registration", star, model="shift").model)
    for axis in "xy":
        mean, deviation = moments(found, f"shift-{axis}")
        assert mean == pytest.approx(
            (star[axis] - star[f"{axis}_reference"])[0], abs=0.02
        )
        assert deviation == pytest.approx(0.1, rel=0.1)


def test_bounds_of_priors_are_two_numbers():
    for bounds in ("12", 1.0, (1, 2, 3)):
        with pytest.raises(ValueError, match=r"^prior of scale: .* Give two bounds"):
            rp.posterior("registration", priors={"scale": bounds})


# Name in the message: changes of the stars, or settings of the spots, and options.
WRONG = {
    "mirror image": {"sign": [-1, 1, 1, 1]},
    "within 100 fields of the stars": {"options": ["--pivot", "1e9", "1e9"]},
    "prior of noise": {"options": ["--prior", "noise=0.1"]},
    "prior of rotation": {"options": ["--prior", "rotation=2,-2"]},
    "priors": {"options": ["--prior", "nois=0.1,1"]},
    "--out": {"options": ["--out", "nowhere/p.nc"]},
    "10 or more stars, got 9": {"count": 9, "name": MIXTURE},
    "mirrored": {"spots": (0.02, -1)},
    "pivot": {"spots": (0.02,), "options": ["--pivot", "1", "1"]},
}


def test_wrong_data_and_options_are_reported_in_one_line(stored):
    for named, case in WRONG.items():
        path = stored(star_table(case.get("count", 60)) * case.get("sign", 1))
        name = case.get("name", "registration")
        if "spots" in case:
            path, name = stored(spot_table(*case["spots"])), "misalignment"
        options = case.get("options", ())
        result = run(["posterior", name, "--data", path, *options, "--json"])
        assert result.exit_code == 2, named
        last = result.stderr.strip().splitlines()[-1]
        assert last.startswith("Error: ")
        assert named in last
        assert "Warning" not in result.stderr
        assert "error" in json.loads(result.stdout)


def test_unconverged_chains_give_the_required_number_of_steps(stored):
    path = stored()
    result = run(["posterior", "registration", "--data", path, "--steps", 60, "--json"])
    assert result.exit_code == 1
    record = json.loads(result.stdout)
    assert len(record["error"]) < 300
    assert f"about {record['steps_needed']} steps, not 60" in record["error"]
    assert len(record["missed"]) == 5
    _, rows = sampled("registration", path, "--steps", record["steps_needed"])
    assert rows["scale"]["rhat"] < 1.01
    result = run(["posterior", "registration", "--data", path, "--out", path])
    assert "expected another file" in result.stderr


def test_one_wrong_match_is_a_misfit(stored):
    path, furthest = stored(wrong=1, count=12), "star furthest off, over rms"
    plain = rp.posterior("registration", path, steps=280, walkers=80)
    (misfit,) = (text for text in plain.record()["warnings"] if "does not fit" in text)
    assert furthest in misfit
    (check,) = (c for c in plain.record()["checks"] if c["name"] == furthest)
    assert check["observed"] > check["high"]
    assert check["tail"] < 0.002
    for shown in (plain._repr_html_(), words(repr(plain))):
        assert f"Warning: {misfit}." in shown
    with pytest.raises(ValueError, match=MIXTURE):
        plain.stars()


def test_stars_without_a_degree_of_freedom_give_no_warning():
    """Two stars with known errors determine a similarity, and leave no residual."""
    found = drawn(rp.posterior("registration", star_table(2).assign(sigma=0.1)).model)
    assert found.checks.empty
    assert [*found.warnings()] == []


def test_wrong_matches_are_named_by_their_rows_and_draws_are_saved(stored, tmp_path):
    found = rp.posterior(MIXTURE, stored(wrong=8, count=40, noise=0.05))
    record = found.record()
    assert record["warnings"] == []
    (noise,) = (one for one in record["parameters"] if one["name"] == "noise")
    assert noise["mean"] == pytest.approx(0.05, rel=0.5)
    text = "8 of 40 stars are probably matched wrongly: row 0, 1, 2, 3, 4, 5, 6, 7"
    assert found.false_stars == text
    for shown in (words(repr(found)), found._repr_html_()):
        assert f"{text}." in shown
    frame = found.stars()
    assert frame["row"].tolist() == list(range(40))
    file = found.save(tmp_path / "p.csv")
    pd.testing.assert_frame_equal(pd.read_csv(file, comment="#"), found.draws)
    names = set(re.findall("^# (\\w+): ", file.read_text(), re.MULTILINE))
    assert {"software", "citation", "setting"} <= names
    with pytest.raises(ValueError, match="path: "):
        found.save(tmp_path / "p.npz")
    tree = xarray.open_datatree(found.save(tmp_path / "p.nc"))
    for name in ("data", "versions"):
        assert json.loads(tree.attrs[name]) == record[name]
    assert record["versions"]["emcee"] == version("emcee")


def test_simulated_data_have_a_provenance():
    found = rp.posterior("registration")
    data = found.data_record
    pivot = found.model.likelihood.pivot.tolist()
    assert (data["kind"], data["paper"], data["pivot"]) == (
        "simulated",
        "niu2024",
        pivot,
    )
    cells = load_inputs(posteriors()["registration"].inputs).cells
    lines = "".join(f"{address} {cells[address].text}\n" for address in sorted(cells))
    assert data["sha256"] == hashlib.sha256(lines.encode()).hexdigest()
    assert rp.posterior("misalignment").data_record["sha256"] != data["sha256"]
