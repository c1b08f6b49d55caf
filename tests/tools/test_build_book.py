"""A build removes what was made of other sources, and nothing else."""

from pathlib import Path

import pytest

from build_book import digests, drop_stale, remember

KINDS = (".jupyter_cache/executed", ".doctrees/page", "html/index.html")
SOURCES = (
    "src/module.py",
    "data/table.toml",
    "environment.txt",
    "book/page.md",
    "book/_static/style.css",
    "book/_ext/role.py",
    "book/_config.yml",
    "tools/run.py",
)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with files of each kind, built once."""
    for name in SOURCES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("first")
    assert not drop_stale(tmp_path)
    for kind in KINDS:
        path = tmp_path / "book/_build" / kind
        path.parent.mkdir()
        path.write_text("made before")
    remember(tmp_path, **digests(tmp_path))
    return tmp_path


def kept(checkout: Path) -> tuple[str, ...]:
    """Begin a build and return the files that it still has."""
    assert not drop_stale(checkout)
    return tuple(kind for kind in KINDS if (checkout / "book/_build" / kind).exists())


def test_an_unchanged_book_is_not_built_again(checkout):
    (checkout / "book/__pycache__").mkdir()
    (checkout / "book/__pycache__/role.pyc").write_text("")
    (checkout / "CONTRIBUTING.md").write_text("")
    assert drop_stale(checkout)
    (checkout / "book/_build/html/index.html").unlink()
    assert not drop_stale(checkout)


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("src/module.py", 0),
        ("src/added.py", 0),
        ("data/table.toml", 0),
        ("environment.txt", 0),
        ("book/_ext/role.py", 1),
        ("book/_config.yml", 1),
        ("tools/run.py", 1),
        ("book/page.md", 2),
        ("book/_static/style.css", 2),
    ],
)
def test_a_changed_source_removes_what_was_made_of_it(checkout, name, left):
    (checkout / name).write_text("changed")
    assert kept(checkout) == KINDS[:left]


def test_a_removed_source_counts_as_changed(checkout):
    (checkout / "src/module.py").unlink()
    assert kept(checkout) == ()


def test_a_build_that_was_cut_short_reads_all_pages_again(checkout):
    (checkout / "book/page.md").write_text("changed")
    assert kept(checkout) == KINDS[:2]
    assert kept(checkout) == KINDS[:1]


def test_a_damaged_note_removes_everything(checkout):
    (checkout / "book/_build/made-of.json").write_text('{"numbers"')
    assert kept(checkout) == ()
