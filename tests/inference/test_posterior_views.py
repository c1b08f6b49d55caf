"""The command line and the pages of the posteriors."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import reproduce as rp
from book_facts import of_posteriors
from reproduce.inference import sampling
from reproduce.papers.posteriors import posteriors
from reproduce.printed.inputs import load_inputs
from reproduce.store import studies
from reproduce.views import computed
from reproduce.views import posteriors as pages
from reproduce.views.cli import main
from reproduce.views.posterior import book_posterior

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
    np.savetxt(
        path, rows, delimiter=",", header="x,y,x_reference,y_reference", comments=""
    )
    return path


def test_models_are_listed():
    listed = run("posterior", "--list").output
    pairs = re.findall(r"^ ?(\S+) +(niu2024|chen2023)", listed, re.MULTILINE)
    assert pairs == [(name, declared.paper) for name, declared in posteriors().items()]
    assert max(map(len, listed.splitlines())) <= 80
    words = " ".join(listed.split())
    for name, declared in posteriors().items():
        if not isinstance(declared.file, str):
            assert name in words
            assert all(column in words for column in declared.file.columns)
    assert list(json.loads(run("posterior", "--list", "--json").output)) == list(
        posteriors()
    )


@pytest.mark.parametrize("name", list(posteriors()))
def test_a_page_shows_every_posterior_with_its_model(name):
    (page,) = (text for text in PAGES if f'\nrp.posterior("{name}")\n' in text)
    assert page.count(f'rp.posterior("{name}").setup\n') == 1
    assert page.count(f'rp.posterior("{name}").corner(') == 1


def test_what_is_said_is_the_posterior_beside_the_print_and_its_verdict():
    name, address = "red-rotation", "niu2024/table-3#rotation.red"
    found = rp.posterior("registration-joint")
    assert found.declared.summary[name] == address
    row = found.frame().loc[name]
    (summary,) = (one for one in found.sampled.summaries() if one.name == name)
    shown = pages._summarised(found.name, summary, address).values()
    label, printed, mean, ends, truth, verdict = shown
    assert float(mean.split(" ± ")[0]) == pytest.approx(row["mean"], rel=1e-3)
    assert float(mean.split(" ± ")[1].rstrip("°")) == pytest.approx(
        row["deviation"], rel=0.05
    )
    low, high = (float(end.rstrip("°")) for end in ends.split(" to "))
    assert (low, high) == pytest.approx((row["low"], row["high"]), rel=0.01)
    assert float(truth.rstrip("°")) == pytest.approx(found.truth[name], rel=1e-5)
    cell = rp.table("niu2024/table-3")["rotation.red"]
    assert f">{cell.printed}" in printed
    assert f">{cell.verdict}<" in verdict
    assert 'href="#posterior-registration-joint"' in label


def test_a_posterior_shows_the_truth_of_simulated_data_and_what_was_changed(tmp_path):
    book = rp.posterior("registration")
    html = book._repr_html_()
    assert "data simulated by us" in html.partition("</caption>")[0]
    assert f"<td>{book.truth['scale']:.6g}</td>" in html
    assert 'id="posterior-registration"' in html
    assert "Orange: truth of the simulation" in book.corner().text
    own = rp.posterior(
        "registration", stars_file(tmp_path), steps=600, priors={"noise": (0.01, 1)}
    )
    html = own._repr_html_()
    assert "data of stars.csv, 60 rows, pivot" in html
    assert "the mean of the stars. Changed: prior of noise, steps = 600." in html
    assert "truth" not in html
    assert "id=" not in html
    cut = own.rerun(priors={"noise": (0.01, 0.1)})
    assert "Warning: noise piles up" in repr(cut)
    assert "Warning: noise piles up" in cut._repr_html_()
    assert "truth" not in own.corner().text


def test_the_model_as_code_holds_data_priors_and_likelihood():
    for name, declared in posteriors().items():
        source = rp.posterior(name).source
        assert source.startswith(f"def {declared.build.__name__}(")
        assert "\ndef __call__(self, parameters" in source
    shown = rp.posterior("misalignment").setup._repr_html_()
    assert "Data simulated by us with printed settings of chen2023." in shown
    for parameter in rp.posterior("misalignment").model.parameters:
        assert parameter.prior.reason in shown
    assert f"def {posteriors()['misalignment'].build.__name__}(" in shown


def test_a_corner_plot_has_five_parameters_at_most_and_readable_labels():
    book = rp.posterior("registration-joint")
    html = book.corner().text
    sizes = [float(size) for size in re.findall(r"font-size: ([\d.]+)px", html)]
    assert len(sizes) > 5
    assert min(size for size in sizes if size != 5.6) >= 8, "indices of symbols apart"
    # Drawn twice: for a wide page and for a narrow one.
    assert len(html) < 200_000
    names = book.model.names
    for wrong in (names[:6], (names[0], names[0]), ("nothing",)):
        with pytest.raises(ValueError, match="names: "):
            book.corner(*wrong)


def test_facts_are_the_numbers_of_the_object():
    found = of_posteriors(["misalignment"])
    frame = rp.posterior("misalignment").frame()
    for label in ("angle-x", "angle-z"):
        for what, column in (("mean", "mean"), ("sd", "deviation"), ("low", "low")):
            text = found[f"posterior/misalignment#{label}-{what}"].replace("−", "-")
            number, unit = text.split("\u202f")
            assert float(number) == pytest.approx(frame.loc[label, column], rel=0.06)
            assert unit == frame.loc[label, "unit"]
    rows = studies.table("calibrations").query("posterior == 'misalignment'")
    replicates = rows["replicates"].iloc[0]
    assert found["posterior/misalignment#sbc-replicates"] == f"{replicates:,}"


def test_table_3_scatters_more_than_one_noise_allows():
    """Against repeats of the whole table, with the noise of the posterior."""
    printed = load_inputs(["chen2023/table-3"]).array("chen2023/table-3") / 3
    found = book_posterior("misalignment")
    noise = found.draws[:, found.model.names.index("noise")].mean()
    repeats = np.sqrt(np.random.default_rng(2).chisquare(799, (20_000, 16)) / 799)
    furthest = np.quantile(np.abs(np.log(repeats)).max(axis=1), 0.95)
    assert (np.abs(np.log(printed / noise)) > furthest).sum() > 1


def test_a_build_samples_once(tmp_path, monkeypatch):
    alone = book_posterior("registration")
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    for cached in (computed.kept, book_posterior):
        cached.cache_clear()
    try:
        again = book_posterior("registration")
        book_posterior.cache_clear()
        monkeypatch.setattr(sampling, "run_ensemble", None)
        read = book_posterior("registration")
        assert read.summaries() == alone.summaries()
    finally:
        for cached in (computed.kept, book_posterior):
            cached.cache_clear()
    assert [path.name for path in tmp_path.iterdir()] == [computed._fingerprint()]
    for found in (again, read):
        np.testing.assert_array_equal(found.chain, alone.chain)
        assert found.rows == alone.rows


def test_simulated_data_are_drawn_again_with_a_seed_of_their_own():
    """The sampler's seed is another one; a reader's own data have none."""
    book, again = (
        rp.posterior("registration"),
        rp.posterior("registration", data_seed=1),
    )
    assert (book.model.likelihood.source != again.model.likelihood.source).all()
    assert again.rerun(steps=50).changes == "data_seed = 1, steps = 50"
    assert book.truth == again.truth
    assert again.changes == "data_seed = 1"
    with pytest.raises(ValueError, match="data_seed: expected none"):
        rp.posterior("registration", data_seed=1, data="stars.csv")


def test_all_posteriors_show_themselves_and_name_their_files():
    everything = rp.posterior()
    assert "centroid noise" in repr(everything)
    assert "group, laser, x, y" in repr(everything.models)
    with pytest.raises(TypeError, match=r"^name: "):
        rp.posterior(data="stars.csv")


def test_every_quantity_of_the_table_exists():
    for one in posteriors().values():
        model = one.model()
        points = model.start(np.random.default_rng(1), 4)
        assert set(one.summary) <= {*model.names, *model.consequences(points)}


def test_free_directions_of_the_lasers_leave_the_uncertainties():
    """The first group then measures the directions, and the motion of the spots the angle."""
    found = book_posterior("misalignment")
    likelihood = found.model.likelihood
    centre, spread = likelihood.start()
    first, second = likelihood.statistics.counts
    response = likelihood.linearised(centre, spread[:-1])[0][:, 3:6]
    noise = centre[-1] ** 2 * (1 + second / first)
    covariance = np.linalg.inv(response.T @ response) * noise
    errors = found.draws[:, 3:6].std(axis=0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(covariance)), errors, rtol=0.03)
