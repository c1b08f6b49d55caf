"""Seeds: all random figures and supplementary tables depend on the seed of a rerun."""

import sys

import numpy as np
import pytest
from commands import words

import reproduce as rp
from reproduce.judge.ledger import build
from reproduce.locate import papers
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023.platform import PIXEL
from reproduce.printed import inputs
from reproduce.views.figure import Figure, drawable

SHOWN = [(Figure, key) for key in drawable()]
SHOWN += [(rp.table, key) for key in catalogue("studies")]
SERIES = "chen2023/fig-8"


def clear_caches():
    """Clear the caches in the modules of the papers."""
    packages = tuple(f"reproduce.papers.{paper}." for paper in papers())
    modules = [
        module for name, module in sys.modules.items() if name.startswith(packages)
    ]
    for value in [value for module in modules for value in vars(module).values()]:
        getattr(value, "cache_clear", int)()


def content(shown):
    """Return every number of a figure or a table, to the last bit."""
    axes = getattr(shown.drawn, "axes", ()) if isinstance(shown, Figure) else ()
    images = [np.asarray(i.get_array()).tobytes() for ax in axes for i in ax.images]
    return shown.frame().to_csv(), images


@pytest.mark.parametrize("kind", [Figure, rp.table], ids=["figures", "tables"])
def test_a_seed_reaches_every_random_number_or_is_rejected(kind, monkeypatch):
    """Without the seed of the project, no other random number can be drawn."""
    build()  # drawings quote the ledger, which has the seed of the project
    for find, key in SHOWN:
        if find is not kind:
            continue
        shown = find(key)
        clear_caches()
        with monkeypatch.context() as project:
            project.setattr(inputs, "ROOT_SEED", "no seed")
            first = content(shown.rerun(seed=7) if shown.random else shown)
        if shown.random:
            clear_caches()
            again = shown.rerun(seed=7)
            assert content(shown) != first == content(again), key
            assert "seed = 7" in words(str(again))
            wrong = -1
        else:
            wrong = 7
        with pytest.raises(ValueError, match=r"^seed: "):
            shown.rerun(seed=wrong)


def test_a_seed_stays_with_other_changes_and_applies_to_random_panels():
    series = rp.figure(SERIES)
    wider = series.rerun(seed=7).rerun({PIXEL: "30 um"})
    assert wider.changes == {PIXEL: "30 um", "seed": "7"}
    assert wider.frame().equals(series.rerun({PIXEL: "30 um"}, seed=7).frame())
    panels = rp.figure("chen2023/fig-10").rerun(seed=7)
    assert [panel.changes for panel in panels] == [{}, {"seed": "7"}, {"seed": "7"}]
