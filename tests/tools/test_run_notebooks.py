"""Tasks run in order and side by side; a notebook runs in a kernel of its own and is kept."""

import threading
from pathlib import Path

import pytest

import run_notebooks
import warm_kernels
from run_notebooks import Task, cache_of, executing, held, in_order, read, run_all

PAGE = """---
file_format: mystnb
kernelspec:
  name: python3
---

# A page

```{{code-cell}} ipython3
{}
```
"""


def failing() -> None:
    raise ValueError("no")


def names(tasks: list[Task], workers: int = 1) -> list[str]:
    return [task.name for task, _, _ in in_order(tasks, workers)]


def test_a_task_waits_for_what_it_needs_and_the_others_do_not() -> None:
    second = Task("second", lambda: None, frozenset({"first"}))
    tasks = [second, Task("alone", lambda: None), Task("first", lambda: None)]
    assert names(tasks) == ["alone", "first", "second"]


def test_tasks_run_side_by_side() -> None:
    both = threading.Barrier(2, timeout=10)
    found = list(in_order([Task("a", both.wait), Task("b", both.wait)], 2))
    assert [future.exception() for _, future, _ in found] == [None, None]


def test_what_needs_a_task_that_failed_is_not_run() -> None:
    tasks = [
        Task("fails", failing),
        Task("after", lambda: None, frozenset({"fails"})),
        Task("alone", lambda: None),
    ]
    assert names(tasks) == ["fails", "alone"]


@pytest.fixture
def book(tmp_path: Path) -> Path:
    """A book whose numbers stand already."""
    for name in ("_build/facts.json", "_extra/ledger.json"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("{}")
    return tmp_path


def page(book: Path, name: str, code: str) -> Path:
    path = book / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(PAGE.format(code))
    return path


def shown(book: Path, path: Path) -> str:
    """Return what the cached notebook of a page shows."""
    with cache_of(book) as cache:
        _, notebook = cache.merge_match_into_notebook(read(path))
    return "".join(
        output["text"] for cell in notebook.cells for output in cell.get("outputs", [])
    )


@pytest.mark.slow
def test_notebooks_run_apart_from_each_other_in_warm_kernels(book, capsys) -> None:
    code = "import os, sys\nleft = globals().get('left', 0) + 1\n"
    code += "print(left, 'pandas' in sys.modules, os.getcwd())"
    one, two = (
        page(book, "one.md", code),
        page(book, "part/two.md", code + "  # another"),
    )
    assert run_all(book, 2)
    assert shown(book, one) == f"1 True {book}\n"
    assert shown(book, two) == f"1 True {book / 'part'}\n"
    assert capsys.readouterr().out.count(" s  ") == 2
    assert run_all(book, 2)
    assert capsys.readouterr().out == "", "both were kept"


@pytest.mark.slow
def test_pieces_of_one_stream_are_one_output(book) -> None:
    """Where a kernel cuts a stream hangs on the moment, and the page would differ."""
    path = page(
        book, "one.md", "import time\nprint(1, flush=True)\ntime.sleep(1)\nprint(2)"
    )
    assert run_all(book, 1)
    with cache_of(book) as cache:
        _, notebook = cache.merge_match_into_notebook(read(path))
    assert [
        one["text"] for cell in notebook.cells for one in cell.get("outputs", [])
    ] == ["1\n2\n"]


@pytest.mark.slow
def test_a_figure_is_an_output_of_a_warm_kernel(book) -> None:
    path = page(
        book, "one.md", "import matplotlib.pyplot as plt\nline = plt.plot([1, 2])"
    )
    assert run_all(book, 1)
    with cache_of(book) as cache:
        _, notebook = cache.merge_match_into_notebook(read(path))
    outputs = [one for cell in notebook.cells for one in cell.get("outputs", [])]
    assert [sorted(one["data"]) for one in outputs] == [["image/png", "text/plain"]]


@pytest.mark.slow
def test_a_broken_notebook_is_named_and_fails_the_build(book, capsys) -> None:
    page(book, "broken.md", "1 / 0")
    page(book, "sound.md", "print(1)")
    assert not run_all(book, 2)
    heard = capsys.readouterr()
    assert "broken.md: " in heard.err
    assert "ZeroDivisionError" in heard.err
    assert "sound.md" in heard.out
    with cache_of(book) as cache:
        assert not held(cache, read(book / "broken.md"))


def test_a_page_of_a_posterior_waits_until_it_is_sampled(book) -> None:
    page(book, "plain.md", "1")
    page(book, "sampled.md", "rp.posterior('registration')")
    before = frozenset({"ledger", "posterior registration"})
    with cache_of(book) as cache:
        tasks = list(executing(book, cache, before))
    assert [(task.name, task.needs) for task in tasks] == [
        ("sampled.md", before),
        ("plain.md", {"ledger"}),
    ]


def test_numbers_are_computed_once(book) -> None:
    assert run_notebooks.computing(book) == []
    (book / "_build/facts.json").unlink()
    *first, facts = run_notebooks.computing(book)
    assert facts.name == "facts"
    names = {task.name for task in first}
    assert names > {"ledger", "posterior misalignment", "figure niu2024/fig-2"}
    assert facts.needs == {name for name in names if not name.startswith("figure ")}


@pytest.mark.slow
def test_a_function_that_fails_in_its_fork_fails_here() -> None:
    warm_kernels.start()
    warm_kernels.run(int, "1")
    with pytest.raises(RuntimeError, match="exit code 1"):
        warm_kernels.run(int, "one")
