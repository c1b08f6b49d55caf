"""The command line and the pages of the posteriors."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import reproduce as rp
from reproduce.inference import sampling
from reproduce.inference.evidence import compared, exact_evidence
from reproduce.papers import calibrations
from reproduce.papers.chen2023.posteriors import COLUMNS, FLOORS, summed_columns
from reproduce.papers.posteriors import posteriors
from reproduce.views import computed
from reproduce.views.book import posteriors as pages
from reproduce.views.book.facts import of_posteriors
from reproduce.views.cli import main
from reproduce.views.objects.posterior import book_posterior

FOLDER = Path(__file__).parents[2] / "book" / "posteriors"
PAGES = [path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))]


def run(*arguments):
    return CliRunner().invoke(main, arguments)


def stars_file(tmp_path, shift=3.0):
    generator = np.random.default_rng(1)
    source = generator.uniform(0, 1000, (60, 2))
    target = source - [shift, 0] + 0.1 * generator.normal(size=source.shape)
    path = tmp_path / "stars.csv"
    rows = np.column_stack([source, target])
    np.savetxt(path, rows, delimiter=",", header="x,y,x_reference,y_reference", comments="")
    return path


def spots_file(tmp_path):
    generator = np.random.default_rng(1)
    corners = np.array([[544.8, 435.8], [520.7, 459.8], [569.0, 459.9], [544.6, 483.9]])
    lines = ["group,laser,x,y"]
    for group, moved in ((0, 0.0), (1, 0.5)):
        for spots in corners + [0, moved] + 0.02 * generator.normal(size=(50, 4, 2)):
            lines += [f"{group},{i + 1},{x},{y}" for i, (x, y) in enumerate(spots)]
    path = tmp_path / "spots.csv"
    path.write_text("\n".join(lines))
    return path


def test_models_are_listed():
    listed = run("posterior", "--list").output
    pairs = re.findall(r"^ ?(\S+) +(niu2024|chen2023)", listed, re.MULTILINE)
    assert pairs == [(name, declared.paper) for name, declared in posteriors().items()]
    assert max(map(len, listed.splitlines())) <= 80
    assert list(json.loads(run("posterior", "--list", "--json").output)) == list(posteriors())


def test_summary_fits_a_narrow_terminal():
    result = run("posterior", "registration", "--steps", "600")
    assert result.exit_code == 0, result.output
    for word in ("shift-x", "MCSE", "R-hat", "bulk"):
        assert word in result.output
    assert max(len(line) for line in result.output.splitlines()) <= 80


def test_users_stars_take_the_place_of_ours(tmp_path):
    path = stars_file(tmp_path)
    result = run("posterior", "registration", "--data", str(path), "--steps", "600", "--json")
    assert result.exit_code == 0, result.output
    rows = {row["name"]: row for row in json.loads(result.output)["parameters"]}
    assert abs(rows["shift-x"]["mean"] - 3.0) < 0.1
    assert 0.07 < rows["noise"]["mean"] < 0.13


def test_users_spots_take_the_place_of_ours(tmp_path):
    path = spots_file(tmp_path)
    result = run("posterior", "misalignment", "--data", str(path), "--steps", "700", "--json")
    assert result.exit_code == 0, result.output
    rows = {row["name"]: row for row in json.loads(result.output)["parameters"]}
    # Half a pixel is half of 44.7 arcsec, and the image moves against the camera's X turn.
    assert abs(abs(rows["angle-x"]["mean"]) - 22.3) < 0.5
    assert abs(rows["angle-y"]["mean"]) < 0.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["posterior"], "name a model"),
        (["posterior", "tabel-5"], "did you mean table-5"),
        (["posterior", "centroid-noise", "--data", __file__], "centroid-noise takes no file"),
        (["posterior", "registration", "--data", __file__], "line 1, column 1: unknown column"),
        (["posterior", "registration", "--resume"], "--resume needs --out"),
        (["calibrate", "nothing"], "unknown model"),
    ],
)
def test_bad_calls(arguments, message):
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.output.replace("\n", " ")


def test_refused_chains_exit_with_one_and_their_numbers():
    result = run("posterior", "registration", "--steps", "60")
    assert result.exit_code == 1
    assert "autocorrelation times" in result.output


def test_stored_run_is_continued_only_on_request(tmp_path):
    out = str(tmp_path / "run")
    first = run("posterior", "registration", "--steps", "600", "--out", out, "--json")
    assert first.exit_code == 0, first.output
    assert run("posterior", "registration", "--steps", "600", "--out", out).exit_code == 2
    again = run("posterior", "registration", "--steps", "600", "--out", out, "--resume", "--json")
    assert again.output == first.output


def test_calibrate_redoes_replicates():
    result = run("calibrate", "registration", "--replicates", "3", "--workers", "1")
    assert result.exit_code == 0, result.output
    assert "3 replicates, 0 of them failed." in result.output


@pytest.mark.parametrize("name", list(posteriors()))
@pytest.mark.parametrize("step", [*pages.STEPS, "reporting"])
def test_every_model_has_every_step_on_the_page_that_links_them(name, step):
    """The links of `reporting` lead to places on their own page."""
    (page,) = (text for text in PAGES if f'pages.reporting("{name}")' in text)
    assert page.count(f'pages.{step}("{name}")') == 1


def test_a_fault_in_a_closed_form_is_not_taken_for_a_model_without_one():
    """Only a model that has no closed form shows "none"; any other error is told."""
    declared = posteriors()["registration"]
    plain = declared.model()
    (rival,) = (make(plain) for make in declared.rivals)
    assert isinstance(exact_evidence(plain, declared.evidence), float)
    assert exact_evidence(rival, declared.evidence) is None
    assert exact_evidence(plain, None) is None

    def broken(model):
        raise TypeError("a fault")

    with pytest.raises(TypeError, match="a fault"):
        exact_evidence(plain, broken)
    faulty = replace(declared, evidence=broken, bound=broken)
    found = book_posterior("registration")
    with pytest.raises(TypeError, match="a fault"):
        faulty.choice(found)
    with pytest.raises(TypeError, match="a fault"):
        faulty.bounds(found)
    assert replace(declared, bound=None).bounds(found) == []


def test_a_rival_with_an_exact_evidence_is_not_sampled():
    found = book_posterior("frame-averaging")
    declared = posteriors()["frame-averaging"]

    def sampled(model):
        raise AssertionError("not needed")

    rivals = [make(found.model) for make in declared.rivals]
    first, rival = compared(found, rivals, declared.evidence, sampled)
    assert first.less == first.error == rival.error == 0
    assert rival.sampled is None
    assert rival.less == rival.exact - first.exact
    assert abs(first.sampled.value - first.exact) < 4 * first.sampled.error
    with pytest.raises(AssertionError, match="not needed"):
        compared(found, rivals, None, sampled)


def test_facts_are_the_numbers_of_the_object():
    found = of_posteriors(["frame-averaging"])
    frame = rp.posterior("frame-averaging").frame()
    for label in ("transform-x-white", "misalignment-y-floor"):
        for what, column in (("mean", "mean"), ("sd", "deviation"), ("low", "low")):
            number, unit = found[f"posterior/frame-averaging#{label}-{what}"].split("\u202f")
            assert float(number) == pytest.approx(frame.loc[label, column], rel=0.06)
            assert unit == frame.loc[label, "unit"]
    replicates = calibrations.load("frame-averaging").replicates
    assert found["posterior/frame-averaging#sbc-replicates"] == str(replicates)
    printed = posteriors()["frame-averaging"].repeats(book_posterior("frame-averaging"))[0]
    assert found["posterior/frame-averaging#printed-count"] == str(len(printed))


def test_a_build_samples_once_and_keeps_the_chains_of_its_files_alone(tmp_path, monkeypatch):
    alone = book_posterior("frame-averaging")
    (tmp_path / "of other files").mkdir()
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    for cached in (computed.kept, book_posterior):
        cached.cache_clear()
    try:
        again = book_posterior("frame-averaging")
        book_posterior.cache_clear()
        monkeypatch.setattr(sampling, "run_ensemble", None)
        read = book_posterior("frame-averaging")
    finally:
        for cached in (computed.kept, book_posterior):
            cached.cache_clear()
    assert [path.name for path in tmp_path.iterdir()] == [computed.fingerprint()]
    for found in (again, read):
        np.testing.assert_array_equal(found.chain, alone.chain)
        assert found.rows() == alone.rows()


def test_evidence_of_a_floor_under_other_priors_is_a_reweighting():
    """The ratio of evidences is the mean ratio of the priors over the posterior."""
    found = book_posterior("frame-averaging")
    prior = found.model.parameters[1].prior
    floor = found.draws[:, 1]
    gains = summed_columns()[0].gains
    for factor, value in zip(FLOORS, gains, strict=True):
        other = replace(prior, sigma=factor * prior.sigma)
        ratio = np.exp(other.log_density(floor) - prior.log_density(floor))
        expected, error = ratio.mean(), ratio.std() / np.sqrt(len(ratio))
        assert abs(np.exp(value - gains[FLOORS.index(1)]) - expected) <= 4 * error
    assert max(gains) - min(gains) > 0.5


def test_evidence_of_a_floor_stands_in_the_table_of_the_rival():
    """The page of the model says the sum of what the table of the columns says."""
    declared = posteriors()["frame-averaging"]
    model = declared.model()
    (rival,) = (make(model) for make in declared.rivals)
    found = declared.evidence(model) - declared.evidence(rival)
    gains = [one.gains[FLOORS.index(1)] for one in summed_columns()]
    assert abs(found - sum(gains)) < 1e-6
    shown = re.findall(r"<td>([+−][0-9.]+)</td>", pages.columns_of_table_4().text)
    assert len(shown) == len(COLUMNS) * len(FLOORS)
    assert float(shown[1].replace("−", "-")) == pytest.approx(gains[0], abs=0.006)
