"""The front door: every name, and what each object shows."""

import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest

import reproduce
import reproduce as rp
from reproduce.judge.ledger import build
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import library

ROOMS = [path.parent.name for path in Path(reproduce.__file__).parent.glob("*/__init__.py")]


def fresh(code):
    """Run code in a fresh interpreter and return what it prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
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
    told = fresh(f"import sys, reproduce; print([n for n in {heavy} if n in sys.modules])")
    assert told == "[]"


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match="has no attribute 'tabel'"):
        _ = rp.tabel
    assert set(rp.__all__) <= set(dir(rp))


@pytest.mark.parametrize("key", list(library()))
def test_every_table_shows_itself_and_gives_its_frame(key):
    table = rp.table(key)
    assert key in repr(table)
    assert max(map(len, repr(table).splitlines())) <= 80
    assert f'id="{key.replace("/", "-")}"' in table._repr_html_()
    frame, records = table.frame(), build([key]).of(key)
    verdicts = frame.filter(regex="verdict") if frame.columns.nlevels == 1 else frame.xs(
        "verdict", axis=1, level=1
    )  # fmt: skip
    assert sorted(verdicts.to_numpy().ravel()) == sorted(record.verdict for record in records)
    assert list(table.cells()["cell"]) == [record.cell for record in records]


def test_a_cell_tells_all_that_is_known_of_it():
    cell = rp.table("niu2024/table-2#scale.red")
    assert (cell.printed, cell.verdict) == ("0.9976", "exact")
    assert cell.computed == pytest.approx(0.9976, abs=5e-5)
    assert cell.reads == rp.table("niu2024/table-2")["scale.red"].reads
    assert "def true_scale" in cell.source
    assert "niu2024/table-1#focal-length.red" in repr(cell)
    assert "<table" in cell._repr_html_()
    assert cell.frame().loc["verdict"].item() == "exact"


def test_rerun_shows_print_value_and_difference_without_a_verdict():
    found = rp.table("niu2024/table-3").rerun({"niu2024/text-simulation#noise": "0.2 px"}, seed=7)
    row = found.frame().loc["scale.red"]
    assert row["printed"] == "0.9973"
    assert row["changed - printed"] == row["changed"] - 0.9973
    assert row["low"] < row["changed"] < row["high"]
    for shown in (repr(found), found._repr_html_()):
        assert "noise = 0.2 px" in shown
        assert "seed = 7" in shown
        for verdict in ("differs", "consistent", "exact"):
            assert verdict not in shown
    alone = rp.table("niu2024/table-3#scale.red").rerun(seed=7)
    assert list(alone.frame().index) == ["scale.red"]


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
        (lambda: rp.posterior("nothing"), "unknown posterior"),
        (lambda: rp.posterior("registration", thin=2), "unknown settings"),
        (lambda: rp.contradictions("nobody1999"), "expected one of niu2024, chen2023"),
    ],
)
def test_slips_are_told(call, message):
    with pytest.raises((ValueError, KeyError, TypeError), match=message):
        call()


def test_contents_and_check_stand_on_the_whole_ledger():
    frame = rp.contents().frame()
    assert list(frame.index) == list(catalogue())
    assert frame["differs"].sum() == sum(r.verdict == "differs" for r in build().records)
    assert "niu2024/table-3" in repr(rp.contents())
    found = rp.check()
    assert bool(found)
    assert found.frame().empty
    assert "as frozen" in repr(found)


def test_a_verdict_that_is_not_frozen_makes_the_check_false(monkeypatch):
    from reproduce.judge import expected
    from reproduce.views import front

    other = {"niu2024/table-2#scale.red": expected.Expectation("differs", "made up")}
    real = expected.frozen
    monkeypatch.setattr(
        expected, "frozen", lambda key: real(key) | (other if key == "niu2024/table-2" else {})
    )
    found = front.check()
    assert not found
    assert found.frame()["cell"].tolist() == ["niu2024/table-2#scale.red"]


def test_a_posterior_is_sampled_when_looked_at_and_rerun_with_a_change(tmp_path):
    plain = rp.posterior("frame-averaging")
    assert "draws_of" not in vars(plain), "nothing is sampled yet"
    assert plain.reads
    assert list(plain.frame().index)[:2] == list(plain.priors.index)[:2]
    assert len(plain.draws) == plain.draws_of.draws.shape[0]
    assert "as printed" in repr(plain)
    assert "<svg" in plain.corner()._repr_html_()
    other = plain.rerun(seed=3)
    assert other.frame().loc["white", "mean"] != plain.frame().loc["white", "mean"]
    stars = tmp_path / "stars.csv"
    generator = np.random.default_rng(1)
    source = generator.uniform(0, 1000, (60, 2))
    rows = np.column_stack([source, source - [3, 0] + 0.1 * generator.normal(size=(60, 2))])
    np.savetxt(stars, rows, delimiter=",", header="x,y,x_reference,y_reference", comments="")
    mine = rp.posterior("registration").rerun(data=stars)
    assert mine.where == "data of stars.csv"
    assert mine.frame().loc["shift-x", "mean"] == pytest.approx(3, abs=0.1)


def test_contradictions_give_the_register_and_the_relations():
    found = rp.contradictions("chen2023")
    assert "chen2023-table-5-motion" in found.frame().index
    assert "contradicts" in set(found.relations()["outcome"])
    assert len(repr(found).splitlines()) > 20


def test_stars_of_ones_own_are_registered():
    source = np.array([[0.0, 0], [1000, 0], [0, 1000], [1000, 1000]])
    fit = rp.register(source, 1.001 * source + np.array([3, -2]))
    assert fit.parameters[0] == pytest.approx(1.001)
    assert rp.register(source, np.add(source, [3, -2]), (0, 0), model="shift").model == "shift"


def test_cells_are_cited_by_their_own_address():
    text = rp.cite("niu2024/table-3#scale.red")
    assert "reproduce-niu2024-table-3-scale-red" in text
    assert r"Cell niu2024/table-3\#scale.red" in text
    assert "Item niu2024/table-3" in rp.cite("niu2024/table-3")
