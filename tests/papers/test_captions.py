"""Tests of the captions of supplementary tables and options."""

import tomllib

import pytest
from places import ROOT

from book_facts import of_study
from reproduce.locate import read_toml
from reproduce.papers._texts import Fact, ItemText
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import (
    Study,
    computations,
    drawing,
    item_text,
)

FOLDER = ROOT / "data" / "captions"


FILES = [path for path in sorted(FOLDER.glob("*.toml")) if path.stem != "posteriors"]


def test_every_text_is_used():
    for path in FILES:
        for name in tomllib.loads(path.read_text(encoding="utf-8")):
            key = f"{path.stem}/{name}"
            text = item_text(key)
            for option, alternatives in text.options.items():
                computed = [one.options.get(option) for one in computations(key)]
                assert alternatives in computed, option
            if text.alternative:
                assert drawing(key), key
            if text.columns:
                assert text.caption
                assert of_study(key).keys() == text.facts.keys(), key
            assert text.columns or text.alternative or key in catalogue(), key


@pytest.mark.parametrize("facts", [{"altitude": Fact(), "lost": Fact()}, {}])
def test_a_fact_without_a_value_or_a_format_is_named(facts, monkeypatch):
    text = item_text("chen2023/budget").model_copy(update={"facts": facts})
    monkeypatch.setattr(Study, "text", text)
    with pytest.raises(ValueError, match=r"budget: .*altitude"):
        of_study("chen2023/budget")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[heat]\ncaption = 3", "heat.caption"),
        ("[heat]\ncolumns = [{ name = 'K', from = '.2f' }]", "heat.columns.0.from"),
        ("[heat", "Expected"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_place(tmp_path, text, fault):
    path = tmp_path / "chen2023.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"chen2023\.toml") as refused:
        read_toml(path, dict[str, ItemText])
    assert fault in str(refused.value)
