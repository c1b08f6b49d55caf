"""The public API: its names, and the display, data and rerun of each object."""

import json
import pickle
import re
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from commands import output_of, run, width, words
from numpy.testing import assert_allclose, assert_array_equal
from simulated import SHIFT, spot_frame, star_table

import reproduce as rp
from reproduce.judge.ledger import item_ledger
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed, platform_of
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN

FOCAL = "chen2023/table-1#panchromatic-focal-length.value"
NOISE = "niu2024/text-simulation#noise"
SQUARE = np.array([[0.0, 0], [1000, 0], [0, 1000], [1000, 1000]])
LOADED = """
import sys, json, importlib, pathlib, reproduce
def loaded(names): return [n for n in names.split() if n in sys.modules]
found = [loaded("numpy scipy pandas matplotlib emcee pint rich reproduce.views")]
found.append([name for name in dir(reproduce) if name[0] != "_"])
reproduce.register([[0, 0], [9, 0], [4, 5]], [[0, 1], [9, 1.1], [4, 6]])
found.append(loaded("pandas matplotlib emcee pydantic astropy photutils scipy.ndimage "
    "scipy.spatial reproduce.inference reproduce.papers reproduce.physics.attitude "
    "reproduce.views.pictures"))
for path in pathlib.Path(reproduce.__file__).parent.glob("*/__init__.py"):
    importlib.import_module("reproduce." + path.parent.name)
found.append([n for n in reproduce.__all__ if not callable(getattr(reproduce, n))])
print(json.dumps(found))
"""


def test_imports_are_lazy_and_names_stay_those_of_functions():
    """In a new process: the package, a fit of stars, then all subpackages."""
    found = json.loads(output_of(sys.executable, "-c", LOADED))
    assert found == [[], sorted(rp.__all__), [], []]
    with pytest.raises(AttributeError, match="tabel"):
        _ = rp.tabel


def test_every_table_displays_itself_and_returns_its_frame():
    for key in library():
        table, records = rp.table(key), item_ledger(key).records
        text = repr(table)
        assert key in text
        assert width(text) <= 80
        assert not re.search(r"</?(a|code|small|br|span)\b", text)
        columns = table.frame().reset_index().T.reset_index().T.to_numpy().ravel()
        verdicts = sorted(record.verdict for record in records)
        known = set(verdicts) | {"verdict"}
        shown = sorted(x for x in columns if x in known and x != "verdict")
        assert shown == verdicts, key


def test_a_cell_has_its_values_inputs_and_function():
    cell = rp.table("niu2024/table-2#scale.red")
    assert (cell.printed, cell.verdict) == ("0.9976", "exact")
    assert cell.computed == pytest.approx(0.9976, abs=5e-5)
    assert cell.inputs == rp.table("niu2024/table-2")["scale.red"].inputs
    assert cell.inputs[0] == "niu2024/table-1#focal-length.red"
    assert cell.inputs[0] in words(repr(cell))
    assert "def true_scale" in cell.source
    assert cell.frame().loc["verdict"].item() == "exact"
    with pytest.raises(ValueError, match=r"#noise: .*#scale.red"):
        cell.rerun({NOISE: "1 px"})
    dash = rp.table("niu2024/table-4#scale.green")
    assert (dash.source, dash.inputs) == ("", ())
    assert "scale_factors" not in repr(dash)


def test_readers_see_a_minus_sign_and_programs_a_hyphen():
    table = rp.table("niu2024/table-3")
    changed = table.rerun({NOISE: "0.2 px"}, replicates=20)
    for view in (table, changed, table["rotation.blue"]):
        html = re.sub(r"<[^>]*>", " ", view._repr_html_().split("<pre")[0])
        for shown in (repr(view), html):
            assert "−0.0" in shown
            assert not re.search(r"(?<!\w)-\.?\d", shown)
    assert "$-$0.05" in table.export("latex")
    for form in ("csv", "json", "markdown"):
        text = re.sub(r'"(why|reason)":.*', "", table.export(form))
        assert "-0.05" in text
        assert "−" not in text


def test_a_rerun_shows_the_difference_from_the_paper_and_no_verdict():
    changed = rp.table("niu2024/table-3").rerun({NOISE: "0.2 px"}, seed=7)
    row = changed.frame().loc["scale.red"]
    assert row["printed"] == "0.9973"
    assert row["changed - printed"] == row["changed"] - 0.9973
    assert row["low"] < row["changed"] < row["high"]
    for shown in (words(repr(changed)), words(changed._repr_html_())):
        assert "central 99 % of a prediction, or" in shown
        assert "noise = 0.2 px" in shown
        assert "seed = 7" in shown
        assert not re.search("differs|consistent|exact", shown)
    cell = rp.table("niu2024/table-3#scale.red").rerun(seed=7)
    assert list(cell.frame().index) == ["scale.red"]


def test_a_reading_names_the_intervals_of_numbers_that_are_not_predicted():
    found = rp.table("niu2024/text-optics").rerun(centre="third")
    assert "what rounded inputs allow" in words(repr(found))


def test_a_supplementary_table_is_rerun_with_a_changed_input():
    """At half the focal length 1 µm is twice the angle; the bench has another length."""
    heat = rp.table("chen2023/heat")
    changed = heat.rerun({FOCAL: "7 m"})
    column = "angle for 1 µm of all lasers (arcsec)"
    before, after = (t.frame().set_index("Instrument")[column] for t in (heat, changed))
    assert after["flight, as printed"] == pytest.approx(1e-6 / 7.0 * ARCSEC_PER_RADIAN)
    assert after["ground platform"] == before["ground platform"]
    # The printed ratio of focal lengths is recomputed.
    ratio = {"chen2023/text-satellite#focal-ratio": pytest.approx(7.0 / 0.06)}
    assert (changed.changes, changed.replaced) == ({FOCAL: "7 m"}, ratio)
    assert (heat.changes, heat.replaced) == ({}, {})
    assert re.search("= 7 m.*focal-ratio", words(repr(changed)))


def test_data_of_figures_have_the_ends_of_error_bars_and_the_points_of_labels():
    """Bars of an interval are drawn around 1; a label is next to its point."""
    bars = rp.figure("chen2023/table-4").data.query("curve == 'curve 9' and panel == 1")
    assert set(bars["y"] > 1) == {True, False}
    assert set(bars["x"]) == set(np.array([1, 4, 16, 25, 49, 100]) * 0.92)
    states = rp.figure("chen2023/fig-10a").data
    labelled = states[states["curve"] == "state 1"]
    assert labelled["x"].item() == pytest.approx(states["x"][0], abs=5)
    across = rp.figure("niu2024/drawing-laboratory").data.query("curve == 'one pixel'")
    assert across["y"].min() < -3


def test_figures_have_data_and_are_rerun():
    plain, high = rp.figure("niu2024/fig-4"), "niu2024/text-simulation#range-x-high"
    wider = plain.rerun({high: "10 deg"})
    assert high in plain.inputs
    assert np.isfinite(plain.data[["x", "y"]].to_numpy()).all()
    frame = wider.data[wider.data["curve"] == "printed range"]
    assert frame["x"].max() == pytest.approx((10 + 8) / 2), "half the range"
    assert "10 deg" in repr(wider)
    with pytest.raises(ValueError, match="nothing#x"):
        plain.rerun({"nothing#x": "1"})


REJECTED = {
    "niu2024/table-3": [
        lambda: rp.table("niu2024/tabel-3"),
        lambda: rp.figure("niu2024/table-3"),
    ],
    r"scale\.green": [lambda: rp.table("niu2024/table-3#scale.green")],
    r"figure\('niu2024/fig-4'\)": [lambda: rp.table("niu2024/fig-4")],
    "^seed: ": [lambda: rp.table("niu2024/table-3").rerun(seed="a")],
    NOISE: [lambda: rp.table("chen2023/heat").rerun({NOISE: "1 px"})],
    FOCAL: [lambda: rp.table("chen2023/heat").rerun({FOCAL: "1 px"})],
    "nothing": [lambda: rp.posterior("nothing")],
    "thin": [lambda: rp.posterior("registration").rerun(thin=2)],
    "^data: ": [lambda: rp.posterior("registration", data=SQUARE)],
    "^priors: ": [
        lambda: rp.posterior("registration", priors=[1]),
        lambda: rp.posterior("registration").rerun(priors=[1]),
        lambda: rp.posterior("registration", priors={1: (0, 1)}),
    ],
    "^steps: ": [lambda: rp.posterior("registration", steps=0)],
    "^pivot: ": [lambda: rp.posterior("registration", pivot=(1.0, 1.0))],
    "^platform: ": [lambda: rp.posterior("misalignment", platform=object())],
    "modle": [lambda: rp.register(SQUARE, SQUARE).rerun(modle="rigid")],
    "^source: ": [lambda: rp.register([SQUARE] * 2, [SQUARE] * 2)],
    "^target: ": [
        lambda: rp.register(SQUARE),
        lambda: rp.register(np.eye(20)),
        lambda: rp.register(SQUARE, SQUARE).rerun(source=np.eye(20), target=None),
    ],
    "^weights: ": [lambda: rp.register(SQUARE, SQUARE, weights=np.ones((2, 4)))],
    "^level: ": [lambda: rp.register(SQUARE, SQUARE).interval([0.5, 0.9])],
    "^radius: ": [lambda: rp.register(SQUARE, SQUARE).rerun(radius=3)],
    "niu2024, chen2023": [lambda: rp.audit("nobody1999")],
}


@pytest.mark.parametrize("name", REJECTED)
def test_wrong_arguments_are_named(name):
    for call in REJECTED[name]:
        with pytest.raises((ValueError, KeyError, TypeError), match=name):
            call()


def test_a_posterior_is_sampled_on_first_use_and_rerun_with_a_seed():
    plain = rp.posterior("registration")
    assert "sampled" not in vars(plain), "no sampling yet"
    assert plain.inputs
    assert len(plain.draws) == plain.sampled.draws.shape[0]
    one, other = (
        plain.rerun(seed=seed, steps=280, walkers=80).frame()["mean"] for seed in (3, 4)
    )
    assert (one != other).all()


def images_of(design, angles, count=20, seed=5):
    """Return images of the lights for a rotated camera: (count, lights, 2)."""
    angles = np.broadcast_to(np.asarray(angles) / ARCSEC_PER_RADIAN, (count, 3))
    spots = design.predicted(angles)
    return spots + 0.02 * np.random.default_rng(seed).normal(size=spots.shape)


@pytest.fixture(scope="module")
def lasers():
    """Images of the four lasers after and before a rotation by (20, -20, 0) arcsec."""
    design = as_designed(load_inputs(INSTRUMENT))
    return images_of(design, [20, -20, 0]), images_of(design, [0, 0, 0])


def test_every_object_has_the_same_methods(lasers):
    for view in (
        rp.table("niu2024/table-2"),
        rp.table("niu2024/table-2#scale.red"),
        rp.figure("niu2024/fig-4"),
        rp.figure("chen2023/fig-11"),
        rp.posterior("registration"),
        rp.register([[0, 0], [9, 0], [0, 9]], [[1, 0], [10, 0], [1, 9]]),
        rp.misalignment(*lasers),
    ):
        assert repr(view)
        assert "<" in view._repr_html_()
        assert len(view.frame())
        assert "def " in view.source
        assert isinstance(view.inputs, tuple)
        assert callable(view.rerun)
        assert view.export("csv").count("\n") > 1
        assert repr(pickle.loads(pickle.dumps(view))) == repr(view)
        if hasattr(view, "cite"):
            assert "@misc" in view.cite()


# Measurements of a user: laser spots.


def test_the_platform_can_be_replaced_and_wrong_spots_are_named(lasers):
    now, zero = lasers
    plain = rp.misalignment(now, zero)
    longer = plain.rerun(platform=replace(plain.platform, tracker_focal_length=0.12))
    angles = [one.frame()["mean (arcsec)"]["X"] for one in (longer, plain)]
    ratio = plain.platform.tracker_focal_length / 0.12
    assert angles[0] / angles[1] == pytest.approx(ratio, rel=1e-3)
    deviation = np.sqrt(np.diagonal(plain.covariance().mean(axis=0)))
    scatter = plain.frame()["scatter (arcsec)"].to_numpy()
    # The scatter of 20 images is known to 1 / sqrt(38).
    assert_allclose(deviation, scatter, rtol=4 / np.sqrt(38))
    lost = np.where(np.arange(4)[:, None] == 2, np.inf, now)
    assert rp.misalignment(lost, zero).found.angles.shape == (20, 3)
    rows = spot_frame(zero, now).drop(columns="frame")
    pd.testing.assert_frame_equal(rp.misalignment(rows).images(), plain.images())
    for argument, *wrong in (
        ("zero", now),
        ("zero", "spots.csv", zero),
        ("spots", now[:, :3], zero),
        ("spots", now[None], zero),
        ("platform", now, zero, now),
    ):
        with pytest.raises(ValueError, match=rf"^{argument}\b.*: expected"):
            rp.misalignment(*wrong)


TOML = """
directions = [[0, 0, 1], [0.1, 0, 1], [0, 0.07, 1], [-0.05, -0.06, 1], [0.03, 0.02, 1]]
tracker_focal_length = 0.05
pixel_pitch = 5e-6
principal_point = [1000, 1000]
"""


@pytest.fixture
def lights(tmp_path):
    """Return the file of a platform with five lights, and images before and after a rotation."""
    path = tmp_path / "platform.toml"
    path.write_text(TOML)
    design = platform_of(path)
    zero, now = (images_of(design, a, seed=i) for i, a in enumerate(([0] * 3, TURN)))
    return path, zero, now


TURN = np.array([15, -25, 40])


def test_all_types_of_input_give_the_same_angles_and_warnings(lights, tmp_path):
    """One light displaced, spots lost, one image of one light."""
    toml, zero, now = lights
    now[:, 3] += [3, 0]
    now[6, 2] = now[9, 1:] = np.nan
    frame, path = spot_frame(zero, now), tmp_path / "spots.csv"
    frame.to_csv(path, index=False)
    results = [
        rp.misalignment(now, zero, platform=toml),
        rp.misalignment(np.ma.masked_invalid(now), zero, platform=platform_of(toml)),
        rp.misalignment(path, platform=toml),
        rp.misalignment(frame.sample(frac=1, random_state=1), platform=toml),
    ]
    finding, lost = results[0].findings
    assert lost.kind == "lost"
    assert (finding.kind, "light 4" in finding.text) == ("displaced", True)
    remarks = results[0].remarks
    assert remarks[-1].startswith("5 of 200 spots are lost")
    posterior = rp.posterior("misalignment", data=path, platform=toml)
    omitted = "2 images that lack a spot are omitted"
    assert posterior.remarks == [*remarks[:-1], omitted]
    command = ["misalignment", "-", "--platform", toml]
    piped = run(command, input=path.read_text()).stdout
    for result in results:
        assert result.remarks == remarks
        pd.testing.assert_frame_equal(result.frame(), results[0].frame())
    for shown in (repr(result), result._repr_html_(), piped):
        assert finding.text in words(shown)
    whole = np.ma.masked_equal(np.nan_to_num(now).astype(int), 0)
    mixed = [image if image.mask.any() else image.data for image in whole]
    assert rp.misalignment(mixed, zero, platform=toml).remarks[-1] == remarks[-1]
    empty = results[0].images().isna().all(axis=1)
    assert empty.index[empty].tolist() == [10]


def test_a_wrong_platform_is_reported_in_one_line(tmp_path):
    platform, path = tmp_path / "platform.toml", tmp_path / "spots.csv"
    path.write_text("group,laser,x,y")
    for text, named in (
        ("lasers = [", "a TOML file of"),
        (TOML + "colour = 'red'", "unexpected keyword argument 'colour'"),
        (TOML.replace("5e-6", "5.0"), "pixel_pitch: expected metres"),
        (TOML.replace("[0.1, 0, 1]", "[0, 0, 1]"), "lights 1 and 2"),
        (f"a={'[' * 5000}{']' * 5000}", "a TOML file of"),
        (
            TOML.replace("dir", "spots=[[1, 2]]\n#").replace("5e-6", "9" * 400),
            "pixel_pitch",
        ),
        # Editors of Windows write this mark.
        ("\ufeff" + TOML, "at least one row"),
    ):
        platform.write_text(text, encoding="utf-8")
        result = run(["misalignment", path, "--platform", platform, "--json"])
        assert result.exit_code == 2
        assert named in json.loads(result.stdout)["error"]


def test_times_of_a_table_are_the_index_of_its_images():
    """Two lights, some spots lost; a table has no empty image."""
    design = rp.Platform.of_spots([[120, 30], [-90, 160]], 0.05, 5e-6, (0, 0))
    times = 10 + 0.5 * np.arange(64)
    now = images_of(design, times[:, None] * [4.0, -6.0, 0.0], 64, seed=6)
    zero = images_of(design, [0, 0, 0], 10, seed=7)
    now[3, 0] = now[8] = np.nan
    found = rp.misalignment(now, zero, design)
    rows = spot_frame(zero, now)
    rows["time"] = np.where(rows["group"], times[rows["frame"]], rows["frame"])
    rows = rows.assign(frame=rows["frame"] ** 2).sample(frac=1, random_state=0)
    read = rp.misalignment(rows.drop(columns="frame"), platform=design)
    seen = np.isfinite(now).all(axis=-1).any(axis=1)
    assert read.images().index.name == "time"
    assert_array_equal(read.images().index, times[seen])
    assert_allclose(read.angles, found.angles[seen], atol=1e-12)
    # A drift depends on the times of the images without a lost spot.
    posterior = rp.posterior("misalignment-drift", rows, platform=design)
    centre, spread = posterior.model.likelihood.start()
    left = times[np.isfinite(now).all(axis=(1, 2))]
    moved = np.outer([left.mean(), np.ptp(left)], [4, -6, 0]) / ARCSEC_PER_RADIAN
    assert np.abs((centre[3:9] - moved.ravel()) / spread[3:9]).max() < 4
    assert abs(centre[-1] - 0.02) < 4 * spread[-1]


# Measurements of a user: stars.


def test_all_types_of_stars_and_the_command_give_the_same_fit(tmp_path):
    """Two stars are matched wrongly."""
    path, stars = tmp_path / "stars.csv", star_table(truth=SHIFT)
    stars.loc[[3, 9], ["x_reference", "y_reference"]] += np.array([[40, 0], [0, 60]])
    stars.to_csv(path, index=False)
    rows, pivot = stars.to_numpy(), (500, 400)
    file = rp.register(path, pivot=pivot, model="rigid")
    for data in ((stars,), (rows[:, :2], rows[:, 2:])):
        fit = rp.register(*data, pivot=pivot, model="rigid")
        pd.testing.assert_frame_equal(fit.frame(), file.frame(), rtol=1e-9)
        assert fit.remarks == file.remarks
    (finding,) = file.findings
    assert (finding.kind, finding.rows) == ("mismatched", (9, 3))
    assert [*rp.posterior("registration", path).remarks] == [finding.text]
    (found,) = file.rerun(robust=True).findings
    assert (found.kind, {*found.rows}) == ("dropped", {3, 9})
    command = ["register", path, "--pivot", *pivot, "--model", "rigid"]
    assert words(run(command).output) == words(repr(file))
    record = run([*command, "--json"]).output
    assert json.loads(record) == json.loads(json.dumps(file.record()))


def test_intervals_that_allow_a_term_are_those_of_its_model():
    """To the accuracy of one step, also if one degree of freedom is left."""
    stars = star_table(truth=SHIFT)
    for model, term, richer in (
        ("shift", "rotation", "rigid"),
        ("rigid", "scale", "similarity"),
    ):
        for count in (3, 60):
            fit = rp.register(stars.head(count), model=model)
            change = fit.interval(term=term) - fit.rerun(model=richer).interval()[1:]
            assert_allclose(change / fit.standard_errors[:, None], 0, atol=1e-3)
    assert "term is possible" in words(repr(rp.register(stars)))
    halved = rp.register(stars.assign(flux=range(len(stars))))
    for term in ("shear", ["radial"], "bright - faint"):
        with pytest.raises(ValueError, match=r"^term: .*radial, tilt, affine, got"):
            halved.interval(term=term)
