"""A reader's own seed: figures and tables of our own that draw random numbers take it."""

import sys

import numpy as np
import pytest

import reproduce as rp
from reproduce.judge.rerun import CannotChangeError
from reproduce.locate import papers
from reproduce.papers import declare
from reproduce.papers.catalogue import studies
from reproduce.papers.chen2023.platform import PIXEL
from reproduce.views.figure import Figure, drawable

SHOWN = [(Figure, key) for key in drawable()] + [(rp.table, key) for key in studies()]


def forget():
    """Empty everything that the papers' modules keep."""
    packages = tuple(f"reproduce.papers.{paper}." for paper in papers())
    for name, module in list(sys.modules.items()):
        if name.startswith(packages):
            for kept in vars(module).values():
                if hasattr(kept, "cache_clear"):
                    kept.cache_clear()


def content(shown):
    """Return every number of a figure or a table, to the last bit."""
    axes = getattr(shown.drawn, "axes", ()) if isinstance(shown, Figure) else ()
    images = [
        np.asarray(one.get_array()).tobytes() for each in axes for one in each.images
    ]
    return shown.frame().to_csv(), images


@pytest.mark.parametrize(("find", "key"), SHOWN)
def test_a_seed_reaches_every_random_number_or_is_refused(find, key, monkeypatch):
    """Without the project's own seed nothing else can be drawn."""
    shown = find(key)
    forget()
    with monkeypatch.context() as project:
        project.setattr(declare, "ROOT_SEED", "no seed")
        first = content(shown.rerun(seed=7) if shown.random else shown)
    if not shown.random:
        with pytest.raises(CannotChangeError, match=f"^seed: .*{key} "):
            shown.rerun(seed=7)
        return
    forget()
    again = shown.rerun(seed=7)
    assert content(shown) != first == content(again)
    assert again.changes == {"seed": "7"}
    assert "With seed = 7: your setting" in " ".join(str(again).split())


@pytest.mark.parametrize("name", ["seed", "data_seed"])
@pytest.mark.parametrize("wrong", ["a", 1.5, -1])
def test_a_seed_of_a_posterior_that_is_none_is_refused_in_our_words(name, wrong):
    with pytest.raises(
        (TypeError, ValueError), match=r"^seed: expected (a whole number|zero or|0 or)"
    ):
        rp.posterior("registration", **{name: wrong})


def test_a_seed_stays_through_other_changes():
    year = rp.table("chen2023/strategies")
    wider = year.rerun(seed=7).rerun({PIXEL: "30 um"})
    assert wider.changes == {PIXEL: "30 um", "seed": "7"}
    assert wider.frame().equals(year.rerun({PIXEL: "30 um"}, seed=7).frame())
    assert not wider.frame().equals(year.rerun({PIXEL: "30 um"}).frame())
    assert year.changes == {}


def test_a_figure_with_panels_is_a_list_that_shows_them():
    panels = rp.figure("chen2023/fig-10")
    assert [panel.key[-1] for panel in panels] == ["a", "b", "c"]
    assert panels._repr_html_().count("<figure") == 3
    assert repr(panels).count("reproduce figure chen2023/fig-10") == 3


@pytest.mark.parametrize(
    ("find", "key"), [(rp.figure, "chen2023/fig-8"), (rp.table, "chen2023/strategies")]
)
def test_a_seed_is_zero_or_more(find, key):
    with pytest.raises(CannotChangeError, match=r"^seed: .*got -1"):
        find(key).rerun(seed=-1)
