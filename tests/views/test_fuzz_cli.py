"""The command line with random files and options: a result or a message, no traceback.

Posteriors stop before sampling.
"""

import itertools

import click
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reproduce.inference import sampling
from reproduce.papers.declare import changeable, computations
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import MODELS
from reproduce.printed.cells import find
from reproduce.views.cli import main

FEW = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
# No argument of a process holds a null byte; one that is no UTF-8 comes in as a lone surrogate.
TEXT = st.text(
    st.characters(exclude_characters="\0", exclude_categories=[]), max_size=12
)
# Values that once ended in a traceback.
FOUND = ["1e300 px", "-1 px", "0 mm", "1e-300 um"]
# Items that are computed in a moment: few replicates for those that draw.
TABLES = (
    "niu2024/table-2",
    "niu2024/table-3",
    "niu2024/text-optics",
    "chen2023/table-1",
)
FIGURES = ("niu2024/fig-4", "chen2023/fig-1c", "niu2024/drawing-stars")
NUMBERS = st.one_of(
    st.sampled_from(
        "0 -1 1e400 -0.0 1e-300 1e300 nan inf 1_0 0x1 . − + 1e 9e9999 007".split()
    ),
    st.floats(width=32).map(str),
    st.integers(-(10**6), 10**6).map(str),
    TEXT,
)
UNITS = st.sampled_from(
    ["", " px", " mm", "um", " deg", "″", " nm", " km", "%", " parsec", " ms"]
)
VALUES = st.tuples(NUMBERS, UNITS).map("".join)


# Posterior -> the columns of a user file.
COLUMNS = {
    key: declared.columns for key, declared in posteriors().items() if declared.columns
}


@pytest.fixture(autouse=True)
def no_sampling(monkeypatch):
    """Stop where sampling would start."""

    def stop(*arguments, **settings):
        raise click.ClickException("sampling would start")

    monkeypatch.setattr(sampling, "sample", stop)


def test_values_found_before():
    for key, value in itertools.product(TABLES, FOUND):
        addresses = changeable(key)
        unit = value.split()[1]
        (address, *_) = [a for a in addresses if find(a)[0].unit == unit] or addresses
        check("show", key, "--set", f"{address}={value}", "--replicates", "2")


def check(*arguments):
    """Run a command; anything but an orderly end fails."""
    result = CliRunner(env={"TERM": "dumb"}).invoke(main, list(arguments))
    orderly = result.exception is None or isinstance(result.exception, SystemExit)
    assert orderly, (arguments, repr(result.exception))
    assert result.exit_code in {0, 1, 2}, arguments
    if result.exit_code:
        assert result.stderr.strip() or "{" in result.stdout, arguments
    return result


@FEW
@given(
    st.sampled_from([*main.commands, "nothing"]),
    st.lists(
        st.one_of(
            TEXT,
            st.sampled_from(
                "--json --format --out --set --seed --data --pivot --steps "
                "--option --list --walkers --model --robust --prior -- -h niu2024 csv bibtex 3 "
                "registration niu2024/table-2 "
                "chen2023/dichroic chen2023/dichroic#x niu2024-arrangements".split()
            ),
        ),
        max_size=4,
    ),
)
def test_any_arguments(command, arguments):
    known = {"--json", "--", "niu2024"}
    if command not in {"check", "audit"} or set(arguments) - known:
        check(command, *arguments)  # the whole ledger is tested elsewhere


@FEW
@given(st.data(), st.sampled_from([*TABLES, *FIGURES]), VALUES)
def test_any_value_for_a_cell_that_is_read(data, key, value):
    address = data.draw(st.sampled_from(changeable(key)))
    arguments = ["show", key, "--set", f"{address}={value}"]
    if any(one.replicates for one in computations(key)):
        arguments += ["--replicates", "2"]
    check(*arguments)


ROWS = st.lists(
    st.lists(
        st.one_of(st.integers(-1, 4).map(str), NUMBERS), min_size=1, max_size=6
    ).map(",".join),
    max_size=14,
)


@FEW
@given(st.data(), st.sampled_from(sorted(COLUMNS)), ROWS, st.binary(max_size=40))
def test_any_file_of_measurements(tmp_path, data, model, rows, raw):
    path = tmp_path / "data.csv"
    head = ",".join(COLUMNS[model])
    content = data.draw(
        st.sampled_from(
            [
                raw,
                "\n".join([head, *rows]).encode(errors="replace"),
                head.encode() + raw,
            ]
        )
    )
    path.write_bytes(content)
    pivot = data.draw(
        st.sampled_from([[], ["--pivot", "1", "2"], ["--pivot", "nan", "inf"]])
    )
    check("posterior", model, "--data", str(path), *pivot, *data.draw(JSON))
    check("register", str(path), *pivot, *data.draw(FITS), *data.draw(JSON))


JSON = st.sampled_from([[], ["--json"]])
FITS = st.tuples(st.sampled_from(sorted(MODELS)), st.booleans()).map(
    lambda fit: ["--model", fit[0], *["--robust"] * fit[1]]
)
