"""The command line and the pages of the posteriors."""

import json
import re

import numpy as np
import pytest
from commands import run
from matplotlib.figure import Figure
from places import ROOT
from simulated import star_table

import reproduce as rp
from book_facts import of_posteriors
from reproduce.inference import Quantity, sampling
from reproduce.papers.niu2024.posteriors import true_centroids
from reproduce.papers.posteriors import posteriors
from reproduce.printed.inputs import load_inputs
from reproduce.store import studies
from reproduce.views import _computed as computed
from reproduce.views import posteriors as pages
from reproduce.views._intervals import draw_intervals
from reproduce.views.posterior import book_posterior

FOLDER = ROOT / "book/posteriors"
PAGES = [path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))]


def test_models_are_listed():
    listed = run("posterior --list").output
    pairs = re.findall(r"^ ?(\S+) +(niu2024|chen2023)", listed, re.MULTILINE)
    assert pairs == [(name, declared.paper) for name, declared in posteriors().items()]
    assert list(json.loads(run("posterior --list --json").output)) == list(posteriors())


def test_a_page_shows_every_posterior_and_one_of_each_model():
    setups = {}
    for name, declared in posteriors().items():
        (page,) = (text for text in PAGES if f'\nrp.posterior("{name}")\n' in text)
        build = getattr(declared.build, "func", declared.build)
        count = page.count(f'rp.posterior("{name}").setup\n')
        setups[page, build] = setups.get((page, build), 0) + count
    assert min(setups.values()) > 0
    for name in ("misalignment", "camera-red"):
        source = rp.posterior(name).source
        assert "\ndef __call__(self, parameters" in source
    shown = rp.posterior("misalignment").setup._repr_html_()
    for parameter in rp.posterior("misalignment").model.parameters:
        assert parameter.prior.reason in shown


def test_a_summary_contains_the_printed_number_and_its_verdict():
    name, address = "rotation", "niu2024/table-4#rotation.red"
    found = rp.posterior("camera-red")
    assert found.declared.summary[name] == address
    row = found.frame().loc[name]
    (summary,) = (one for one in found.sampled.summaries if one.name == name)
    shown = pages._summarised(found.name, summary, address)
    label, printed, mean, ends, verdict = map(shown.get, pages._COLUMNS)
    numbers = [float(x.rstrip("°")) for x in (*mean.split(" ± "), *ends.split(" to "))]
    expected = row[["mean", "deviation", "low", "high"]].tolist()
    assert numbers == pytest.approx(expected, rel=0.05)
    cell = rp.table("niu2024/table-4")["rotation.red"]
    assert f">{cell.printed}" in printed
    assert f">{cell.verdict}<" in verdict
    assert 'href="#posterior-camera-red"' in label
    assert "Table 4: Rotation angle, Red" in label


def test_a_posterior_shows_the_truth_of_simulated_data_and_the_changes(tmp_path):
    book = rp.posterior("registration")
    html = book._repr_html_()
    assert f"<td>{book.truth['scale']:.6g}</td>" in html
    path, noise = tmp_path / "stars.csv", {"noise": (0.01, 1)}
    star_table().to_csv(path, index=False)
    plan = {"steps": 280, "walkers": 80}
    yours = rp.posterior("registration", path, priors=noise, **plan)
    html = yours._repr_html_()
    assert "stars.csv, 60 rows, pivot" in html
    assert "Changed: prior of noise, steps = 280, walkers = 80." in html
    assert "tru" not in html.replace("structure", "")
    cut = yours.rerun(priors={"noise": (0.01, 0.1)})
    for text in (repr(cut), cut._repr_html_()):
        assert "Warning: noise piles up" in text


def test_the_truth_is_that_of_the_same_model():
    """Noise-free stars follow from it: exactly with distortions, in the mean without."""
    declared = posteriors()["registration-distortion"]
    true = true_centroids(load_inputs(declared.inputs))
    bent = declared.model()
    point = np.array([[bent.truth[name] for name in bent.names]])
    places = bent.likelihood.places(point, true[1])[0]
    assert np.abs(places - true[0]).max() < 1e-4
    straight = posteriors()["registration"].model()
    point = np.array([[straight.truth[name] for name in straight.names]])
    plain = straight.likelihood
    left = true[0] - plain.places(point, true[1])[0]
    offsets = true[1] - plain.pivot
    assert np.abs(left.mean(axis=0)).max() < 1e-9
    assert np.vecdot(left, offsets).sum() == pytest.approx(0, abs=1e-6)
    assert np.hypot(*left.T).max() > 5e-3


def test_an_interval_plot_has_the_most_correlated_pair():
    book = rp.posterior("misalignment")
    html = book.intervals().text
    assert "Panel: draws of mount-z and angle-z" in html
    assert "Panel" not in book.intervals("angle-x", "noise").text
    with pytest.raises(ValueError, match="names: "):
        book.intervals("nothing")
    printed = rp.posterior("camera-red").intervals().text
    assert "Dashed: printed value." in printed
    assert "closed form" in printed


def test_an_interval_plot_shows_both_modes_of_a_quantity():
    draws = np.random.default_rng(1).normal(0.0, 0.1, 1000)
    figure, values = Figure(), np.append(draws, 1.0 + draws)
    draws = {"a": Quantity(values, "px")}
    draw_intervals(figure, draws, {"a": "a"}, {}, {}, ())
    x, density = figure.axes[0].collections[0].get_paths()[0].vertices.T
    valley = np.abs(x - 0.5) < 0.2
    assert density[valley].max() < 0.3 * density.max()


def test_facts_are_the_numbers_of_the_object():
    found = of_posteriors(["misalignment"])
    frame = rp.posterior("misalignment").frame()
    for fact, column in (("mean", "mean"), ("sd", "deviation"), ("low", "low")):
        text = found[f"posterior/misalignment#angle-z-{fact}"].replace("−", "-")
        number, unit = text.split("\u202f")
        assert float(number) == pytest.approx(frame.loc["angle-z", column], rel=0.06)
        assert unit == frame.loc["angle-z", "unit"]
    rows = studies.table("calibrations").query("posterior == 'misalignment'")
    replicates = rows["replicates"].iloc[0]
    assert found["posterior/misalignment#sbc-replicates"] == f"{replicates:,}"


def test_a_build_samples_once(tmp_path, monkeypatch):
    direct = book_posterior("averaging-y")
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    try:
        book_posterior.cache_clear()
        again = book_posterior("averaging-y")
        book_posterior.cache_clear()
        monkeypatch.setattr(sampling, "run_ensemble", None)
        read = book_posterior("averaging-y")
        assert read.summaries == direct.summaries
    finally:
        book_posterior.cache_clear()
    assert [path.name for path in tmp_path.iterdir()] == ["posterior-averaging-y.npz"]
    for found in (again, read):
        np.testing.assert_array_equal(found.chain, direct.chain)


def test_simulated_data_have_a_separate_seed():
    """The sampler has another one, and your data have no seed."""
    book = rp.posterior("registration")
    again = rp.posterior("registration", data_seed=1)
    assert (book.model.likelihood.source != again.model.likelihood.source).all()
    assert again.rerun(steps=50).changes == "data_seed = 1, steps = 50"
    assert book.truth == again.truth
    for name, settings in (
        ("registration", {"data_seed": 1, "data": "stars.csv"}),
        ("registration", {"data_seed": -1}),
        ("averaging-x", {"data_seed": 1}),
    ):
        with pytest.raises(ValueError, match=r"^data_seed: "):
            rp.posterior(name, **settings)
    with pytest.raises(TypeError, match=r"^name: "):
        rp.posterior(data="stars.csv")
