"""Posteriors of a user's own data: never narrower than they are, and never a traceback."""

import hashlib
import json
from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest
import xarray
from click.testing import CliRunner

import reproduce as rp
from reproduce.inference import (
    LogUniform,
    Normal,
    PosteriorSamples,
    Uniform,
    prior_warnings,
)
from reproduce.inference.models import registration_model
from reproduce.inference.sampling import Plan, run_ensemble
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import Platform
from reproduce.physics.registration import Registration, fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.store.points import TableFileError
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.cli import main

FIELD = np.array([2064.0, 1544.0])
STAR_COLUMNS = "x,y,x_reference,y_reference"

TOLD = ["# software", "# citation", "# setting"]


def stars(noise=0.05, scale=1.0006, rotation=0.002, wrong=0, count=81):
    """Stars of known truth about the middle of the field, some wrongly matched."""
    generator = np.random.default_rng(7)
    source = generator.uniform((0, 0), FIELD, (count, 2))
    target = Registration.similarity(scale, rotation, (3, 1), FIELD / 2).apply(source)
    target = target + noise * generator.normal(size=target.shape)
    target[:wrong] = generator.uniform((0, 0), FIELD, (wrong, 2))
    return source, target


def written(tmp_path, *columns, head=STAR_COLUMNS, fmt="%.6f"):
    path = tmp_path / "data.csv"
    np.savetxt(
        path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt=fmt
    )
    return path


def spots(tmp_path, noise, flip=1, drift=(0, 0), instrument=None):
    """Fifty images in each of two groups; between them the camera turns by (20, -20, 0) arcsec.

    Within a group it turns further about X, by so many arcsec.
    """
    instrument = instrument or as_designed(load_inputs(INSTRUMENT))
    generator = np.random.default_rng(3)
    rows = []
    for group, turn in enumerate(np.array([[0, 0, 0], [20, -20, 0]])):
        for time in np.linspace(-0.5, 0.5, 50):
            now = (turn + np.array([drift[group] * time, 0, 0])) / ARCSEC_PER_RADIAN
            at = instrument.predicted(np.zeros((1, 3)), now[None, None])[0, 0]
            image = at + noise * generator.normal(size=at.shape)
            rows += [(group, i + 1, flip * x, y) for i, (x, y) in enumerate(image)]
    return written(
        tmp_path, rows, head="group,laser,x,y", fmt=["%d", "%d", "%.6f", "%.6f"]
    )


def supplied(name, path, pivot=None):
    """A user's file as a posterior, not sampled."""
    return rp.posterior(name, path, pivot)


def from_file(name, path, pivot=None):
    """A user's file as a model."""
    return supplied(name, path, pivot).model


def run(*arguments):
    return CliRunner().invoke(main, ["posterior", *map(str, arguments)])


def sampled(name, path, *arguments):
    """Return the whole JSON of a run that succeeds, and its rows by name."""
    result = run(name, "--data", path, "--json", *arguments)
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    return record, {row["name"]: row for row in record["parameters"]}


def drawn(model, steps=250):
    """Return the draws of one ensemble, ungated: for widths to a few per cent."""
    chain, log, acceptance = run_ensemble(model, Plan(1, 1, 0, steps, 150), 0)
    return PosteriorSamples(model, 1, chain[None], log[None], (acceptance,))


def moments(found, name):
    """Mean and standard deviation of one parameter, as shown."""
    i = found.model.names.index(name)
    values = found.chain[..., i] * found.model.parameters[i].shown
    return values.mean(), values.std()


def test_the_noise_of_spots_is_that_of_the_spots(tmp_path):
    """Three pixels lie beyond the end of the prior that the book's own spots have."""
    found = drawn(from_file("misalignment", spots(tmp_path, 3.0)))
    assert moments(found, "noise")[0] == pytest.approx(3.0, abs=0.2)
    # One axis: 3 px over the root of 200 spot coordinates, at both ends of the turn.
    pixel = 13e-6 / 0.06 * ARCSEC_PER_RADIAN
    angle, deviation = moments(found, "angle-y")
    assert deviation == pytest.approx(3 * pixel / np.sqrt(100), rel=0.15)
    assert abs(angle + 20) < 3 * deviation
    assert prior_warnings(found) == []


@pytest.mark.parametrize(
    ("drift", "constant", "drifting"),
    [((0, 0), 0, 0), ((0, 6), 1, 0), ((6, 0), 1, 1), ((6, 6), 1, 1)],
)
def test_spots_that_move_within_a_group_are_named(tmp_path, drift, constant, drifting):
    """Six arc seconds, a tenth of a pixel; a drift of group 1 is part of one model."""
    path = spots(tmp_path, 0.02, drift=drift)
    front = rp.misalignment(path)
    for remarks, count in (
        (supplied("misalignment", path).remarks, constant),
        (supplied("misalignment-drift", path).remarks, drifting),
        (front.remarks, constant),
    ):
        assert sum("correlation" in one for one in remarks) == len(remarks) == count
    assert [one.kind for one in front.findings] == ["correlated"] * constant
    assert repr(front).count("Warning: ") == constant
    assert front._repr_html_().count("Warning: ") == constant


def test_spots_of_another_platform_make_no_posterior(tmp_path):
    """A file of four other lights, with and without their platform."""
    other = Platform(
        0.011 * np.array([[1, 0.2], [-0.4, 1], [-1, -1], [0.3, -0.6]]),
        2.0,
        0.06,
        13e-6,
        (511.5, 511.5),
    )
    path = spots(tmp_path, 0.02, instrument=other)
    found = rp.posterior("misalignment", data=path, platform=other)
    for wrong in (
        lambda: rp.posterior("misalignment").rerun(data=path),
        lambda: found.rerun(platform=None),
        lambda: rp.misalignment(path),
    ):
        with pytest.raises(ValueError, match="another platform"):
            wrong()


def test_a_free_posterior_leans_on_nothing_and_a_cut_one_does():
    """Beyond four standard deviations of the noise a cut no longer matters."""
    source, target = stars()
    free = registration_model(source, target, FIELD / 2)
    found = drawn(free)
    assert prior_warnings(found) == []
    mean, deviation = moments(found, "noise")
    for reach, named in ((1.0, ["noise"]), (4.5, [])):
        cut = {"noise": LogUniform(1e-6, mean + reach * deviation, "cut")}
        cut_model = free.with_priors(cut)
        assert [one.split()[0] for one in prior_warnings(drawn(cut_model))] == named


@pytest.mark.parametrize(
    ("name", "prior"),
    [
        ("noise", (5, 6)),
        ("scale", (1.5, 1.6)),
        ("scale", Normal(1.5, 1e-3, "a test")),
        ("rotation", Normal(3.0, 1e-3, "a test")),
    ],
)
def test_a_prior_that_the_data_contradict_is_sampled_and_reported(
    tmp_path, name, prior
):
    """With the distance of the estimate from the nearest bound, or from the mean."""
    source, target = stars()
    found = rp.posterior(
        "registration", written(tmp_path, source, target), priors={name: prior}
    )
    mean, deviation = found.frame().loc[name, ["mean", "deviation"]]
    own = 1.0 if isinstance(prior, tuple) else prior.sigma
    assert deviation < 1.5 * own
    if isinstance(prior, tuple):
        assert prior[0] < mean < prior[1]
    fit = fit_registration(source, target, source.mean(axis=0))
    noise = np.sqrt(fit.chi_square / fit.degrees_of_freedom)
    values = dict(zip(fit.names, fit.parameters, strict=True)) | {"noise": noise}
    errors = dict(zip(fit.names, fit.standard_errors, strict=True))
    errors |= {"noise": noise / np.sqrt(2 * fit.degrees_of_freedom)}
    shown = 180 / np.pi if name == "rotation" else 1.0
    value, error = shown * values[name], shown * errors[name]
    if isinstance(prior, tuple):
        distance = (prior[0] - value) / error
    else:
        distance = abs(prior.mean - value) / np.hypot(prior.sigma, error)
    (first,) = (one for one in found.findings if "prior and data disagree" in one)
    assert f"disagree on {name}" in first
    assert f", {distance:.3g} standard deviations" in first
    assert first in found.record()["warnings"]


@pytest.mark.parametrize(
    ("model", "name", "unit"),
    [
        ("registration", "rotation", np.degrees(1)),
        ("misalignment", "angle-z", ARCSEC_PER_RADIAN),
    ],
)
def test_a_prior_has_one_unit_however_it_is_given(model, name, unit):
    """Degrees or arcsec, for two bounds and for a distribution."""
    for prior, ends in (
        ((-6, 6), [-6, 6]),
        (Uniform(-6, 6, "a test"), [-6, 6]),
        (Normal(1, 3, "a test"), [1, 3]),
    ):
        found = rp.posterior(model, priors={name: prior})
        own = found.model.parameters[found.model.names.index(name)].prior
        numbers = (
            [own.mean, own.sigma] if isinstance(prior, Normal) else [own.low, own.high]
        )
        np.testing.assert_allclose(numbers, np.array(ends) / unit, rtol=1e-12)
        shown = "normal, mean 1, standard deviation 3"
        expected = shown if isinstance(prior, Normal) else "uniform from -6 to 6"
        assert found.priors.loc[name, "prior"] == expected


@pytest.mark.parametrize(("scale", "rotation"), [(1.0006, 3.1415), (0.1, -2.0)])
def test_any_rotation_and_scale_is_sampled_and_given_as_it_is(
    tmp_path, scale, rotation
):
    path = written(tmp_path, *stars(scale=scale, rotation=rotation))
    record, rows = sampled(
        "registration", path, "--steps", 220, "--pivot", *(FIELD / 2)
    )
    truth = {
        "scale": scale,
        "rotation": np.degrees(rotation),
        "shift-x": 3.0,
        "shift-y": 1.0,
    }
    for name, value in truth.items():
        assert abs(rows[name]["mean"] - value) < 4 * rows[name]["deviation"]
    assert (rows["scale"]["unit"], rows["rotation"]["unit"]) == ("1", "deg")
    assert rows["scale"]["deviation"] < 1e-5
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert record["data"] == {
        "kind": "file",
        "file": str(path),
        "rows": 81,
        "sha256": digest,
        "pivot": [(FIELD / 2).tolist()],
    }


def test_the_turn_is_cut_opposite_to_the_stars_that_agree(tmp_path):
    """Wrong matches that all turn another way carry least squares along."""
    source, target = stars()
    target[:24] = Registration.similarity(1.0, -1.5, (0, 0), FIELD / 2).apply(
        source[:24]
    )
    path = written(tmp_path, source, target)
    name, middle = "registration-mixture", {}
    for one in ("registration", name):
        prior = from_file(one, path).parameters[1].prior
        assert prior.high - prior.low == pytest.approx(2 * np.pi)
        middle[one] = (prior.low + prior.high) / 2
    assert middle[name] == pytest.approx(0.002, abs=1e-4)
    assert abs(middle["registration"]) > 0.1


def test_a_wild_star_of_the_channel_leaves_room_for_the_scale(tmp_path):
    """It makes the channel's pattern a thousand times as large as that of the reference."""
    source, target = stars()
    source[0] = 1e7
    model = from_file("registration-mixture", written(tmp_path, source, target))
    assert model.parameters[0].prior.high > 5


@pytest.mark.parametrize(
    ("digits", "scale", "told"),
    [(0, 1.0, True), (1, 1.0, True), (0, 1.0004, False), (2, 1.0, False)],
)
def test_noise_that_is_lost_in_the_rounding_is_told(tmp_path, digits, scale, told):
    """Stars that move alike to the last digit have no residual, and a density without bound."""
    noise = {0: 0.35, 1: 0.05, 2: 0.05}[digits]
    columns = stars(noise=noise, scale=scale, rotation=0.0, count=60)
    path = written(tmp_path, *(one.round(digits) for one in columns))
    found = [one for one in rp.register(path).findings if one.kind != "sensitive"]
    assert [one.kind for one in found] == ["tied"] * told
    assert supplied("registration", path).remarks == tuple(one.text for one in found)
    for name in ("registration-mixture",):
        if told:
            with pytest.raises(TableFileError, match="more digits"):
                supplied(name, path)
        else:
            assert supplied(name, path).remarks == ()


REFUSED = {
    "mirror image": {"source": [-1, 1]},
    "coincident points": {"source": 0, "target": 0},
    "got one point": {"count": 1},
    "without any error": {"noise": 0},
    "within 100 fields of the stars": {"arguments": ["--pivot", "1e9", "1e9"]},
    "--prior noise=0.1": {"arguments": ["--prior", "noise=0.1"]},
    "--prior noise=a,b": {"arguments": ["--prior", "noise=a,b"]},
    "prior of rotation": {"arguments": ["--prior", "rotation=2,-2"]},
    "prior of noise": {"arguments": ["--prior", "noise=-1,1"]},
    "priors: expected names": {"arguments": ["--prior", "nois=0.1,1"]},
    "--out": {"arguments": ["--out", "nowhere/p.nc"]},
    "expected 10 or more stars, got 9": {"count": 9, "name": "registration-mixture"},
    "--steps": {"arguments": ["--steps", "0"]},
    "expected spots that scatter": {"spots": (0.0,), "name": "misalignment"},
    "the spots are mirrored": {"spots": (0.02, -1), "name": "misalignment"},
    "pivot: expected none": {
        "spots": (0.02,),
        "name": "misalignment",
        "arguments": ["--pivot", "1", "1"],
    },
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_sampled_is_refused_in_one_line(tmp_path, message):
    case = {"source": 1, "target": 1, "count": 81, "noise": 0.05, "arguments": []}
    case |= REFUSED[message]
    source, target = stars(count=case["count"], noise=case["noise"])
    rows = (source * case["source"], target * case["target"])
    path = written(tmp_path, *rows, fmt="%.17g")
    if "spots" in case:
        path = spots(tmp_path, *case["spots"])
    arguments = [case.get("name", "registration"), "--data", path, *case["arguments"]]
    result = run(*arguments, "--json")
    assert result.exit_code == 2
    last = result.stderr.strip().splitlines()[-1]
    assert last.startswith("Error: ")
    assert message in last
    assert "Warning" not in result.stderr
    assert set(json.loads(result.stdout)) >= {"error"}


def test_a_pivot_needs_your_data():
    with pytest.raises(ValueError, match="pivot: "):
        rp.posterior("registration", pivot=(1.0, 1.0))


def test_refused_chains_tell_the_steps_that_would_do(tmp_path):
    path = written(tmp_path, *stars())
    result = run("registration", "--data", path, "--steps", 60, "--json")
    assert result.exit_code == 1
    record = json.loads(result.stdout)
    assert len(record["error"]) < 300
    assert str(record["steps_needed"]) in record["error"]
    assert len(record["missed"]) == 5
    _, rows = sampled("registration", path, "--steps", record["steps_needed"])
    assert rows["scale"]["rhat"] < 1.01


def test_a_mismatch_among_a_dozen_stars_is_a_misfit_and_the_mixture_names_it(tmp_path):
    """In one line, and in JSON; the mixture fits the rest, and draws go to a file."""
    path = written(tmp_path, *stars(wrong=1, count=12))
    record, rows = sampled("registration", path, "--steps", 400)
    assert rows["noise"]["mean"] > 20
    (misfit,) = (one for one in record["warnings"] if "does not fit" in one)
    assert "star furthest off, over rms is 3." in misfit
    (check,) = (
        one for one in record["checks"] if one["name"] == "star furthest off, over rms"
    )
    assert check["observed"] > check["high"]
    assert check["tail"] < 0.002
    plain = rp.posterior("registration", path, steps=400)
    assert f"Warning: {misfit}." in plain._repr_html_()
    assert f"Warning: {misfit}." in " ".join(repr(plain).split())
    with pytest.raises(ValueError, match="registration-mixture"):
        plain.stars()

    out = tmp_path / "p.nc"
    record, rows = sampled("registration-mixture", path, "--out", out)
    assert record["warnings"] == []
    assert rows["noise"]["mean"] == pytest.approx(0.05, rel=0.5)
    assert [one["row"] for one in record["stars"]] == list(range(12))
    assert [one["probability_false"] > 0.9 for one in record["stars"]] == [True] + [
        False
    ] * 11
    tree = xarray.open_datatree(out)
    assert tree.attrs["kind_of_data"] == "file"
    assert json.loads(tree.attrs["data"]) == record["data"]
    assert json.loads(tree.attrs["versions"]) == record["versions"]
    assert record["versions"]["emcee"] == version("emcee")


def test_false_stars_are_named_the_worst_first_and_the_rest_counted(tmp_path):
    """By their rows, from zero."""
    own = rp.posterior(
        "registration-mixture", written(tmp_path, *stars(wrong=8, count=40))
    )
    line = "8 of 40 stars are probably matched wrongly: row 0, 1, 2, 3, 4 and 3 more."
    assert line in " ".join(repr(own).split())
    assert line in own._repr_html_()
    assert line.removesuffix(".") == own.false_stars
    frame = own.stars()
    assert frame.columns.tolist() == ["row", "x", "y", "probability_false"]
    assert frame["row"].tolist() == list(range(40))
    likely = frame[frame["probability_false"] > 0.5].iloc[::-1]
    own.__dict__["_stars"] = likely.assign(probability_false=np.linspace(0.6, 0.9, 8))
    assert "8 of 8 stars are probably matched wrongly: row 0, 1, 2" in own.false_stars
    file = own.save(tmp_path / "p.csv")
    draws = pd.read_csv(file, comment="#")
    head = [one for one in file.read_text().splitlines() if one.startswith("# ")]
    assert [line.split(": ")[0] for line in head if line.split(": ")[0] in TOLD] == TOLD
    assert f"data {own.data_text}" in head[-1]
    pd.testing.assert_frame_equal(draws, own.draws)
    with pytest.raises(ValueError, match="path: "):
        own.save(tmp_path / "p.npz")


def test_honest_stars_fit_and_none_is_named(tmp_path):
    own = rp.posterior("registration-mixture", written(tmp_path, *stars(count=40)))
    assert own.false_stars == "0 of 40 stars are probably matched wrongly"
    assert own.record()["warnings"] == []
    assert "Warning" not in repr(own)


def test_what_the_data_are_is_said():
    found = rp.posterior("registration")
    data = found.data_record
    pivot = found.model.likelihood.pivot.tolist()
    known = {"kind": "simulated", "paper": "niu2024", "pivot": [pivot]}
    assert {key: data[key] for key in known} == known
    cells = load_inputs(posteriors()["registration"].inputs).cells
    lines = "".join(f"{address} {cells[address].text}\n" for address in sorted(cells))
    assert data["sha256"] == hashlib.sha256(lines.encode()).hexdigest()
    assert rp.posterior("misalignment").data_record["sha256"] != data["sha256"]
    frame = found.frame()
    for name in ("rotation", "shift-x", "shift-y", "noise"):
        off = abs(frame.loc[name, "mean"] - data["truth"][name])
        assert off < 4 * frame.loc[name, "deviation"]
