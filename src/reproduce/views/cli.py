"""The command line: what `main` lists, each a thin shell over the front door."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from reproduce.judge.rerun import CannotChangeError
from reproduce.papers.catalogue import catalogue
from reproduce.physics.registration import MODELS
from reproduce.version import __version__
from reproduce.views import front
from reproduce.views.cli_posteriors import (
    _JSON,
    _PIVOT,
    _PLATFORM,
    _SEED,
    DATA,
    Spoken,
    bar,
    pairs,
    posterior,
)
from reproduce.views.keys import check_address, check_key
from reproduce.views.writing.display import Blocks

_CHANGE, _CHOICE = "CELL=VALUE", "NAME=ALTERNATIVE"


def _checked(check: Callable[[str], str]) -> Callable[..., Any]:
    """Return a callback that refuses keys or addresses that name nothing."""

    def convert(ctx: click.Context, param: click.Parameter, value: str | tuple[str, ...]) -> Any:
        try:
            return tuple(map(check, value)) if isinstance(value, tuple) else check(value)
        except KeyError as error:
            raise click.BadParameter(str(error.args[0])) from error

    return convert


_ADDRESS = click.argument("address", callback=_checked(check_address), metavar="KEY[#CELL]")


class _Streams(click.Group):
    """Commands whose output suits any stream, and that say in one line where it has no room."""

    def main(self, *arguments: Any, **settings: Any) -> Any:
        """Run, and write UTF-8 whatever the locale."""
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(encoding="utf-8", errors="backslashreplace")
        try:
            try:
                return super().main(*arguments, **settings)
            finally:
                sys.stdout.flush()
        except BrokenPipeError:
            sys.stdout = io.StringIO()  # nobody reads on; nothing is left to flush at the end
            sys.exit(1)
        except OSError as error:
            sys.stdout = io.StringIO()
            sys.exit(f"reproduce: cannot write: {error.strerror}")


@click.group(cls=_Streams, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="reproduce")
def main() -> None:
    """Recompute the printed numbers of niu2024 and chen2023, and judge every one.

    A KEY names a table, a figure or a group of quoted numbers, such as niu2024/table-3.
    """


main.add_command(posterior)


@main.command("list")
@_JSON
def list_items(as_json: bool) -> None:
    """List all items, in order of print, and our own tables."""
    contents = front.contents()
    if as_json:
        click.echo(json.dumps(contents.entries(), indent=2, ensure_ascii=False))
    else:
        Blocks(tuple(contents.listed())).print()


@main.command()
@click.argument("keys", nargs=-1, callback=_checked(check_key), metavar="[KEY]...")
@click.option("--json", "as_json", is_flag=True, help="Print one record per printed cell.")
def check(keys: tuple[str, ...], as_json: bool) -> None:
    """Judge every printed cell and compare the verdicts with the frozen ones.

    Exits with 0 only if every verdict is as frozen and every file of printed numbers has its
    checksum, else with 1.
    """
    with bar("recomputing", len(keys or catalogue())) as progress:
        found = front.check(*keys, progress=progress)
    if as_json:
        click.echo(found.ledger.model_dump_json(indent=2))
        for line in found.faults():
            click.echo(line, err=True)
    else:
        found.print()
    if not found:
        sys.exit(1)


@main.command()
@_ADDRESS
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar=_CHANGE,
    help='Another value for a printed cell, such as niu2024/text-simulation#noise="0.2 px".',
)
@_SEED
@click.option("--replicates", type=click.IntRange(min=2), help="Of a table that draws some.")
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar=_CHOICE,
    help="How to read what the text leaves open, such as translations=table-2.",
)
def show(
    address: str, changes: tuple[str, ...], options: tuple[str, ...], **numbers: int | None
) -> None:
    """Show an item or a cell, computed beside printed; or computed again with a change.

    With nothing but options, the cells say what they would be judged as under that reading.
    """
    found, set_to = front.item(address), pairs("--set", _CHANGE, changes)
    again: dict[str, Any] = {n: value for n, value in numbers.items() if value is not None}
    again |= pairs("--option", _CHOICE, options)
    try:
        (found.rerun(set_to, **again) if set_to or again else found).print()
    except CannotChangeError as error:
        raise click.UsageError(str(error)) from error


@main.command("export")
@_ADDRESS
@click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "json", "latex", "markdown"]),
    required=True,
    help="csv and json carry every field.",
)
def export_item(address: str, form: str) -> None:
    """Write the records of an item or a cell to standard output."""
    click.echo(front.item(address).export(form))


@main.command()
@click.argument("key", callback=_checked(check_key))
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="Where to write; the ending chooses the format: .svg, .pdf or .png.",
)
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar=_CHANGE,
    help="Another value for a printed cell that the figure reads.",
)
@_SEED
def figure(key: str, out: Path, changes: tuple[str, ...], seed: int | None) -> None:
    """Draw an item that draws."""
    try:
        front.figure(key).rerun(pairs("--set", _CHANGE, changes), seed=seed).save(out)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.ClickException(f"cannot write {out}: {error.strerror}") from error
    click.echo(f"Wrote {out}")


@main.command()
@_ADDRESS
@click.option(
    "--format",
    "form",
    type=click.Choice(["bibtex", "text"]),
    default="bibtex",
    show_default=True,
)
def cite(address: str, form: str) -> None:
    """Print how to cite a reproduced item or cell and its paper."""
    click.echo(front.cite(address, form))


@main.command()
@click.argument("paper", required=False, metavar="[PAPER]")
@_JSON
def audit(paper: str | None, as_json: bool) -> None:
    """Cross-examine the printed numbers of a paper."""
    try:
        found = front.contradictions(paper)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    if as_json:
        click.echo(json.dumps(found.as_json(), indent=2, ensure_ascii=False))
    else:
        found.print()


@main.command(cls=Spoken)
@click.argument("file", type=DATA)
@_PIVOT
@click.option("--model", type=click.Choice(list(MODELS)), default="similarity", show_default=True)
@click.option("--robust", is_flag=True, help="Guard against wrong matches.")
@_JSON
def register(file: Path, as_json: bool, **settings: Any) -> None:
    """Fit the transform that lays your own stars on the same stars of another image.

    FILE is a CSV, or - for standard input: one star per line, in px, with the columns x, y (the
    source) and x_reference, y_reference (the target), in any order and case. The columns sigma (px,
    one coordinate of the difference; or sigma_x, sigma_y), weight and mask (1 drops the line) are
    used where there are some, and others are passed over. The shift is where the pivot was minus
    where it lands; the pivot is the mean of the source stars unless --pivot says another.
    """
    _told(file, as_json, lambda: front.register(file, **settings))


@main.command(cls=Spoken)
@click.argument("file", type=DATA)
@_PLATFORM
@_JSON
def misalignment(file: Path, platform: Path | None, as_json: bool) -> None:
    """Measure how far your own camera has turned since the zero point, from spots of its lights.

    FILE is a CSV, or - for standard input: one spot per line, in px, with the columns group (0 at
    the zero point, 1 at the present), laser (from 1, in the order of the platform), x, y, in any
    order and case. A column frame, a number that the spots of an image share, is needed where some
    are lost; mask drops a line where it is 1.
    """
    _told(file, as_json, lambda: front.misalignment(file, platform=platform))


def _told(file: Path, as_json: bool, measure: Callable[[], Any]) -> None:
    """Print what is measured from a file, or say in one line why it cannot be."""
    try:
        found = measure()
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.UsageError(f"cannot read {error.filename or file}: {error.strerror}") from error
    if as_json:
        click.echo(json.dumps(found.record(), indent=2))
    else:
        found.print()
