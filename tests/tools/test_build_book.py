"""A build removes the results of other sources, and keeps the others."""

import pytest

from build_book import digests, drop_stale, remember

# Results of the numbers, of all pages, and of single pages, with a source of each.
KINDS = (".jupyter_cache/executed", ".doctrees/page", "html/index.html")
NUMBERS = ("src/module.py", "data/table.toml", "environment.txt")
PAGES = ("book/_ext/role.py", "book/_config.yml", "tools/run.py")
SINGLE = ("book/page.md", "book/_static/style.css")


@pytest.fixture
def checkout(tmp_path):
    """Return a checkout with files of each kind, built once."""
    for name in (*NUMBERS, *PAGES, *SINGLE):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("first")
    assert not drop_stale(tmp_path)
    rebuild(tmp_path)
    return tmp_path


def rebuild(checkout):
    for kind in KINDS:
        path = checkout / "book/_build" / kind
        path.parent.mkdir(exist_ok=True)
        path.write_text("built")
    remember(checkout, **digests(checkout))


def kept(checkout):
    """Begin a build and return the number of kinds of files that it keeps."""
    assert not drop_stale(checkout)
    found = [(checkout / "book/_build" / kind).exists() for kind in KINDS]
    assert found == sorted(found, reverse=True)
    return sum(found)


def test_an_unchanged_book_is_not_built_again(checkout):
    for name in ("book/__pycache__/role.pyc", "CONTRIBUTING.md"):
        (checkout / name).parent.mkdir(exist_ok=True)
        (checkout / name).write_text("")
    assert drop_stale(checkout)
    (checkout / "book/_build/html/index.html").unlink()
    assert not drop_stale(checkout)


def test_a_changed_source_removes_its_results(checkout):
    for count, names in enumerate(((*NUMBERS, "src/added.py"), PAGES, SINGLE)):
        for name in names:
            (checkout / name).write_text("changed")
            assert kept(checkout) == count, name
            rebuild(checkout)
    (checkout / "src/module.py").unlink()
    assert kept(checkout) == 0


def test_an_interrupted_build_reads_all_pages_again(checkout):
    (checkout / "book/page.md").write_text("changed")
    assert kept(checkout) == 2
    assert kept(checkout) == 1
    rebuild(checkout)
    (checkout / "book/_build/made-of.json").write_text('{"numbers"')
    assert kept(checkout) == 0, "a damaged note"
