"""The computation of the pages: fresh processes, cached outputs, failures by name."""

import os
from functools import partial
from pathlib import Path

import pytest

from run_notebooks import apart, cache_of, numbers, outputs, pages, run_tasks

PAGE = """---
file_format: mystnb
---

# A page

```{{code-cell}} ipython3
{}
```
"""


@pytest.fixture
def book(tmp_path: Path) -> Path:
    """A book whose numbers are computed."""
    (tmp_path / "_build").mkdir()
    (tmp_path / "_build/facts.json").write_text("{}")
    return tmp_path


def page(book: Path, name: str, code: str) -> Path:
    path = book / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(PAGE.format(code))
    return path


def run(book: Path) -> bool:
    """Run the pages, without the facts of the project."""
    tasks = {name: task for name, task in pages(book).items() if name != "facts"}
    return run_tasks(tasks, book, 2)


def shown(book: Path, path: Path) -> str:
    """Return the text that the cached outputs of a page show."""
    with cache_of(book) as cache:
        found = outputs(cache, path) or []
        return "".join(one["text"] for cell in found for one in cell)


@pytest.mark.slow
def test_pages_run_in_fresh_processes_and_are_kept(book, capsys):
    code = "import os\nleft = globals().get('left', 0) + 1\nprint(left, os.getcwd())"
    one = page(book, "one.md", code)
    two = page(book, "part/two.md", code + "  # another")
    assert {*pages(book)} == {"one.md", "part/two.md", "facts"}
    assert run(book)
    assert shown(book, one) == f"1 {book}\n"
    assert shown(book, two) == f"1 {book / 'part'}\n"
    assert capsys.readouterr().out.count(" s  ") == 2
    assert pages(book) == {}
    (book / "_build/facts.json").unlink()
    assert {*pages(book)} == {"facts"}


@pytest.mark.slow
def test_a_broken_page_is_named_and_the_others_are_kept(book, capsys):
    broken, sound = page(book, "broken.md", "1 / 0"), page(book, "sound.md", "print(1)")
    assert not run(book)
    error = capsys.readouterr().err
    assert "broken.md: " in error
    assert "ZeroDivisionError" in error
    assert shown(book, sound) == "1\n"
    with cache_of(book) as cache:
        assert outputs(cache, broken) is None


def test_numbers_are_computed_once(book):
    assert numbers(book) == {}
    (book / "_build/facts.json").unlink()
    expected = {"ledger", "posterior misalignment", "figure niu2024/fig-2"}
    assert expected < {*numbers(book)}


@pytest.mark.slow
def test_a_task_in_its_process_returns_or_raises():
    assert apart(partial(int, "1"))[1] == 1
    with pytest.raises(RuntimeError, match="ValueError"):
        apart(partial(int, "one"))
    with pytest.raises(RuntimeError, match="killed"):
        apart(partial(os._exit, 1))
