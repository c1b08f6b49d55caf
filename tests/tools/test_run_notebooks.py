"""The computation of the pages: new processes, cached outputs, failures by name."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

import run_notebooks
from run_notebooks import apart, cache_of, numbers, outputs, pages, run_tasks

PAGE = "---\nfile_format: mystnb\n---\n\n# A page\n\n```{code-cell} ipython3\n%s\n```\n"
COUNT = "import os\nleft = globals().get('left', 0) + 1\nprint(left, os.getcwd())"


@pytest.mark.slow
def test_pages_run_in_new_processes_and_are_stored(tmp_path, capsys):
    def run():
        """Run the pages, without the facts of the project."""
        tasks = {
            name: task for name, task in pages(tmp_path).items() if name != "facts"
        }
        return run_tasks(tasks, tmp_path, 2)

    def shown(name):
        """Return the text that the cached outputs of a page show."""
        with cache_of(tmp_path) as cache:
            cells = outputs(cache, tmp_path / name)
        return cells and "".join(one["text"] for cell in cells for one in cell)

    facts = tmp_path / "_build/facts.json"
    for folder in ("_build", "part"):
        (tmp_path / folder).mkdir()
    assert {"ledger", "posterior misalignment"} < {*numbers(tmp_path)}
    facts.write_text("{}")
    assert numbers(tmp_path) == {}
    (tmp_path / "one.md").write_text(PAGE % COUNT)
    (tmp_path / "part/two.md").write_text(PAGE % f"{COUNT}  # another")
    assert {*pages(tmp_path)} == {"one.md", "part/two.md", "facts"}
    assert run()
    assert shown("one.md") == f"1 {tmp_path}\n"
    assert shown("part/two.md") == f"1 {tmp_path / 'part'}\n"
    assert pages(tmp_path) == {}
    # A page that fails is named; the others are stored.
    (tmp_path / "broken.md").write_text(PAGE % "1 / 0")
    (tmp_path / "one.md").write_text(PAGE % "print(1)")
    assert not run()
    error = capsys.readouterr().err
    assert "broken.md: " in error
    assert "ZeroDivisionError" in error
    assert (shown("one.md"), shown("broken.md")) == ("1\n", None)


@pytest.mark.slow
def test_a_task_in_its_process_returns_or_raises():
    assert apart(partial(int, "1"))[1] == 1
    for task, error in (
        (partial(int, "one"), "ValueError"),
        (partial(os._exit, 1), "killed"),
    ):
        with pytest.raises(RuntimeError, match=error):
            apart(task)


LOADED = """
import sys
from functools import partial
sys.path.insert(0, sys.argv[1])
import run_notebooks as run
run.prepare()
_, loaded = run.apart(partial(eval, "{*__import__('sys').modules}"))
print(*{*run.PRELOADED.split()} - loaded)
"""


@pytest.mark.nightly
def test_a_task_finds_all_libraries_loaded(tmp_path):
    """The folder of the modules is not the present one, and in no variable."""
    command = [sys.executable, "-c", LOADED, Path(run_notebooks.__file__).parent]
    assert subprocess.check_output(command, cwd=tmp_path, text=True) == "\n"
