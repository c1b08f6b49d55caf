"""The texts of our own tables and options: their files are checked, and hold nothing unused."""

import fnmatch
import re
import tomllib
from pathlib import Path

import pytest

from reproduce.papers.catalogue import catalogue, drawings, studies
from reproduce.papers.declare import item_text, parsed
from reproduce.printed.cells import library

FOLDER = Path(__file__).parents[2] / "data" / "captions"


FILES = [path for path in sorted(FOLDER.glob("*.toml")) if path.stem != "posteriors"]


def test_every_text_of_all_posteriors_is_shown():
    path = FOLDER.parents[1] / "src" / "reproduce" / "views" / "posteriors.py"
    shown = re.findall(
        r'item_text\("posteriors/([^"]+)"\)', path.read_text(encoding="utf-8")
    )
    texts = tomllib.loads((FOLDER / "posteriors.toml").read_text(encoding="utf-8"))
    assert sorted(shown) == sorted(texts)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_text_belongs_to_a_table_or_to_an_item_with_options(path):
    for name in tomllib.loads(path.read_text(encoding="utf-8")):
        key = f"{path.stem}/{name}"
        text = item_text(key)
        if text.options or text.unpublished:
            made = catalogue()[key].computations
            for option, ways in text.options.items():
                assert any(dict(one.options.get(option, {})) == ways for one in made), (
                    option
                )
                assert len(ways) > 1
                assert all(way.text and way.place for way in ways.values())
            cells = [cell.name for cell in library()[key].cells]
            for pattern in text.unpublished:
                assert fnmatch.filter(cells, pattern), pattern
        elif text.figure.alternative:
            own = key in drawings()
            assert own or catalogue()[key].draw, key
        else:
            # Heads and captions that say what a constant is are in code.
            assert text.columns in ((), studies()[key].columns), key
            assert text.caption in ("", studies()[key].caption), key
            assert text.columns or text.caption, key


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[heat]\ncaption = 3", "heat.caption"),
        ("[heat]\ncolumns = [{ name = 'K', from = '.2f' }]", "heat.columns.0.from"),
        ("[heat", "Expected"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_place(text, fault):
    with pytest.raises(ValueError, match=r"chen2023\.toml") as refused:
        parsed(text, Path("chen2023.toml"))
    assert fault in str(refused.value)
