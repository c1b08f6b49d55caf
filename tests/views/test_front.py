"""The public API: its names, and the display, data and rerun of each object."""

import io
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from rich.console import Console

import reproduce as rp
from reproduce.judge import ledger
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.cli import main
from reproduce.views.computed import whole_ledger
from reproduce.views.measurements import platform_of

FOCAL = "chen2023/table-1#panchromatic-focal-length.value"
NOISE = "niu2024/text-simulation#noise"
SQUARE = np.array([[0.0, 0], [1000, 0], [0, 1000], [1000, 1000]])
STAR_COLUMNS = ["x", "y", "x_reference", "y_reference"]
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


def words(text):
    return " ".join(text.split())


def test_imports_are_lazy_and_names_stay_those_of_functions():
    """In a new process: the package, a fit of stars, then all subpackages."""
    command = [sys.executable, "-c", LOADED]
    found = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    assert found == [[], sorted(rp.__all__), [], []]
    with pytest.raises(AttributeError, match="tabel"):
        _ = rp.tabel


def test_every_table_displays_itself_and_returns_its_frame():
    for key in library():
        table, records = rp.table(key), whole_ledger().of(key)
        text = repr(table)
        assert key in text
        assert max(map(len, text.splitlines())) <= 80
        assert f'id="{key.replace("/", "-")}"' in table._repr_html_()
        columns = table.frame().reset_index().T.reset_index().T.to_numpy().ravel()
        verdicts = sorted(record.verdict for record in records)
        known = set(verdicts) | {"verdict"}
        shown = sorted(x for x in columns if x in known and x != "verdict")
        assert shown == verdicts, key
        assert list(table.cells()["cell"]) == [record.cell for record in records]


def test_a_cell_has_its_values_inputs_and_function():
    cell = rp.table("niu2024/table-2#scale.red")
    assert (cell.printed, cell.verdict) == ("0.9976", "exact")
    assert cell.computed == pytest.approx(0.9976, abs=5e-5)
    assert cell.inputs == rp.table("niu2024/table-2")["scale.red"].inputs
    assert cell.inputs[0] == "niu2024/table-1#focal-length.red"
    assert cell.inputs[0] in words(repr(cell))
    assert "def true_scale" in cell.source
    assert cell.frame().loc["verdict"].item() == "exact"
    drawn = words(repr(rp.table("niu2024/table-3#scale.red")))
    assert re.search(r"seed \d+ .*, \d+ .*; [\d,]+ replicates", drawn)
    with pytest.raises(ValueError, match=r"#noise: .*#scale.red"):
        cell.rerun({NOISE: "1 px"})
    table = rp.table("chen2023/table-5")
    other = "chen2023/table-2#telescope-focal-length.value"
    assert other in table.inputs
    assert other not in table["2.motion-x"].inputs
    with pytest.raises(ValueError, match=r"table-5#2\.motion-x"):
        table["2.motion-x"].rerun({other: "1 m"})


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
        assert "central 99 % of the prediction" in shown
        assert "noise = 0.2 px" in shown
        assert "seed = 7" in shown
        assert not re.search("differs|consistent|exact", shown)
    cell = rp.table("niu2024/table-3#scale.red").rerun(seed=7)
    assert list(cell.frame().index) == ["scale.red"]


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
    for shown in (repr(changed), changed._repr_html_()):
        assert re.search("= 7 m.*focal-ratio", words(shown))
    second = {"chen2023/table-4#100.misalignment-x": 3}
    assert [*changed.rerun(second).changes] == [FOCAL, *second]


def test_figures_have_data_and_are_rerun_and_saved(tmp_path):
    for key in ("niu2024/fig-4", "chen2023/fig-11a"):
        figure = rp.figure(key)
        assert np.isfinite(figure.data[["x", "y"]].to_numpy()).all()
        assert len(figure.data) > 10
        assert key in repr(figure)
        image = figure.save(tmp_path / "figure.png").read_bytes()
        assert image.startswith(b"\x89PNG")
    plain, high = rp.figure("niu2024/fig-4"), "niu2024/text-simulation#range-x-high"
    wider = plain.rerun({high: "10 deg"})
    assert high in plain.inputs
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
    "key": [lambda: rp.table(3), lambda: rp.figure(None)],
    "^seed: ": [lambda: rp.table("niu2024/table-3").rerun(seed="a")],
    NOISE: [lambda: rp.table("chen2023/heat").rerun({NOISE: "1 px"})],
    FOCAL: [lambda: rp.table("chen2023/heat").rerun({FOCAL: "1 px"})],
    "nothing": [lambda: rp.posterior("nothing")],
    "thin": [
        lambda: rp.posterior("registration", thin=2),
        lambda: rp.posterior("registration").rerun(thin=2),
    ],
    "^data: ": [lambda: rp.posterior("registration", data=SQUARE)],
    "^steps: ": [lambda: rp.posterior("registration", steps=0)],
    "^pivot: ": [lambda: rp.posterior("registration", pivot=(1.0, 1.0))],
    "^platform: ": [lambda: rp.posterior("misalignment", platform=object())],
    "modle": [
        lambda: rp.register(SQUARE, SQUARE, modle="rigid"),
        lambda: rp.register(SQUARE, SQUARE).rerun(modle="rigid"),
    ],
    "^source: ": [
        lambda: rp.register([], []),
        lambda: rp.register([SQUARE] * 2, [SQUARE] * 2),
    ],
    "^target: ": [lambda: rp.register(SQUARE)],
    "^radius: ": [lambda: rp.register(SQUARE, SQUARE, radius=3)],
    "niu2024, chen2023": [lambda: rp.audit("nobody1999")],
}


@pytest.mark.parametrize("name", REJECTED)
def test_wrong_arguments_are_named(name):
    for call in REJECTED[name]:
        with pytest.raises((ValueError, KeyError, TypeError), match=name):
            call()


def test_contents_and_check_count_the_whole_ledger(monkeypatch):
    frame = rp.contents().frame()
    assert list(frame.index) == list(catalogue())
    differs = [r for r in whole_ledger().records if r.verdict == "differs"]
    assert frame["differs"].sum() == len(differs)
    shown = repr(rp.contents("niu2024"))
    assert "niu2024/table-3" in shown
    assert "niu2024/scale-errors" in shown
    assert "chen2023" not in shown
    assert rp.check()
    assert rp.check().frame().empty
    cell, frozen = "niu2024/table-2#scale.red", ledger.frozen()
    wrong = frozen | {cell: frozen[cell].model_copy(update={"verdict": "differs"})}
    monkeypatch.setattr(ledger, "frozen", lambda: wrong)
    found = rp.check("niu2024/table-2")
    assert not found
    assert found.frame()["cell"].tolist() == [cell]


def test_a_posterior_is_sampled_on_first_use_and_rerun_with_a_seed():
    plain = rp.posterior("registration")
    assert "sampled" not in vars(plain), "no sampling yet"
    assert plain.inputs
    frame = plain.frame()
    assert list(frame.index)[:2] == list(plain.priors.index)[:2]
    assert len(plain.draws) == plain.sampled.draws.shape[0]
    assert "<svg" in plain.intervals()._repr_html_()
    assert (plain.rerun(seed=3).frame()["mean"] != frame["mean"]).all()


def images_of(design, angles, count=20, noise=0.02, seed=5):
    """Return images of the lights for a rotated camera: (count, lights, 2)."""
    angles = np.broadcast_to(np.asarray(angles) / ARCSEC_PER_RADIAN, (count, 3))
    spots = design.predicted(np.zeros((1, 3)), angles[None])[0]
    return spots + noise * np.random.default_rng(seed).normal(size=spots.shape)


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
        if hasattr(view, "cite"):
            assert "@misc" in view.cite()


# Measurements of a user: laser spots.


def spot_frame(zero, now, **columns):
    """Return both groups as a table, without lost spots."""
    rows = [
        {"group": group, "laser": laser, "x": x, "y": y, "frame": frame}
        for group, images in enumerate((zero, now))
        for frame, image in enumerate(images)
        for laser, (x, y) in enumerate(image, start=1)
        if np.isfinite([x, y]).all()
    ]
    return pd.DataFrame(rows).assign(**columns)


def test_the_platform_can_be_replaced_and_wrong_spots_are_named(lasers, tmp_path):
    now, zero = lasers
    plain = rp.misalignment(now, zero)
    longer = plain.rerun(platform=replace(plain.platform, tracker_focal_length=0.12))
    angles = [one.frame()["mean (arcsec)"]["X"] for one in (longer, plain)]
    ratio = plain.platform.tracker_focal_length / 0.12
    assert angles[0] / angles[1] == pytest.approx(ratio, rel=1e-3)
    assert longer.findings[0].kind == "scale"
    assert plain.findings == []
    path = tmp_path / "spots.csv"
    spot_frame(zero, now).drop(columns="frame").to_csv(path, index=False)
    np.testing.assert_allclose(rp.misalignment(path).angles, plain.angles, atol=1e-12)
    lost = np.where(np.arange(4)[:, None] == 2, np.inf, now)
    assert rp.misalignment(lost, zero).found.angles.shape == (20, 3)
    for argument, wrong in (
        ("zero", lambda: rp.misalignment(now)),
        ("zero", lambda: rp.misalignment(path, zero)),
        ("spots", lambda: rp.misalignment(now[:, :3], zero)),
        ("spots", lambda: rp.misalignment(now[None], zero)),
    ):
        with pytest.raises(ValueError, match=rf"^{argument}\b.*: expected"):
            wrong()


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
    low, high = rp.misalignment(now, zero, platform=toml).found.interval(0.999)
    truth = TURN / ARCSEC_PER_RADIAN
    assert ((low < truth) & (truth < high)).all()
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
    (finding,) = results[0].findings
    assert (finding.kind, "light 4" in finding.text) == ("displaced", True)
    remarks = results[0].remarks
    assert remarks[-1].startswith("5 of 200 spots are lost")
    posterior = rp.posterior("misalignment", data=path, platform=toml)
    assert set(remarks) <= set(posterior.remarks)
    options = ["--platform", str(toml)]
    run = CliRunner().invoke
    record = json.loads(
        run(main, ["misalignment", str(path), *options, "--json"]).stdout
    )
    piped = run(main, ["misalignment", "-", *options], path.read_text()).stdout
    assert record["remarks"] == remarks
    for result in results:
        assert result.remarks == remarks
        pd.testing.assert_frame_equal(result.frame(), results[0].frame())
    for shown in (repr(result), result._repr_html_(), piped):
        assert finding.text in words(shown)
    empty = results[0].images().isna().all(axis=1)
    assert empty.index[empty].tolist() == [10]


def test_wrong_tables_of_spots_name_row_and_column(lights):
    toml, zero, now = lights
    whole = spot_frame(zero, now).drop(columns="frame")
    lost, by_light = (
        whole.drop(index=110),
        whole.sort_values(["group", "laser"], kind="stable"),
    )
    expected = rp.misalignment(whole, platform=toml).angles
    np.testing.assert_array_equal(
        rp.misalignment(by_light, platform=toml).angles, expected
    )
    wrong = [(lost, "column frame")]
    wrong += [(whole.assign(frame=0), "each light once")]
    for name, value in (("group", 2), ("laser", 0), ("laser", 2.5)):
        changed = whole.assign(**{name: whole[name].where(whole.index != 3, value)})
        wrong.append((changed, f"row 3, column {name}"))
    for table, named in wrong:
        with pytest.raises(ValueError, match=named):
            rp.misalignment(table, platform=toml)


def test_a_wrong_platform_is_reported_in_one_line(tmp_path):
    platform, path = tmp_path / "platform.toml", tmp_path / "spots.csv"
    path.write_text("group,laser,x,y")
    for text, named in (
        ("lasers = [", "expected TOML"),
        ("lasers = [[0, 0], [1, 1]]", "of lasers, camera_focal_length, tracker_focal"),
        (TOML + "colour = 'red'", "of directions, tracker_focal_length"),
        (TOML.replace("5e-6", "5.0"), "pixel_pitch: expected metres"),
        (TOML.replace("[0.1, 0, 1]", "[0, 0, 1]"), "lights 1 and 2"),
        (f"a={'[' * 5000}{']' * 5000}", "expected TOML"),
    ):
        platform.write_text(text)
        command = ["misalignment", str(path), "--platform", str(platform), "--json"]
        result = CliRunner().invoke(main, command)
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
    rows = rows.drop(columns="frame").sample(frac=1, random_state=0)
    read = rp.misalignment(rows, platform=design)
    seen = np.isfinite(now).all(axis=-1).any(axis=1)
    assert read.images().index.name == "time"
    np.testing.assert_array_equal(read.images().index, times[seen])
    np.testing.assert_allclose(read.angles, found.angles[seen], atol=1e-12)


def test_the_covariance_of_an_image_is_that_of_draws():
    """With a lost light, and with a roll that is badly determined by two near lights."""
    places = [[120, 30], [-90, 160], [10, -140]]
    design = rp.Platform.of_spots(places, 0.05, 5e-6, (0, 0))
    draws = np.random.default_rng(3).normal(0, 0.02, (4400, 3, 2))
    zero, images = np.split(design.spots + draws, [400])
    images[2000:, 2] = np.nan
    found = rp.misalignment(images, zero, design)
    covariance, angles = found.covariance(), found.images().to_numpy()
    for rows in (slice(2000), slice(2000, None)):
        expected = covariance[rows].mean(axis=0)
        spread = np.outer(*2 * [np.sqrt(np.diag(expected))])
        ratio = np.cov(angles[rows].T) / spread
        # Four standard errors of variances and correlations of 2000.
        np.testing.assert_allclose(ratio, expected / spread, atol=0.13)


# Measurements of a user: stars.


@pytest.fixture(scope="module")
def stars():
    """Sixty stars that are displaced by three pixels."""
    generator = np.random.default_rng(1)
    source = generator.uniform(0, 1000, (60, 2))
    target = source - [3, 0] + 0.1 * generator.normal(size=(60, 2))
    return pd.DataFrame(np.hstack([source, target]), columns=STAR_COLUMNS)


def test_arrays_and_files_of_stars_and_the_command_give_the_same_fit(stars, tmp_path):
    moved = rp.register(SQUARE, np.add(SQUARE, [3, -2]), (0, 0), model="shift")
    np.testing.assert_allclose(moved.parameters, [-3, 2], atol=1e-9)
    path, rows = tmp_path / "stars.csv", stars.to_numpy()
    stars.to_csv(path, index=False)
    fit = rp.register(rows[:, :2], rows[:, 2:], (500, 400), model="rigid")
    file = rp.register(path, pivot=(500, 400), model="rigid")
    pd.testing.assert_frame_equal(file.frame(), fit.frame(), rtol=1e-9)
    assert file.frame()["unit"].tolist() == ["rad", "px", "px"]
    shift, deviation = fit.parameters[1], np.sqrt(fit.covariance[1, 1])
    decimals = 1 - int(np.floor(np.log10(deviation)))
    assert f"px {shift:.{decimals}f} ± {deviation:.{decimals}f} " in words(repr(fit))
    assert file.remarks == []
    command = ["register", str(path), "--pivot", "500", "400", "--model", "rigid"]
    shown = CliRunner().invoke(main, command).output
    assert words(shown) == words(repr(file))
    record = CliRunner().invoke(main, [*command, "--json"]).output
    assert json.loads(record) == file.record()
    path.write_text("x,y\n1,2\n")
    wrong = CliRunner().invoke(main, [*command, "--json"])
    assert wrong.exit_code == 2
    assert "x_reference" in json.loads(wrong.stdout)["error"]


def test_intervals_that_allow_a_term_are_those_of_its_model(stars):
    """To the accuracy of one step and of the quantiles."""
    fit = rp.register(stars, pivot=(500, 500))
    rich = fit.rerun(model="similarity+radial").interval()[:4]
    error = fit.standard_errors[:, None]
    np.testing.assert_allclose(
        (fit.interval(term="radial") - rich) / error, 0, atol=0.02
    )
    assert "if a radial term is possible" in words(repr(fit))
    with pytest.raises(ValueError, match=r"^term: .*radial, tilt, affine"):
        fit.interval(term="shear")


def test_all_types_of_input_have_the_same_wrong_matches(stars, tmp_path):
    path, wrong = tmp_path / "stars.csv", stars.copy()
    wrong.loc[[3, 9], STAR_COLUMNS[2:]] += np.array([[40, 0], [0, 60]])
    wrong.to_csv(path, index=False)
    rows = wrong.to_numpy()
    fits = [
        rp.register(wrong),
        rp.register(path),
        rp.register(rows[:, :2], rows[:, 2:]),
    ]
    (finding,) = fits[0].findings
    assert (finding.kind, finding.rows) == ("mismatched", (9, 3))
    for result in (*fits, rp.posterior("registration", str(path))):
        assert [*result.remarks] == [finding.text]
    robust, affine = fits[1].rerun(robust=True), fits[1].rerun(model="affine")
    for fit, kind in ((robust, "dropped"), (affine, "mismatched")):
        (found,) = (one for one in fit.findings if one.kind != "sensitive")
        assert (found.kind, {*found.rows}) == (kind, {3, 9})


def test_a_terminal_shows_no_html():
    for columns in (60, 80, 200):
        for key in ("chen2023/table-5", "niu2024/text-experiment"):
            stream = io.StringIO()
            Console(file=stream, width=columns).print(rp.table(key))
            assert not re.search(r"</?(a|code|small|br|span)\b", stream.getvalue())
