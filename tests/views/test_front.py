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
from reproduce.physics.registration import registered_image
from reproduce.printed.cells import library
from reproduce.printed.given import given
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views import blocks as terminal
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
    assert cell.reads == rp.table("niu2024/table-2")["scale.red"].reads
    with pytest.raises(
        ValueError, match=r"#scale.red does not read .*#noise; it reads niu2024"
    ):
        cell.rerun({STRANGER: "1 px"})
    table, other = (
        rp.table("chen2023/table-5"),
        "chen2023/table-2#telescope-focal-length.value",
    )
    assert other in table.reads
    assert other not in table["2.motion-x"].reads
    with pytest.raises(ValueError, match=r"table-5#2\.motion-x does not read"):
        table["2.motion-x"].rerun({other: "1 m"})
    assert "def true_scale" in cell.source
    shown = " ".join(repr(cell).split())
    assert "reads niu2024/table-1#focal-length.{red,green,blue}" in shown
    drawn = " ".join(repr(rp.table("niu2024/table-3#scale.red")).split())
    assert re.search(
        r"seed \d+ of the project, \d+ of this function; [\d,]+ replicates", drawn
    )
    assert "<table" in cell._repr_html_()
    assert cell.frame().loc["verdict"].item() == "exact"


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("niu2024/table-3#rotation.red", r"predicted, central 99 % +0\.\d+ to 0\.\d+°"),
        ("chen2023/table-5#2.motion-x", r"computed +20\.\d+\u202fµm"),
        ("niu2024/table-2#scale.red", r"allowed by rounded inputs +0\.\d+ to 0\.\d+\n"),
        ("niu2024/table-2#scale.red", r"stands for +0\.99755 to 0\.99765\n"),
        ("niu2024/table-3#rotation.red", r"Monte Carlo error +[1-9]e−0\d°"),
        ("niu2024/table-3#scale.red", "differs: recomputed and does not agree"),
        (
            "chen2023/table-5#2.difference-y",
            r"exact \(difference\): recomputed and rounds",
        ),
    ],
)
def test_a_cell_says_what_its_interval_is_and_its_unit(address, shown):
    assert re.search(shown, repr(rp.table(address)))


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


def test_a_study_shows_its_numbers_as_its_columns_say():
    rows = {row[0]: row[1:] for row in rp.table("chen2023/focal-lengths").grid.rows}
    assert rows["reference about Y, state 2"] == ["2084.2 ± 1.5", "2055.5 ± 1.5"]
    mirror = {row[0]: row[1:] for row in rp.table("chen2023/dichroic").grid.rows}
    assert mirror["its normal"] == ["0", "any", "any"]


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


def test_the_data_of_a_figure_are_what_is_drawn():
    """Figure 4 draws the angles: as many points as the text says there are."""
    data = rp.figure("niu2024/fig-4").data
    count = library()["niu2024/text-simulation"]["angle-count"].number.value
    assert count in data.groupby("curve").size().to_numpy()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rp.table("niu2024/tabel-3"), "did you mean niu2024/table-3"),
        (lambda: rp.table("niu2024/table-3#scale.green"), "has no cell 'scale.green'"),
        (lambda: rp.table("niu2024/fig-4"), r"try figure\('niu2024/fig-4'\)"),
        (lambda: rp.figure("niu2024/table-3"), "has no figure"),
        (lambda: rp.table("chen2023/heat").rerun({STRANGER: "1 px"}), "does not read"),
        (
            lambda: rp.table("chen2023/heat").rerun({FOCAL: "1 px"}),
            "expected m as printed",
        ),
        (lambda: rp.posterior("nothing"), "unknown posterior"),
        (
            lambda: rp.posterior("registration", thin=2),
            "posterior.. got an unexpected keyword",
        ),
        (
            lambda: rp.posterior("registration").rerun(thin=2),
            "expected data, pivot, priors, data_seed",
        ),
        (
            lambda: rp.register(SQUARE, SQUARE, modle="rigid"),
            "register.. got an unexpected key",
        ),
        (
            lambda: rp.register(SQUARE, SQUARE).rerun(modle="rigid"),
            "expected source, .*robust",
        ),
        (
            lambda: rp.register([], []),
            r"source: expected one set of stars, shape \(n, 2\), got \(0,\)",
        ),
        (lambda: rp.register(SQUARE), "target: expected the stars of the other image"),
        (
            lambda: rp.register("stars.csv", SQUARE),
            "target: expected nothing beside a file",
        ),
        (lambda: rp.register([SQUARE] * 2, [SQUARE] * 2), "expected one set of stars"),
        (lambda: rp.contradictions("nobody1999"), "expected one of niu2024, chen2023"),
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
    from reproduce.views import front

    other = {"niu2024/table-2#scale.red": ledger.Expectation("differs", "made up")}
    real = ledger.frozen
    monkeypatch.setattr(ledger, "frozen", lambda: real() | other)
    found = front.check("niu2024/table-2")
    assert not found
    assert "expected differs, found exact" in repr(found)
    assert found.frame()["cell"].tolist() == ["niu2024/table-2#scale.red"]


def test_a_posterior_is_sampled_when_looked_at_and_rerun_with_a_change():
    plain = rp.posterior("registration")
    assert "sampled" not in vars(plain), "nothing is sampled yet"
    assert plain.reads
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
    design = as_designed(given(INSTRUMENT))
    angles = np.array(turn)[None, None] / ARCSEC_PER_RADIAN
    at = design.predicted(np.zeros((1, 3)), angles)[0, 0]
    return at + 0.02 * np.random.default_rng(5).normal(size=(20, *at.shape))


def test_every_name_works_as_the_design_writes_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stars = written_stars("my_centroids.csv")
    assert "niu2024/table-3" in repr(rp.contents("niu2024"))
    t = rp.table("niu2024/table-3")
    assert len(t.frame()) == 4
    assert len(t.cells()) == 8
    assert t["scale.red"].printed == "0.9973"
    changed = t.rerun({"niu2024/text-simulation#noise": "0.2 px"}, seed=7)
    assert changed.changes["seed"] == "7"
    read = t.rerun(angles="rectangle", translations="table-2").frame()
    assert set(read["verdict"]) == {"differs", "consistent"}
    f = rp.figure("chen2023/fig-11")
    assert set(f.data["figure"]) == {"chen2023/fig-11a", "chen2023/fig-11b"}
    assert [path.name for path in f.save("fig.pdf")] == ["fig-a.pdf", "fig-b.pdf"]
    assert f.rerun({"chen2023/text-resolution#spot-radius": "20 um"}).panels[0].changes
    p = rp.posterior("registration")
    assert "scale" in p.summary().index
    assert "<svg" in p.corner()._repr_html_()
    assert len(p.draws) > 1000
    assert p.save("p.nc").stat().st_size > 1000
    assert p.rerun(data="my_centroids.csv").frame().loc[
        "shift-x", "mean"
    ] == pytest.approx(3, abs=0.1)
    assert rp.contradictions("niu2024").frame()["paper"].unique().tolist() == [
        "niu2024"
    ]
    assert rp.check("niu2024/table-2")
    assert rp.register(stars[:, :2], stars[:, 2:]).parameters[2] == pytest.approx(
        3, abs=0.1
    )
    turned = rp.misalignment(spots([20, -20, 0]), spots([0, 0, 0]))
    assert turned.frame().loc["X", "mean (arcsec)"] == pytest.approx(20, abs=0.1)
    assert "chen2023/table-5" in rp.cite("chen2023/table-5")


@pytest.mark.parametrize(
    "make",
    [
        lambda: rp.table("niu2024/table-2"),
        lambda: rp.table("niu2024/table-2#scale.red"),
        lambda: rp.figure("niu2024/fig-4"),
        lambda: rp.figure("chen2023/fig-11"),
        lambda: rp.posterior("registration"),
        lambda: rp.register([[0, 0], [9, 0], [0, 9]], [[1, 0], [10, 0], [1, 9]]),
        lambda: rp.misalignment(spots([20, 0, 0]), spots([0, 0, 0])),
    ],
    ids=["table", "cell", "figure", "panels", "posterior", "stars", "lasers"],
)
def test_every_object_has_the_same_verbs(make):
    one = make()
    assert repr(one)
    assert "<" in one._repr_html_()
    assert len(one.frame())
    assert "def " in one.source
    assert isinstance(one.reads, tuple)
    assert callable(one.rerun)
    assert one.export("csv").count("\n") > 1
    if hasattr(one, "cite"):
        assert "@misc" in one.cite()


def test_priors_of_ones_own_take_the_place_of_the_books():
    plain = rp.posterior("misalignment")
    name = plain.model.names[3]
    other = plain.rerun(priors={name: (29, 31)})
    assert other.priors.loc[name, "why"] == "bounds given by the user"
    assert plain.priors.loc[name, "why"] != "bounds given by the user"
    assert "sampled" not in vars(other)
    parameter = other.model.parameters[3]
    assert parameter.prior.high * parameter.shown == pytest.approx(31)
    with pytest.raises(ValueError, match=r"expected names among .*, got whit"):
        plain.rerun(priors={"whit": (0, 1)})


def test_a_figure_is_computed_and_drawn_again():
    address = "niu2024/text-simulation#range-x-high"
    plain = rp.figure("niu2024/fig-4")
    wider = plain.rerun({address: "10 deg"})
    assert address in plain.reads
    frame = wider.data[wider.data["curve"] == "printed range"]
    assert frame["x"].max() == pytest.approx((10 + 8) / 2), (
        "half the range, laid about zero"
    )
    assert "10 deg" in repr(wider)
    with pytest.raises(ValueError, match="does not read nothing#x; it reads"):
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
    ratio = (
        longer.frame().loc["X", "mean (arcsec)"]
        / plain.frame().loc["X", "mean (arcsec)"]
    )
    assert ratio == pytest.approx(plain.platform.tracker_focal_length / 0.12, rel=1e-3)
    assert "the pattern is 0.5 of its expected size" in " ".join(repr(longer).split())
    assert plain.findings == []
    path = written_spots(tmp_path / "spots.csv", (zero, now))
    from_file = rp.misalignment(path)
    np.testing.assert_allclose(from_file.angles, plain.angles, atol=1e-12)
    for wrong, message in (
        (lambda: rp.misalignment(now), "expected the images at the zero point"),
        (lambda: rp.misalignment(path, zero), "expected nothing beside a file"),
        (lambda: rp.misalignment(now[:, :3], zero), "expected images of 4 lights"),
        (lambda: rp.misalignment(now + np.inf, zero), "or NaN for a lost spot"),
        (
            lambda: rp.posterior("misalignment", platform=plain.platform),
            "expected data of your ow",
        ),
    ):
        with pytest.raises(ValueError, match=message):
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
    """A light displaced, spots lost, an image that shows one light: the same words on every way."""
    toml, (zero, now) = measured_lights(tmp_path, [3, 0])
    path = written_spots(tmp_path / "spots.csv", (zero, now), frames=True)
    lost = np.ma.masked_invalid(now)
    heard = [
        rp.misalignment(now, zero, platform=toml),
        rp.misalignment(lost, zero, platform=platform_of(toml)),
        rp.misalignment(path, platform=toml),
        rp.misalignment(pd.read_csv(path), platform=toml),
    ]
    command = ["misalignment", str(path), "--platform", str(toml)]
    asked = CliRunner().invoke(main, [*command, "--json"])
    piped = CliRunner().invoke(
        main, ["misalignment", "-", *command[2:]], input=path.read_text()
    )
    record = json.loads(asked.stdout)
    (finding,) = heard[0].findings
    assert finding.kind == "displaced"
    assert "light 4 is displaced by 3 px" in finding.text
    assert [one["text"] for one in record["findings"]] == [finding.text]
    assert (
        heard[0]
        .remarks[-1]
        .startswith("5 of 200 spots are lost (1 of light 2, 2 of light 3")
    )
    posterior = rp.posterior("misalignment", data=path, platform=toml)
    assert set(heard[0].remarks) <= set(posterior.remarks)
    for one in heard:
        assert one.remarks == heard[0].remarks == record["remarks"]
        pd.testing.assert_frame_equal(one.frame(), heard[0].frame())
        assert finding.text in " ".join(repr(one).split())
        assert finding.text in one._repr_html_()
    assert finding.text in " ".join(piped.stdout.split())
    assert heard[0].images().loc[10].isna().all()
    assert heard[0].images().drop(10).notna().all(axis=None)


def test_lights_of_ones_own_are_measured_rightly(tmp_path):
    toml, (zero, now) = measured_lights(tmp_path, [0, 0])
    found = rp.misalignment(now, zero, platform=toml)
    assert found.findings == []
    low, high = found.found.interval(0.999) * ARCSEC_PER_RADIAN
    assert (low < [15, -25, 40]).all()
    assert (high > [15, -25, 40]).all()
    frame = found.frame()
    assert (frame["95% low (arcsec)"] > low).all()
    assert (frame["95% high (arcsec)"] < high).all()
    path = written_spots(tmp_path / "spots.csv", (zero, now), frames=True)
    model = rp.posterior("misalignment", data=path, platform=toml).model
    centre, error = (one[3:6] * ARCSEC_PER_RADIAN for one in model.likelihood.start())
    assert (np.abs(centre - [15, -25, 40]) < 4 * error).all()


def test_correlated_images_widen_the_interval():
    """The record contains the factor, and the interval covers where white noise would not."""
    design = rp.Platform.of_spots(
        [[120, 30], [-90, 160], [10, -140]], 0.05, 5e-6, (0, 0)
    )
    generator, noise = np.random.default_rng(3), np.zeros((2, 40, 3, 2))
    for image in range(1, 40):
        noise[:, image] = 0.9 * noise[:, image - 1] + generator.normal(
            0, 0.02, (2, 3, 2)
        )
    found = rp.misalignment(*design.spots + noise[::-1], design)
    record = found.record()
    assert [one["kind"] for one in record["findings"]] == ["correlated"]
    assert record["widening"] > 2
    assert record["low"] < record["chi_square"] < record["high"]
    width = np.ptp(found.frame().iloc[:, 3:].to_numpy(), axis=1)
    plain = (
        monitored(*found.diagnosis.images, design).interval(0.95) * ARCSEC_PER_RADIAN
    )
    assert (width > 2 * np.ptp(plain, axis=0)).all()
    json.dumps(record, allow_nan=False)


def test_spots_without_frames_must_be_whole(tmp_path):
    toml, (zero, now) = measured_lights(tmp_path, [0, 0])
    path = written_spots(tmp_path / "spots.csv", (zero, now))
    with pytest.raises(ValueError, match=r"row 130.*column frame"):
        rp.misalignment(path, platform=toml)
    frame = pd.read_csv(written_spots(path, (zero, np.nan_to_num(now, nan=900.0))))
    by_light = frame.sort_values(["group", "laser"], kind="stable")
    with pytest.raises(ValueError, match=r"row 0.*column frame"):
        rp.misalignment(by_light, platform=toml)


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


def test_contradictions_give_the_register_and_the_relations():
    found = rp.contradictions("chen2023")
    assert "chen2023-table-5-motion" in found.frame().index
    assert "contradicts" in set(found["relations"].frame()["outcome"])
    assert len(repr(found).splitlines()) > 20


def test_stars_of_ones_own_are_registered(tmp_path):
    fit = rp.register(SQUARE, 1.001 * SQUARE + np.array([3, -2]))
    assert fit.parameters[0] == pytest.approx(1.001)
    moved = rp.register(SQUARE, np.add(SQUARE, [3, -2]), (0, 0), model="shift")
    np.testing.assert_allclose(moved.parameters, [-3, 2], atol=1e-9)
    stars = written_stars(tmp_path / "stars.csv")
    fit = rp.register(stars[:, :2], stars[:, 2:], (500, 400))
    file = rp.register(tmp_path / "stars.csv", pivot=(500, 400))
    pd.testing.assert_frame_equal(file.frame(), fit.frame(), rtol=1e-9)
    assert fit.frame()["unit"].tolist() == ["1", "rad", "px", "px"]
    shift, deviation = fit.parameters[2], np.sqrt(fit.covariance[2, 2])
    decimals = 1 - int(np.floor(np.log10(deviation)))
    assert f"px {shift:.{decimals}f} ± {deviation:.{decimals}f} " in " ".join(
        repr(fit).split()
    )
    assert file.remarks == []
    json.dumps(file.record(), allow_nan=False)


def test_doubts_about_ones_own_stars_are_told(tmp_path):
    """Another unit, no error or none that shows, wrong matches by their rows."""
    stars = written_stars(tmp_path / "stars.csv")
    in_mm = rp.register(0.0055 * stars[:, :2], 0.0055 * stars[:, 2:], (5.7, 4.2))
    assert "are these pixels" in in_mm.remarks[0]
    assert "are these pixels" in in_mm._repr_html_()
    exact = rp.register(SQUARE, np.add(SQUARE, [1 / 3, 0]))
    assert [one.kind for one in exact.findings] == ["exact"]
    assert exact.frame()["standard deviation"].isna().all()
    rows = [line.split() for line in repr(exact).splitlines()[-5:-1]]
    assert exact.consistency == {}
    assert exact.sensitivity().empty
    assert rows == [
        ["scale", "1", "1"],
        ["rotation", "rad", "0"],
        ["shift-x", "px", "-0.3333333333"],
        ["shift-y", "px", "0"],
    ]
    two = rp.register(SQUARE[:2], np.add(SQUARE[:2], [[0, 1], [1, 1]]))
    assert [one.kind for one in two.findings] == ["few"]
    assert two.frame()["standard deviation"].isna().all()
    stars[3, 2:] += 40
    np.savetxt(
        tmp_path / "stars.csv", stars, delimiter=",", comments="", header=STAR_COLUMNS
    )
    plain = rp.register(str(tmp_path / "stars.csv"))
    for fit, kind in (
        (plain, "mismatched"),
        (plain.rerun(robust=True), "dropped"),
        (plain.rerun(model="affine"), "mismatched"),
    ):
        (found,) = (one for one in fit.findings if one.kind != "sensitive")
        assert (found.kind, found.rows) == (kind, (3,))
        assert "row 3" in found.text


def test_the_command_registers_a_file(tmp_path):
    path = tmp_path / "stars.csv"
    written_stars(path)
    arguments = ["register", str(path), "--pivot", "500", "400", "--model", "rigid"]
    fit = rp.register(path, pivot=(500, 400), model="rigid")
    shown = CliRunner().invoke(main, arguments).output
    assert " ".join(shown.split()) == " ".join(repr(fit).split())
    assert (
        json.loads(CliRunner().invoke(main, [*arguments, "--json"]).output)
        == fit.record()
    )
    path.write_text("x,y\n1,2\n")
    refused = CliRunner().invoke(main, [*arguments, "--json"])
    assert refused.exit_code == 2
    assert "x_reference" in json.loads(refused.stdout)["error"]
    described = CliRunner().invoke(main, ["register", "--help"]).output
    assert set(STAR_COLUMNS.split(",")) <= set(re.findall(r"\w+", described))


def test_cells_are_cited_by_their_own_address():
    text = rp.cite("niu2024/table-3#scale.red")
    assert "reproduce-niu2024-table-3-scale-red" in text
    assert r"niu2024/table-3\#scale.red: printed 0.9973, recomputed 0.997564" in text
    assert "Item niu2024/table-3" in rp.cite("niu2024/table-3")


def test_a_rerun_shows_no_empty_column():
    counts = rp.table("niu2024/text-approximations").rerun(
        {"niu2024/text-context#detectors": "4"}
    )
    assert counts.grid.head == ["cell", "printed", "from the print", "changed"]
    assert list(counts.grid.rows[1]) == ["parameters", "8", "8", "12"]
    drawn = rp.table("niu2024/table-3").rerun(
        {"niu2024/text-simulation#noise": "0.1 px"}
    )
    assert {"from", "to", "unit"} < set(drawn.grid.head)


def test_every_way_of_giving_stars_hears_the_same(tmp_path):
    """Wrong matches in arrays, a frame, a file, the terminal, JSON and the posterior."""
    import pandas as pd

    stars = written_stars(tmp_path / "stars.csv")
    stars[[3, 9], 2:] += [[40, 0], [0, 60]]
    np.savetxt(
        tmp_path / "stars.csv", stars, delimiter=",", comments="", header=STAR_COLUMNS
    )
    arrays = rp.register(stars[:, :2], stars[:, 2:])
    frame = rp.register(pd.DataFrame(stars, columns=STAR_COLUMNS.split(",")))
    file = rp.register(str(tmp_path / "stars.csv"))
    (found,) = arrays.findings
    assert (found.kind, found.rows) == ("mismatched", (9, 3))
    assert arrays.remarks == frame.remarks == file.remarks == [found.text]
    assert file.record()["findings"][0]["rows"] == (9, 3)
    assert (
        list(rp.posterior("registration", str(tmp_path / "stars.csv")).remarks)
        == file.remarks
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rp.table(3), "expected a key such as"),
        (lambda: rp.figure(None), "expected a key such as"),
        (
            lambda: rp.table("niu2024/table-3").rerun(seed="a"),
            "seed: expected a whole number",
        ),
        (lambda: rp.posterior("registration", data=SQUARE), "data: expected a file"),
        (lambda: rp.posterior("registration", steps=0), "steps: expected 1 or more"),
        (
            lambda: rp.table("niu2024/table-3").sweep(STRANGER, "0.2 px"),
            "expected a list of val",
        ),
        (
            lambda: registered_image(np.ones((5, 5)), 3),
            "transform: expected a Registration",
        ),
    ],
)
def test_another_type_is_told_what_was_expected(call, message):
    with pytest.raises((ValueError, TypeError), match=message):
        call()


def test_what_a_fit_of_ones_own_stars_returns_registers_an_image(tmp_path):
    stars = written_stars(tmp_path / "stars.csv")
    fit = rp.register(stars[:, :2], stars[:, 2:])
    image = np.arange(1200.0).reshape(30, 40)
    shown = registered_image(image, fit)
    np.testing.assert_array_equal(shown, registered_image(image, fit.transform))


def test_a_posterior_takes_a_dataframe_as_it_takes_its_file(tmp_path):
    stars = written_stars(tmp_path / "stars.csv")
    frame = pd.DataFrame(stars, columns=STAR_COLUMNS.split(","))
    frame.to_csv(tmp_path / "exact.csv", index=False)
    first, second = (
        rp.posterior("registration", data=data, pivot=(500, 400), steps=400, seed=3)
        for data in (frame, tmp_path / "exact.csv")
    )
    assert "of the DataFrame, 60 rows" in first.data_text
    pd.testing.assert_frame_equal(first.frame(), second.frame())


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_a_terminal_sees_no_mark_of_a_page(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    for key in ("chen2023/table-5", "niu2024/text-experiment"):
        stream = io.StringIO()
        console = Console(file=stream, width=columns)
        terminal._write(rp.table(key).blocks(), console)
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
    (tmp_path / "platform.toml").write_text(
        "spots = [[120, 30], [-90, 160]]\ntracker_focal_length = 0.05\n"
        "pixel_pitch = 5e-6\nprincipal_point = [0, 0]\n"
    )
    rows = [
        (group, laser + 1, *image[laser], time)
        for group, images, when in ((0, zero, np.arange(10)), (1, now, times))
        for image, time in zip(images, when, strict=True)
        for laser in (1, 0)
        if np.isfinite(image[laser]).all()
    ]
    np.random.default_rng(0).shuffle(rows)
    path = tmp_path / "spots.csv"
    np.savetxt(
        path,
        rows,
        delimiter=",",
        header="group,laser,x,y,time",
        comments="",
        fmt="%.17g",
    )
    found = rp.misalignment(now, zero, design, times)
    read = rp.misalignment(path, platform=tmp_path / "platform.toml")
    # A file contains no image without any spot.
    seen = np.isfinite(now).all(axis=-1).any(axis=1)
    np.testing.assert_array_equal(read.times, times[seen])
    np.testing.assert_allclose(read.angles, found.angles[seen], atol=1e-12)
    series = found.over_time()
    pd.testing.assert_frame_equal(series, read.over_time())
    off = (series["drift (arcsec)"] - [4.0, -6.0, 0.0]) / series["its error (arcsec)"]
    assert (off.abs() < 4).all()
    assert (series["its error (arcsec)"][:2] < 0.2).all()
    command = ["misalignment", str(path), "--platform", str(tmp_path / "platform.toml")]
    record = json.loads(CliRunner().invoke(main, [*command, "--json"]).stdout)
    assert record["over_time"] == read.record()["over_time"]
    assert [one["drift (arcsec)"] for one in record["over_time"]] == series.iloc[
        :, 0
    ].tolist()
    assert "drift in a unit of time" in CliRunner().invoke(main, command).stdout
    assert found.images()["time"].tolist() == times.tolist()


def test_without_times_or_with_few_images_no_drift_is_told():
    design, zero, now, times = drifting_pair(15)
    for found, said in (
        (rp.misalignment(now, zero, design), False),
        (rp.misalignment(now, zero, design, times), True),
    ):
        assert found.over_time().empty
        assert any("frames or more, got 13" in one for one in found.remarks) == said
        assert found.record()["over_time"] == []
    with pytest.raises(ValueError, match="times: expected 15 finite numbers"):
        rp.misalignment(now, zero, design, times[:-1])


def test_times_that_tell_no_average_are_said():
    """The angles are told all the same; where images are lost, so are the averages."""
    design, zero, now, times = drifting_pair(64)
    whole = rp.misalignment(now, zero, design, times)
    for wrong, said in (
        (np.repeat(times[::2], 2), "later than the one before"),
        (np.sort(np.r_[times[:-1], times[20] + 0.01]), "evenly spaced"),
    ):
        found = rp.misalignment(now, zero, design, wrong)
        assert found.over_time().empty
        assert any(said in one for one in found.remarks)
        np.testing.assert_array_equal(found.angles, whole.angles)
    lost = np.r_[0:30, 40:64]
    found = rp.misalignment(now[lost], zero, design, times[lost])
    assert found.stability.averages[0] == len(lost) - 5
    assert not any("told" in one for one in found.remarks)


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
