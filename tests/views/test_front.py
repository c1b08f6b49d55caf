"""The front door: every name, and what each object shows."""

import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from rich.console import Console

import reproduce
import reproduce as rp
from reproduce.judge.ledger import build
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.physics.attitude import monitored
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.cli import main
from reproduce.views.measurements import platform_of

FOCAL = "chen2023/table-1#panchromatic-focal-length.value"
SQUARE = np.array([[0.0, 0], [1000, 0], [0, 1000], [1000, 1000]])
STAR_COLUMNS = "x,y,x_reference,y_reference"
STRANGER = "niu2024/text-simulation#noise"
ROOMS = [
    path.parent.name for path in Path(reproduce.__file__).parent.glob("*/__init__.py")
]


def fresh(code):
    """Run code in a fresh interpreter and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_no_name_is_the_name_of_a_room():
    """Importing a room would overwrite the name."""
    assert ROOMS
    assert not set(rp.__all__) & set(ROOMS)
    told = fresh(
        "import importlib, reproduce\n"
        f"for room in {ROOMS}: importlib.import_module('reproduce.' + room)\n"
        "print(all(callable(getattr(reproduce, name)) for name in reproduce.__all__))"
    )
    assert told == "True"


def test_importing_the_package_imports_nothing_else():
    heavy = "numpy scipy pandas matplotlib emcee pint rich reproduce.views".split()
    told = fresh(
        f"import sys, reproduce; print([n for n in {heavy} if n in sys.modules])"
    )
    assert told == "[]"


def test_a_fit_of_stars_loads_no_paper_and_no_attitude():
    heavy = "pandas matplotlib emcee pydantic reproduce.inference reproduce.papers"
    told = fresh(
        "import sys, reproduce\n"
        "source = [[0, 0], [100, 0], [0, 100], [100, 100]]\n"
        "target = [[0.3, -0.2], [100.4, -0.1], [0.2, 99.9], [100.3, 99.8]]\n"
        "reproduce.register(source, target)\n"
        f"heavy = {[*heavy.split(), 'reproduce.physics.attitude']}\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    assert told == "[]"


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match="has no attribute 'tabel'"):
        _ = rp.tabel
    assert fresh(
        "print([n for n in dir(__import__('reproduce')) if n[0] != '_'])"
    ) == str(sorted(rp.__all__))


@pytest.mark.parametrize("key", list(library()))
def test_every_table_shows_itself_and_gives_its_frame(key):
    table = rp.table(key)
    assert key in repr(table)
    assert max(map(len, repr(table).splitlines())) <= 80
    assert f'id="{key.replace("/", "-")}"' in table._repr_html_()
    frame, records = table.frame(), build([key]).of(key)
    verdicts = (
        frame.filter(regex="verdict")
        if frame.columns.nlevels == 1
        else frame.xs("verdict", axis=1, level=1)
    )
    assert sorted(verdicts.to_numpy().ravel()) == sorted(
        record.verdict for record in records
    )
    assert list(table.cells()["cell"]) == [record.cell for record in records]


def test_a_cell_tells_all_that_is_known_of_it():
    cell = rp.table("niu2024/table-2#scale.red")
    assert (cell.printed, cell.verdict) == ("0.9976", "exact")
    assert cell.computed == pytest.approx(0.9976, abs=5e-5)
    assert cell.inputs == rp.table("niu2024/table-2")["scale.red"].inputs
    with pytest.raises(ValueError, match=r"#noise: expected .*#scale.red"):
        cell.rerun({STRANGER: "1 px"})
    table, other = (
        rp.table("chen2023/table-5"),
        "chen2023/table-2#telescope-focal-length.value",
    )
    assert other in table.inputs
    assert other not in table["2.motion-x"].inputs
    with pytest.raises(ValueError, match=r"expected .*table-5#2\.motion-x"):
        table["2.motion-x"].rerun({other: "1 m"})
    assert "def true_scale" in cell.source
    shown = " ".join(repr(cell).split())
    assert "inputs niu2024/table-1#focal-length.red, niu2024/table-1#" in shown
    drawn = " ".join(repr(rp.table("niu2024/table-3#scale.red")).split())
    assert re.search(
        r"seed \d+ of the project, \d+ of this function; [\d,]+ replicates", drawn
    )
    assert "<table" in cell._repr_html_()
    assert cell.frame().loc["verdict"].item() == "exact"


def test_readers_see_a_minus_sign_and_other_programs_a_hyphen():
    table = rp.table("niu2024/table-3")
    changed = table.rerun({STRANGER: "0.2 px"}, replicates=20)
    cell = table["rotation.blue"]
    for one in (table, changed, cell):
        for shown in (
            repr(one),
            re.sub(r"<[^>]*>", " ", one._repr_html_().split("<pre")[0]),
        ):
            assert re.search(r"−0\.0", shown)
            assert not re.search(r"(?<!\w)-\.?\d", shown)
    assert "$-$0.05" in table.export("latex")
    for form in ("csv", "json", "markdown"):
        assert "-0.05" in table.export(form)
        assert "−" not in re.sub(r'"(why|reason)":.*', "", table.export(form))


def test_rerun_shows_print_value_and_difference_without_a_verdict():
    found = rp.table("niu2024/table-3").rerun(
        {"niu2024/text-simulation#noise": "0.2 px"}, seed=7
    )
    row = found.frame().loc["scale.red"]
    assert row["printed"] == "0.9973"
    assert row["changed - printed"] == row["changed"] - 0.9973
    assert row["low"] < row["changed"] < row["high"]
    for shown in (repr(found), found._repr_html_()):
        assert "From and to: the central 99 % of the prediction." in " ".join(
            shown.split()
        )
        assert "noise = 0.2 px" in shown
        assert "seed = 7" in shown
        for verdict in ("differs", "consistent", "exact"):
            assert verdict not in shown
    alone = rp.table("niu2024/table-3#scale.red").rerun(seed=7)
    assert list(alone.frame().index) == ["scale.red"]


def test_a_study_is_computed_again_under_a_change():
    """A micrometre at half the focal length is twice the angle; the bench keeps its own."""
    heat = rp.table("chen2023/heat")
    changed = heat.rerun({FOCAL: "7 m"})
    angle = "angle for 1 µm of all lasers (arcsec)"
    before, after = (
        table.frame().set_index("Instrument")[angle] for table in (heat, changed)
    )
    flight, bench = "flight, as printed", "ground platform"
    assert after[flight] == pytest.approx(1e-6 / 7.0 * ARCSEC_PER_RADIAN)
    assert after[flight] == pytest.approx(2 * before[flight])
    assert after[bench] == before[bench]
    # The printed ratio of focal lengths follows its recomputed one.
    assert changed.changes == {FOCAL: "7 m"}
    assert changed.replaced == {
        "chen2023/text-satellite#focal-ratio": pytest.approx(7.0 / 0.06)
    }
    assert (heat.changes, heat.replaced) == ({}, {})
    for shown in (repr(changed), changed._repr_html_()):
        assert "= 7 m" in " ".join(shown.split())
        assert "focal-ratio" in shown
    both = changed.rerun({"chen2023/table-4#100.misalignment-x": 3})
    assert list(both.changes) == [FOCAL, "chen2023/table-4#100.misalignment-x"]


@pytest.mark.parametrize("key", ["niu2024/fig-4", "chen2023/fig-11a"])
def test_a_figure_gives_its_data_and_saves_itself(key, tmp_path):
    figure = rp.figure(key)
    assert isinstance(figure.data, pd.DataFrame)
    assert np.isfinite(figure.data[["x", "y"]].to_numpy()).all()
    assert len(figure.data) > 10
    assert "<svg" in figure._repr_html_()
    assert key in repr(figure)
    path = figure.save(tmp_path / "figure.png")
    assert matplotlib.image.imread(path).size


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rp.table("niu2024/tabel-3"), "such as niu2024/table-3"),
        (lambda: rp.table("niu2024/table-3#scale.green"), r"scale\.green"),
        (lambda: rp.table("niu2024/fig-4"), r"figure\('niu2024/fig-4'\)"),
        (lambda: rp.table(3), "^key: "),
        (lambda: rp.table("niu2024/table-3").rerun(seed="a"), "^seed: "),
        (lambda: rp.table("niu2024/table-3").sweep(STRANGER, "0.2 px"), "expected"),
        (lambda: rp.figure("niu2024/table-3"), "has no figure"),
        (lambda: rp.figure(None), "^key: "),
        (
            lambda: rp.table("chen2023/heat").rerun({STRANGER: "1 px"}),
            "expected an input",
        ),
        (lambda: rp.table("chen2023/heat").rerun({FOCAL: "1 px"}), "expected m as"),
        (lambda: rp.posterior("nothing"), "nothing"),
        (lambda: rp.posterior("registration", thin=2), "thin"),
        (lambda: rp.posterior("registration").rerun(thin=2), "^thin: "),
        (lambda: rp.posterior("registration", data=SQUARE), "^data: "),
        (lambda: rp.posterior("registration", steps=0), "^steps: "),
        (lambda: rp.register(SQUARE, SQUARE, modle="rigid"), "modle"),
        (lambda: rp.register(SQUARE, SQUARE).rerun(modle="rigid"), "modle"),
        (lambda: rp.register([], []), "^source: expected shape"),
        (lambda: rp.register(SQUARE), "^target: "),
        (lambda: rp.register(SQUARE, SQUARE, radius=3), "^radius: "),
        (lambda: rp.register([SQUARE] * 2, [SQUARE] * 2), "^source: expected shape"),
        (lambda: rp.audit("nobody1999"), "niu2024, chen2023"),
    ],
)
def test_slips_are_told(call, message):
    with pytest.raises((ValueError, KeyError, TypeError), match=message):
        call()


def test_contents_and_check_stand_on_the_whole_ledger():
    frame = rp.contents().frame()
    assert list(frame.index) == list(catalogue())
    assert frame["differs"].sum() == sum(
        r.verdict == "differs" for r in build().records
    )
    shown = repr(rp.contents("niu2024"))
    assert "niu2024/table-3" in shown
    assert "niu2024/scale-errors" in shown
    assert "chen2023" not in shown
    found = rp.check()
    assert bool(found)
    assert found.frame().empty
    assert "as frozen" in repr(found)


def test_a_verdict_that_is_not_frozen_makes_the_check_false(monkeypatch):
    from reproduce.judge import ledger

    other = {
        "niu2024/table-2#scale.red": ledger.Expectation(
            verdict="differs", reason="made up"
        )
    }
    real = ledger.frozen
    monkeypatch.setattr(ledger, "frozen", lambda: real() | other)
    found = rp.check("niu2024/table-2")
    assert not found
    assert "expected differs, found exact" in repr(found)
    assert found.frame()["cell"].tolist() == ["niu2024/table-2#scale.red"]


def test_a_posterior_is_sampled_when_looked_at_and_rerun_with_a_change():
    plain = rp.posterior("registration")
    assert "sampled" not in vars(plain), "nothing is sampled yet"
    assert plain.inputs
    assert list(plain.frame().index)[:2] == list(plain.priors.index)[:2]
    assert len(plain.draws) == plain.sampled.draws.shape[0]
    assert "simulated by us" in repr(plain)
    assert "<svg" in plain.corner()._repr_html_()
    other = plain.rerun(seed=3)
    assert (other.frame()["mean"] != plain.frame()["mean"]).all()


def written_stars(path):
    """Write sixty stars, moved by three pixels."""
    generator = np.random.default_rng(1)
    source = generator.uniform(0, 1000, (60, 2))
    rows = np.column_stack(
        [source, source - [3, 0] + 0.1 * generator.normal(size=(60, 2))]
    )
    np.savetxt(path, rows, delimiter=",", header=STAR_COLUMNS, comments="")
    return rows


def spots(turn):
    """Twenty images of the four lasers for a camera turned by so many arc seconds."""
    design = as_designed(load_inputs(INSTRUMENT))
    angles = np.array(turn)[None, None] / ARCSEC_PER_RADIAN
    at = design.predicted(np.zeros((1, 3)), angles)[0, 0]
    return at + 0.02 * np.random.default_rng(5).normal(size=(20, *at.shape))


@pytest.mark.parametrize(
    "make",
    [
        lambda: rp.table("niu2024/table-2"),
        lambda: rp.table("niu2024/table-2#scale.red"),
        lambda: rp.figure("niu2024/fig-4"),
        lambda: rp.posterior("registration"),
        lambda: rp.register([[0, 0], [9, 0], [0, 9]], [[1, 0], [10, 0], [1, 9]]),
        lambda: rp.misalignment(spots([20, 0, 0]), spots([0, 0, 0])),
    ],
    ids=["table", "cell", "figure", "posterior", "stars", "lasers"],
)
def test_every_object_has_the_same_verbs(make):
    one = make()
    assert repr(one)
    assert "<" in one._repr_html_()
    assert len(one.frame())
    assert "def " in one.source
    assert isinstance(one.inputs, tuple)
    assert callable(one.rerun)
    assert one.export("csv").count("\n") > 1
    if hasattr(one, "cite"):
        assert "@misc" in one.cite()


def test_a_figure_is_computed_and_drawn_again():
    address = "niu2024/text-simulation#range-x-high"
    plain = rp.figure("niu2024/fig-4")
    wider = plain.rerun({address: "10 deg"})
    assert address in plain.inputs
    frame = wider.data[wider.data["curve"] == "printed range"]
    assert frame["x"].max() == pytest.approx((10 + 8) / 2), (
        "half the range, laid about zero"
    )
    assert "10 deg" in repr(wider)
    with pytest.raises(ValueError, match="nothing#x: expected"):
        plain.rerun({"nothing#x": "1"})


def written_spots(path, images, frames=False):
    """Write both groups as a user would, lost spots left out."""
    rows = [
        (group, laser, *spot, frame)[: 5 if frames else 4]
        for group, one in enumerate(images)
        for frame, image in enumerate(one)
        for laser, spot in enumerate(image, start=1)
        if np.isfinite(spot).all()
    ]
    head = "group,laser,x,y" + ",frame" * frames
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.17g")
    return path


def test_lasers_of_ones_own_may_stand_before_another_instrument(tmp_path):
    now, zero = spots([20, -20, 0]), spots([0, 0, 0])
    plain = rp.misalignment(now, zero)
    longer = plain.rerun(platform=replace(plain.platform, tracker_focal_length=0.12))
    first, second = (one.frame()["mean (arcsec)"]["X"] for one in (longer, plain))
    ratio = plain.platform.tracker_focal_length / 0.12
    assert first / second == pytest.approx(ratio, rel=1e-3)
    assert longer.findings[0].kind == "scale"
    assert plain.findings == []
    path = written_spots(tmp_path / "spots.csv", (zero, now))
    np.testing.assert_allclose(rp.misalignment(path).angles, plain.angles, atol=1e-12)
    infinite = np.where(np.arange(4)[:, None] == 2, np.inf, now)
    assert rp.misalignment(infinite, zero).found.angles.shape == (20, 3)
    for argument, wrong in (
        ("zero", lambda: rp.misalignment(now)),
        ("zero", lambda: rp.misalignment(path, zero)),
        ("spots", lambda: rp.misalignment(now[:, :3], zero)),
        ("spots", lambda: rp.misalignment(now[None], zero)),
        ("times", lambda: rp.misalignment(now, zero, times=np.arange(19))),
        ("times", lambda: rp.misalignment(now, zero, times=[np.nan] * 20)),
        ("platform", lambda: rp.posterior("misalignment", platform=plain.platform)),
    ):
        with pytest.raises(ValueError, match=f"^{argument}: expected"):
            wrong()


TOML = """
directions = [[0, 0, 1], [0.1, 0, 1], [0, 0.07, 1], [-0.05, -0.06, 1], [0.03, 0.02, 1]]
tracker_focal_length = 0.05
pixel_pitch = 5e-6
principal_point = [1000, 1000]
"""


def measured_lights(tmp_path, displaced):
    """Five lights of a user's own, some spots lost, one light displaced since the zero point."""
    (tmp_path / "platform.toml").write_text(TOML)
    design = platform_of(tmp_path / "platform.toml")
    generator, images = np.random.default_rng(4), []
    for turn in ((0, 0, 0), (15, -25, 40)):
        angles = np.array([[turn]]) / ARCSEC_PER_RADIAN
        at = design.predicted(np.zeros((1, 3)), angles)[0, 0]
        images.append(at + generator.normal(0, 0.02, (20, *at.shape)))
    images[1][:, 3] += displaced
    images[1][6, 2] = np.nan
    images[1][9, 1:] = np.nan
    return tmp_path / "platform.toml", images


def test_arrays_frames_files_and_commands_hear_the_same(tmp_path):
    """A light displaced, spots lost, an image of one light: the same words for any input."""
    toml, (zero, now) = measured_lights(tmp_path, [3, 0])
    path = written_spots(tmp_path / "spots.csv", (zero, now), frames=True)
    lost = np.ma.masked_invalid(now)
    heard = [
        rp.misalignment(now, zero, platform=toml),
        rp.misalignment(lost, zero, platform=platform_of(toml)),
        rp.misalignment(path, platform=toml),
        rp.misalignment(
            pd.read_csv(path).sample(frac=1, random_state=1), platform=toml
        ),
    ]
    options = ["--platform", str(toml)]
    asked = CliRunner().invoke(main, ["misalignment", str(path), *options, "--json"])
    piped = CliRunner().invoke(main, ["misalignment", "-", *options], path.read_text())
    (finding,) = heard[0].findings
    assert finding.kind == "displaced"
    assert "light 4 is displaced by 3 px" in finding.text
    assert heard[0].remarks[-1].startswith("5 of 200 spots are lost")
    posterior = rp.posterior("misalignment", data=path, platform=toml)
    assert set(heard[0].remarks) <= set(posterior.remarks)
    remarks = [json.loads(asked.stdout)["remarks"], *(one.remarks for one in heard)]
    assert all(one == heard[0].remarks for one in remarks)
    for one in heard:
        pd.testing.assert_frame_equal(one.frame(), heard[0].frame())
    for shown in (repr(one), one._repr_html_(), piped.stdout):
        assert finding.text in " ".join(shown.split())
    lacking = heard[0].images().isna().all(axis=1)
    assert lacking.index[lacking].tolist() == [10]


def test_lights_of_ones_own_are_measured_rightly(tmp_path):
    toml, (zero, now) = measured_lights(tmp_path, [0, 0])
    found = rp.misalignment(now, zero, platform=toml)
    assert found.findings == []
    low, high = found.found.interval(0.999) * ARCSEC_PER_RADIAN
    assert ((low < [15, -25, 40]) & (high > [15, -25, 40])).all()
    ends = found.frame()[["95% low (arcsec)", "95% high (arcsec)"]].to_numpy().T
    assert ((ends[0] > low) & (ends[1] < high)).all()


def test_correlated_images_widen_the_interval():
    """The record contains the factor; coverage is tested with the diagnosis."""
    places = [[120, 30], [-90, 160], [10, -140]]
    design = rp.Platform.of_spots(places, 0.05, 5e-6, (0, 0))
    noise = np.random.default_rng(3).normal(0, 0.02, (2, 40, 3, 2))
    for image in range(1, 40):
        noise[:, image] += 0.9 * noise[:, image - 1]
    found = rp.misalignment(*design.spots + noise[::-1], design)
    record = found.record()
    assert [one["kind"] for one in record["findings"]] == ["correlated"]
    assert record["widening"] > 2
    plain = monitored(*found.diagnosis.images, design).interval(0.95)
    width = np.ptp(found.frame().iloc[:, 3:].to_numpy(), axis=1)
    assert (width > 2 * np.ptp(plain, axis=0) * ARCSEC_PER_RADIAN).all()
    json.dumps(record, allow_nan=False)


def test_spots_without_frames_must_be_whole(tmp_path):
    toml, (zero, now) = measured_lights(tmp_path, [0, 0])
    path = written_spots(tmp_path / "spots.csv", (zero, now))
    lost = pd.read_csv(path)
    whole = written_spots(path, (zero, np.nan_to_num(now, nan=900.0)))
    by_light = pd.read_csv(whole).sort_values(["group", "laser"], kind="stable")
    twice = lost.assign(frame=0)
    for frame, column in ((lost, "frame"), (by_light, "frame"), (twice, "laser")):
        with pytest.raises(ValueError, match=f"column {column}"):
            rp.misalignment(frame, platform=toml)
    for name, value in (("group", 2), ("laser", 0), ("laser", 2.5)):
        wrong = lost.assign(**{name: lost[name].where(lost.index != 3, value)})
        with pytest.raises(ValueError, match=f"row 3, column {name}"):
            rp.misalignment(wrong, platform=toml)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lasers = [", "expected TOML"),
        ("lasers = [[0, 0], [1, 1]]", "of lasers, camera_focal_length, tracker_focal"),
        (TOML + "colour = 'red'", "of directions, tracker_focal_length"),
        (TOML.replace("5e-6", "5.0"), "(pixel_pitch: expected metres"),
        (TOML.replace("[0.1, 0, 1]", "[0, 0, 1]"), "lights 1 and 2 at one place"),
    ],
)
def test_a_wrong_platform_is_refused_in_one_line(tmp_path, text, message):
    platform, path = tmp_path / "platform.toml", tmp_path / "spots.csv"
    platform.write_text(text)
    path.write_text("group,laser,x,y")
    told = CliRunner().invoke(
        main, ["misalignment", str(path), "--platform", str(platform)]
    )
    assert told.exit_code == 2
    assert message in told.stderr


def test_stars_of_ones_own_are_registered(tmp_path):
    moved = rp.register(SQUARE, np.add(SQUARE, [3, -2]), (0, 0), model="shift")
    np.testing.assert_allclose(moved.parameters, [-3, 2], atol=1e-9)
    stars = written_stars(tmp_path / "stars.csv")
    fit = rp.register(stars[:, :2], stars[:, 2:], (500, 400))
    file = rp.register(tmp_path / "stars.csv", pivot=(500, 400))
    pd.testing.assert_frame_equal(file.frame(), fit.frame(), rtol=1e-9)
    assert fit.frame()["unit"].tolist() == ["1", "rad", "px", "px"]
    shift, deviation = fit.parameters[2], np.sqrt(fit.covariance[2, 2])
    decimals = 1 - int(np.floor(np.log10(deviation)))
    shown = f"px {shift:.{decimals}f} ± {deviation:.{decimals}f} "
    assert shown in " ".join(repr(fit).split())
    assert file.remarks == []
    json.dumps(file.record(), allow_nan=False)


def test_a_fit_without_errors_shows_no_errors():
    exact = rp.register(SQUARE, np.add(SQUARE, [1 / 3, 0]))
    two = rp.register(SQUARE[:2], np.add(SQUARE[:2], [[0, 1], [1, 1]]))
    for fit, kind in ((exact, "exact"), (two, "few")):
        assert [one.kind for one in fit.findings] == [kind]
        assert fit.frame()["standard deviation"].isna().all()
        assert fit.consistency == {}
        assert fit.sensitivity().empty
    rows = [line.split() for line in repr(exact).splitlines()[-5:-1]]
    values = ["1", "0", "-0.3333333333", "0"]
    assert [row[-1] for row in rows] == values


def test_the_command_registers_a_file(tmp_path):
    path = tmp_path / "stars.csv"
    written_stars(path)
    arguments = ["register", str(path), "--pivot", "500", "400", "--model", "rigid"]
    fit = rp.register(path, pivot=(500, 400), model="rigid")
    shown = CliRunner().invoke(main, arguments).output
    assert " ".join(shown.split()) == " ".join(repr(fit).split())
    record = CliRunner().invoke(main, [*arguments, "--json"]).output
    assert json.loads(record) == fit.record()
    path.write_text("x,y\n1,2\n")
    refused = CliRunner().invoke(main, [*arguments, "--json"])
    assert refused.exit_code == 2
    assert "x_reference" in json.loads(refused.stdout)["error"]


def test_every_way_of_giving_stars_hears_the_same(tmp_path):
    """Wrong matches in arrays, a frame, a file and the posterior, by their rows."""
    path = tmp_path / "stars.csv"
    stars = written_stars(path)
    stars[[3, 9], 2:] += [[40, 0], [0, 60]]
    frame = pd.DataFrame(stars, columns=STAR_COLUMNS.split(","))
    frame.to_csv(path, index=False)
    fits = [rp.register(frame), rp.register(path)]
    fits.append(rp.register(stars[:, :2], stars[:, 2:]))
    (found,) = fits[0].findings
    assert (found.kind, found.rows) == ("mismatched", (9, 3))
    heard = [one.remarks for one in fits]
    heard.append(list(rp.posterior("registration", str(path)).remarks))
    assert heard == [[found.text]] * 4
    robust, affine = fits[1].rerun(robust=True), fits[1].rerun(model="affine")
    for fit, kind in ((robust, "dropped"), (affine, "mismatched")):
        (found,) = (one for one in fit.findings if one.kind != "sensitive")
        assert (found.kind, {*found.rows}) == (kind, {3, 9})


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_a_terminal_sees_no_mark_of_a_page(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    for key in ("chen2023/table-5", "niu2024/text-experiment"):
        stream = io.StringIO()
        console = Console(file=stream, width=columns)
        console.print(rp.table(key))
        assert not re.search(r"</?(a|code|small|br|span)\b", stream.getvalue())


def drifting_pair(frames):
    """Two lights that turn evenly about X and Y, in arcsec in a unit of time, some spots lost."""
    design = rp.Platform.of_spots([[120, 30], [-90, 160]], 0.05, 5e-6, (0, 0))
    generator, times = np.random.default_rng(6), 10 + 0.5 * np.arange(frames)
    turns = (times[:, None] * [4.0, -6.0, 0.0] / ARCSEC_PER_RADIAN)[None]
    now = design.predicted(np.zeros((1, 3)), turns)[0]
    zero = np.repeat(design.spots[None], 10, axis=0)
    zero, now = (one + generator.normal(0, 0.02, one.shape) for one in (zero, now))
    now[3, 0] = now[8] = np.nan
    return design, zero, now, times


def test_images_with_times_tell_drift_and_what_averages_reach(tmp_path):
    design, zero, now, times = drifting_pair(64)
    found = rp.misalignment(now, zero, design, times)
    rows = [
        (group, laser + 1, *image[laser], time)
        for group, images, when in ((0, zero, np.arange(10)), (1, now, times))
        for image, time in zip(images, when, strict=True)
        for laser in (1, 0)
        if np.isfinite(image[laser]).all()
    ]
    np.random.default_rng(0).shuffle(rows)
    table = pd.DataFrame(rows, columns=["group", "laser", "x", "y", "time"])
    read = rp.misalignment(table, platform=design)
    # A table contains no image without any spot.
    seen = np.isfinite(now).all(axis=-1).any(axis=1)
    np.testing.assert_array_equal(read.times, times[seen])
    np.testing.assert_allclose(read.angles, found.angles[seen], atol=1e-12)
    series = found.over_time()
    pd.testing.assert_frame_equal(series, read.over_time())
    off = (series["drift (arcsec)"] - [4.0, -6.0, 0.0]) / series["its error (arcsec)"]
    assert (off.abs() < 4).all()
    assert (series["its error (arcsec)"][:2] < 0.2).all()
    assert found.images()["time"].tolist() == times.tolist()
    assert "drift in a unit of time" in repr(found)
    assert len(found.record()["over_time"]) == 3


def test_times_that_tell_no_average_are_said():
    """The angles stay; too few images, or times that do not increase evenly, are named."""
    design, zero, now, times = drifting_pair(64)
    whole = rp.misalignment(now, zero, design)
    assert whole.over_time().empty
    assert whole.record()["over_time"] == []
    for count, wrong, said in (
        (64, np.repeat(times[::2], 2), "got a step of 0 where"),
        (64, np.sort(np.r_[times[:-1], times[20] + 0.01]), "got a step of 0.01 where"),
        (15, times[:15], "frames or more, got 13"),
    ):
        found = rp.misalignment(now[:count], zero, design, wrong)
        assert found.over_time().empty
        assert any(said in one for one in found.remarks)
        np.testing.assert_array_equal(found.angles, whole.angles[:count])
    kept = np.r_[0:30, 40:64]
    found = rp.misalignment(now[kept], zero, design, times[kept])
    assert found.stability.averages[0] == len(kept) - 5


def test_angles_of_an_image_have_a_covariance():
    """That of draws: a light that is lost, and the roll that two near lights tell badly."""
    design = rp.Platform.of_spots(
        [[120, 30], [-90, 160], [10, -140]], 0.05, 5e-6, (0, 0)
    )
    draws = np.random.default_rng(3).normal(0, 0.02, (4400, 3, 2))
    zero, images = np.split(design.spots + draws, [400])
    images[2000:, 2] = np.nan
    found = rp.misalignment(images, zero, design)
    covariance, angles = found.covariance(), found.images().to_numpy()
    for rows in (slice(2000), slice(2000, None)):
        expected = covariance[rows].mean(axis=0)
        spread = np.outer(*2 * [np.sqrt(np.diag(expected))])
        # Four standard errors of variances and correlations of 2000.
        np.testing.assert_allclose(
            np.cov(angles[rows].T) / spread, expected / spread, atol=0.13
        )
