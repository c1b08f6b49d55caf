"""Let mutants of the code meet its tests, each in a process of its own, in copies of the checkout.

A mutant first meets the tests that run the changed line; one that outlives them meets the other
tests of its folder as well.
"""

from __future__ import annotations

import ast
import importlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import pytest
from coverage import CoverageData

from mutants import Mutant, mutated

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path("src/reproduce")
FOLDERS = ("physics", "printed", "audit")
TESTS = tuple(f"{above}/{folder}" for above in ("tests", PACKAGE) for folder in FOLDERS)
COPIED = ("src", "tests", "data", "tools", "pyproject.toml")
# Imported once, before the processes of the mutants are forked off.
LIBRARIES = (
    "numpy.testing scipy.integrate scipy.interpolate scipy.ndimage scipy.optimize scipy.signal "
    "scipy.spatial.transform scipy.special scipy.stats erfa pint pydantic pandas networkx "
    "hypothesis.strategies hypothesis.extra.numpy cv2 skimage.transform skimage.measure"
).split()
ALREADY = (
    "-W",
    "ignore::pytest.PytestAssertRewriteWarning",
)  # since they are imported before
# Processor time that a mutant may take: so much, and so many times what its tests take unchanged.
SECONDS, TIMES = 10, 4
MEMORY = 6 * 2**30
COVER = ("--cov=reproduce", "--cov-context=test", "--cov-report=", "--cov-fail-under=0")


@dataclass(frozen=True)
class Map:
    """Which tests run which line.

    Parameters
    ----------
    tests : dict
        Tests by file (below the package) and line; a test by its pytest name.
    seconds : dict
        What each test takes.
    """

    tests: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]

    def of(self, one: Mutant, source: str) -> list[str]:
        """Return the tests that run the changed statement, the quickest first.

        What runs on import alone (a constant, a default) is run by all tests of the file.
        """
        lines = self.tests.get(one.file, {})
        first, last = _statement(source, one.line)
        found = {
            test for line in range(first, last + 1) for test in lines.get(line, ())
        }
        if not found:
            found = {test for line in lines.values() for test in line}
        return sorted(found, key=lambda test: (self.seconds[test], test))


def _statement(source: str, line: int) -> tuple[int, int]:
    """Return the first and last line of the innermost statement, without the body, at a line."""
    found = (line, line)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (
            node.end_lineno or node.lineno
        ):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if body else node.end_lineno or node.lineno
            if line <= last or not body:
                found = (node.lineno, max(last, node.lineno))
    return found


class Only:
    """A pytest plugin that keeps some tests, in a given order, and notes the one that fails."""

    def __init__(self, wanted: Sequence[str] | None, note: Path) -> None:
        self.wanted = wanted
        self.note = note
        self.seconds: dict[str, float] = {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the wanted tests; all of their files where the change has renamed some."""
        known = {item.nodeid: item for item in items}
        wanted = known if self.wanted is None else self.wanted
        items[:] = [
            known[name] for name in (wanted if known.keys() >= set(wanted) else known)
        ]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, bool, bool]:
        """Note the processor time."""
        start = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - start
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the name of a test that fails."""
        if report.failed:
            self.note.write_text(report.nodeid, encoding="utf-8")

    def pytest_sessionfinish(self) -> None:
        """Store the times."""
        self.note.with_suffix(".json").write_text(
            json.dumps(self.seconds), encoding="utf-8"
        )


def _pytest(tree: Path, wanted: Sequence[str] | None, *options: str) -> None:
    """Run some tests of a copy in this process, and end it."""
    note = tree / "note.txt"
    note.unlink(missing_ok=True)
    files = (
        TESTS
        if wanted is None
        else sorted({name.partition("::")[0] for name in wanted})
    )
    sys.path[:0] = [str(tree / "src")]
    os.chdir(tree)
    with (tree / "log.txt").open("w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        quiet = [
            "-qq",
            "-x",
            "--tb=line",
            "-p",
            "no:cacheprovider",
            f"--rootdir={tree}",
            *ALREADY,
        ]
        code = pytest.main([*quiet, *options, *files], plugins=[Only(wanted, note)])
        sys.stdout.flush()
        os._exit(code)


def _forked(tree: Path, wanted: Sequence[str] | None, limit: float) -> int:
    """Run tests in a process of its own; return its exit code, negative for a signal."""
    child = os.fork()
    if child == 0:
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (round(limit), round(limit) + 1))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            _pytest(tree, wanted)
        finally:
            traceback.print_exc()
            os._exit(70)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def copy_to(tree: Path) -> Path:
    """Copy what the tests need, without the leftovers of other runs."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(
                source, tree / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        else:
            tree.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, tree / name)
    return tree


def survey(tree: Path) -> Map:
    """Run all tests once, unchanged, and note which of them runs which line."""
    environment = {**os.environ, "COVERAGE_FILE": str(tree / "coverage.db")}
    command = [sys.executable, __file__, str(tree)]
    done = subprocess.run(command, env=environment, check=False)
    if done.returncode:
        raise RuntimeError(f"expected tests that pass unchanged, got:\n{_log(tree)}")
    data = CoverageData(str(tree / "coverage.db"))
    data.read()
    tests: dict[str, dict[int, list[str]]] = {}
    for path in data.measured_files():
        file = Path(path).relative_to(tree / PACKAGE).as_posix()
        tests[file] = {
            line: sorted({name.rpartition("|")[0] for name in names if name})
            for line, names in data.contexts_by_lineno(path).items()
        }
    return Map(tests, json.loads((tree / "note.json").read_text(encoding="utf-8")))


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: ``killed``, ``timeout`` or ``survived``, and the failing test."""

    mutant: Mutant
    after: str
    outcome: str
    test: str = ""


_TREES: list[Path] = []


def _claim(trees: Sequence[Path]) -> None:
    """Make this process the owner of the first copy that has none."""
    for tree in trees:
        try:
            (tree / "claimed").touch(exist_ok=False)
        except FileExistsError:
            continue
        _TREES.append(tree)
        break


def _meet(one: Mutant, known: Map) -> Outcome:
    """Let a mutant meet the tests: those that run its line, and then all."""
    tree = _TREES[0]
    path = tree / PACKAGE / one.file
    source, times = (
        path.read_text(encoding="utf-8"),
        (path.stat().st_atime, path.stat().st_mtime),
    )
    text, after = mutated(one, source)
    nearest = known.of(one, source)
    path.write_text(text, encoding="utf-8")
    try:
        folder = f"/{one.file.partition('/')[0]}/"
        others = [name for name in known.seconds if folder in name.partition("::")[0]]
        for wanted in _rounds(nearest, others):
            expected = sum(known.seconds[name] for name in wanted)
            code = _forked(tree, wanted, SECONDS + TIMES * expected)
            if code in (-signal.SIGXCPU, -signal.SIGKILL):
                return Outcome(one, after, "timeout")
            if code:
                return Outcome(one, after, "killed", _killer(tree, code))
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, times)
    return Outcome(one, after, "survived")


def _killer(tree: Path, code: int) -> str:
    """Return the test that failed, or what else ended the run."""
    note = tree / "note.txt"
    if note.exists():
        return note.read_text(encoding="utf-8")
    if code in (1, 2):
        return "a test file cannot be loaded"
    if code in (-signal.SIGSEGV, -signal.SIGABRT):
        return "crash"
    raise RuntimeError(f"pytest ended with {code}\n{_log(tree)}")


def _rounds(nearest: Sequence[str], others: Sequence[str]) -> Iterator[Sequence[str]]:
    """Yield tests in rounds: of the file that runs the line most often, of other files, others.

    The others can see what those that run the line do not: something cached that an earlier test
    has computed.
    """
    files = [name.partition("::")[0] for name in nearest]
    best = {file for file in files if file.startswith("src")}
    best |= {max(sorted(set(files)), key=files.count)} if files else set()
    first = [name for name, file in zip(nearest, files, strict=True) if file in best]
    second = [
        name for name, file in zip(nearest, files, strict=True) if file not in best
    ]
    third = sorted(set(others) - set(nearest))
    yield from (names for names in (first, second, third) if names)


def run(sample: Sequence[Mutant], jobs: int, folder: Path) -> Iterator[Outcome]:
    """Let every mutant of a sample meet the tests; outcomes do not depend on the number of jobs.

    Parameters
    ----------
    sample : sequence of Mutant
        Of the checkout as it is.
    jobs : int
        Processes, each with its own copy of the checkout.
    folder : pathlib.Path
        For the copies.

    Yields
    ------
    Outcome
        As they are known.
    """
    known = survey(copy_to(folder / "unchanged"))
    trees = [copy_to(folder / f"copy-{job}") for job in range(jobs)]
    sys.dont_write_bytecode = True
    for name in LIBRARIES:
        importlib.import_module(name)
    with ProcessPoolExecutor(jobs, get_context("fork"), _claim, (trees,)) as pool:
        meetings = [pool.submit(_meet, one, known) for one in sample]
        for number, meeting in enumerate(as_completed(meetings), 1):
            outcome = meeting.result()
            one = outcome.mutant
            print(
                f"{number}/{len(sample)} {one.name} {outcome.outcome} {one.file}:{one.line} "
                f"{one.operator.partition('/')[2]}: {one.before} -> {outcome.after} {outcome.test}",
                flush=True,
            )
            yield outcome


def _log(tree: Path) -> str:
    return (tree / "log.txt").read_text(encoding="utf-8")


if __name__ == "__main__":
    _pytest(Path(sys.argv[1]), None, *COVER)
