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
from reproduce.store import studies
from reproduce.views import computed
from reproduce.views import posteriors as pages
from reproduce.views.cli import main
from reproduce.views.posterior import book_posterior

FOLDER = Path(__file__).parents[2] / "book" / "posteriors"
PAGES = [path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))]


def run(*arguments):
    return CliRunner().invoke(main, ["posterior", *arguments]).output


def stars_file(tmp_path):
    generator = np.random.default_rng(1)
    source = generator.uniform(0, 1000, (60, 2))
    target = source - [3.0, 0] + 0.1 * generator.normal(size=source.shape)
    path, header = tmp_path / "stars.csv", "x,y,x_reference,y_reference"
    rows = np.column_stack([source, target])
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path


def test_models_are_listed_with_their_columns():
    listed = run("--list")
    pairs = re.findall(r"^ ?(\S+) +(niu2024|chen2023)", listed, re.MULTILINE)
    assert pairs == [(name, declared.paper) for name, declared in posteriors().items()]
    assert max(map(len, listed.splitlines())) <= 80
    words = " ".join(listed.split())
    for declared in posteriors().values():
        if not isinstance(declared.file, str):
            assert all(column in words for column in declared.file.columns)
    assert list(json.loads(run("--list", "--json"))) == list(posteriors())


def test_a_page_shows_every_posterior_with_its_model():
    for name, declared in posteriors().items():
        (page,) = (text for text in PAGES if f'\nrp.posterior("{name}")\n' in text)
        assert page.count(f'rp.posterior("{name}").setup\n') == 1
        assert page.count(f'rp.posterior("{name}").corner(') == 1
        source = rp.posterior(name).source
        assert source.startswith(f"def {declared.build.__name__}(")
        assert "\ndef __call__(self, parameters" in source
    shown = rp.posterior("misalignment").setup._repr_html_()
    for parameter in rp.posterior("misalignment").model.parameters:
        assert parameter.prior.reason in shown


def test_a_summary_contains_the_printed_number_and_its_verdict():
    name, address = "red-rotation", "niu2024/table-3#rotation.red"
    found = rp.posterior("registration-joint")
    assert found.declared.summary[name] == address
    row = found.frame().loc[name]
    (summary,) = (one for one in found.sampled.summaries() if one.name == name)
    shown = pages._summarised(found.name, summary, address).values()
    label, printed, mean, ends, truth, verdict = shown
    numbers = [float(x.rstrip("°")) for x in (*mean.split(" ± "), *ends.split(" to "))]
    expected = row[["mean", "deviation", "low", "high"]].tolist()
    assert numbers == pytest.approx(expected, rel=0.05)
    assert float(truth.rstrip("°")) == pytest.approx(found.truth[name], rel=1e-5)
    cell = rp.table("niu2024/table-3")["rotation.red"]
    assert f">{cell.printed}" in printed
    assert f">{cell.verdict}<" in verdict
    assert 'href="#posterior-registration-joint"' in label


def test_a_posterior_shows_the_truth_of_simulated_data_and_the_changes(tmp_path):
    book = rp.posterior("registration")
    html = book._repr_html_()
    assert f"<td>{book.truth['scale']:.6g}</td>" in html
    assert 'id="posterior-registration"' in html
    assert "truth" in book.corner().text
    path, noise = stars_file(tmp_path), {"noise": (0.01, 1)}
    yours = rp.posterior("registration", path, steps=600, priors=noise)
    html = yours._repr_html_()
    assert "stars.csv, 60 rows, pivot" in html
    assert "Changed: prior of noise, steps = 600." in html
    assert "id=" not in html
    assert "truth" not in html + yours.corner().text
    cut = yours.rerun(priors={"noise": (0.01, 0.1)})
    for text in (repr(cut), cut._repr_html_()):
        assert "Warning: noise piles up" in text


def test_a_corner_plot_has_five_parameters_at_most_and_readable_labels():
    book = rp.posterior("registration-joint")
    html = book.corner().text
    sizes = [float(size) for size in re.findall(r"font-size: ([\d.]+)px", html)]
    assert len(sizes) > 5
    assert min(size for size in sizes if size != 5.6) >= 8, "indices of symbols apart"
    # It is drawn twice, for a wide page and for a narrow one.
    assert len(html) < 200_000
    names = book.model.names
    for wrong in (names[:6], (names[0], names[0]), ("nothing",)):
        with pytest.raises(ValueError, match="names: "):
            book.corner(*wrong)


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
    direct = book_posterior("registration")
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    try:
        for cached in (computed.kept, book_posterior):
            cached.cache_clear()
        again = book_posterior("registration")
        book_posterior.cache_clear()
        monkeypatch.setattr(sampling, "run_ensemble", None)
        read = book_posterior("registration")
        assert read.summaries() == direct.summaries()
    finally:
        for cached in (computed.kept, book_posterior):
            cached.cache_clear()
    assert [path.name for path in tmp_path.iterdir()] == [computed._fingerprint()]
    for found in (again, read):
        np.testing.assert_array_equal(found.chain, direct.chain)


def test_simulated_data_have_a_separate_seed():
    """The sampler has another one, and your data have no seed."""
    book = rp.posterior("registration")
    again = rp.posterior("registration", data_seed=1)
    assert (book.model.likelihood.source != again.model.likelihood.source).all()
    assert again.rerun(steps=50).changes == "data_seed = 1, steps = 50"
    assert book.truth == again.truth
    with pytest.raises(ValueError, match="data_seed: "):
        rp.posterior("registration", data_seed=1, data="stars.csv")
    with pytest.raises(TypeError, match=r"^name: "):
        rp.posterior(data="stars.csv")
