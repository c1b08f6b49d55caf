"""The command line: list, check, show, export, figure, cite, audit, posterior and calibrate."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console

import reproduce
from reproduce.views.keys import UnknownKeyError, check_key
from reproduce.views.posterior_commands import calibrate, posterior

if TYPE_CHECKING:
    from reproduce.judge.ledger import Ledger


class _Key(click.ParamType[str]):
    name = "key"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        try:
            return check_key(value)
        except UnknownKeyError as error:
            self.fail(str(error), param, ctx)


class _Address(_Key):
    name = "address"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from reproduce.printed.cells import library

        key, mark, name = str(value).partition("#")
        key = super().convert(key, param, ctx)
        if not mark:
            return key
        try:
            return library()[key][name].address
        except KeyError as error:
            self.fail(str(error.args[0]), param, ctx)


KEY = _Key()
ADDRESS = _Address()
_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(reproduce.__version__, prog_name="reproduce")
def main() -> None:
    """Recompute the printed numbers of niu2024 and chen2023, and judge every one.

    A KEY names a table, a figure or a group of quoted numbers, such as niu2024/table-3.
    """


main.add_command(posterior)
main.add_command(calibrate)


@main.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for other programs.")
def list_items(as_json: bool) -> None:
    """List all items, in order of print."""
    from reproduce.papers.catalogue import catalogue
    from reproduce.views import keys, terminal

    items = list(catalogue().values())
    if as_json:
        click.echo(
            json.dumps(
                [
                    {
                        "key": item.key,
                        "place": keys.place(item.key),
                        "title": keys.title(item.key),
                        "functions": [c.name for c in item.computations],
                        "draws": item.draw is not None,
                    }
                    for item in items
                ],
                indent=2,
                ensure_ascii=False,
            )
        )
        return
    console = Console()
    console.print(terminal.items_table(items, console.width))


@main.command()
@click.argument("keys", nargs=-1, type=KEY, metavar="[KEY]...")
@click.option("--json", "as_json", is_flag=True, help="Print one record per printed cell.")
def check(keys: tuple[str, ...], as_json: bool) -> None:
    """Judge every printed cell and compare the verdicts with the frozen ones.

    Exits with 0 only if every verdict is as frozen and every file of printed numbers has its
    checksum, else with 1.
    """
    from reproduce.judge.expected import surprises
    from reproduce.views import terminal

    ledger = _ledger(keys)
    found = surprises(ledger)
    if as_json:
        click.echo(ledger.model_dump_json(indent=2))
    else:
        Console().print(terminal.score_table(ledger))
        if line := terminal.weak_line(ledger.records):
            click.echo(line)
    for surprise in found:
        click.echo(
            f"{surprise.cell}: expected {surprise.expected}, found {surprise.found}", err=True
        )
    if found:
        click.echo(
            f"{len(found)} verdicts differ from data/verdicts.toml; find the cause, or change "
            "that file with the reason",
            err=True,
        )
    for name in ledger.altered:
        click.echo(
            f"data/printed/{name}: not the file of its checksum in data/printed/SHA256SUMS; "
            "restore the printed digits, or enter them twice and renew the checksum",
            err=True,
        )
    if found or ledger.altered:
        sys.exit(1)
    if not as_json:
        click.echo(f"All {len(ledger.records)} verdicts are as frozen.")


@main.command()
@click.argument("address", type=ADDRESS, metavar="KEY[#CELL]")
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="CELL=VALUE",
    help='Another value for a printed cell, such as niu2024/text-simulation#noise="0.2 px".',
)
@click.option("--seed", type=click.IntRange(min=0), help="Of the random numbers.")
@click.option("--replicates", type=click.IntRange(min=2), help="Of a table that draws some.")
def show(address: str, changes: tuple[str, ...], seed: int | None, replicates: int | None) -> None:
    """Show an item or a cell, computed beside printed; or computed again with a change."""
    import reproduce as rp
    from reproduce.judge.rerun import CannotChangeError
    from reproduce.printed.cells import library

    key = address.partition("#")[0]
    found = rp.table(address) if key in library() else rp.figure(address)
    if changes or seed is not None or replicates is not None:
        if key not in library():
            raise click.UsageError(f"{key} is a figure; only tables and quoted numbers are rerun")
        values = dict(_change(text) for text in changes)
        try:
            found = found.rerun(values, seed=seed, replicates=replicates)
        except CannotChangeError as error:
            raise click.UsageError(str(error)) from error
    found.print(Console())


def _change(text: str) -> tuple[str, str]:
    address, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {text}: expected CELL=VALUE")
    return address.strip(), value.strip()


@main.command("export")
@click.argument("address", type=ADDRESS, metavar="KEY[#CELL]")
@click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "json", "latex", "markdown"]),
    required=True,
    help="csv and json carry every field.",
)
def export_item(address: str, form: str) -> None:
    """Write the records of an item or a cell to standard output."""
    from reproduce.views.export import export

    try:
        click.echo(export(_ledger((address.partition("#")[0],)), address, form))
    except ValueError as error:
        raise click.UsageError(str(error)) from error


@main.command()
@click.argument("key", type=KEY)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="Where to write; the ending chooses the format: .svg, .pdf or .png.",
)
def figure(key: str, out: Path) -> None:
    """Draw an item that draws."""
    from reproduce.views.figures import save

    try:
        save(key, out)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.ClickException(f"cannot write {out}: {error.strerror}") from error
    click.echo(f"Wrote {out}")


@main.command()
@click.argument("address", type=ADDRESS, metavar="KEY[#CELL]")
@click.option(
    "--format",
    "form",
    type=click.Choice(["bibtex", "csl", "text"]),
    default="bibtex",
    show_default=True,
)
def cite(address: str, form: str) -> None:
    """Print how to cite a reproduced item or cell and its paper."""
    import reproduce as rp

    click.echo(rp.cite(address, form))


@main.command()
@click.argument("paper", required=False, type=click.Choice(["niu2024", "chen2023"]))
@click.option("--json", "as_json", is_flag=True, help="Print JSON for other programs.")
@click.option("--table", type=_FILE, help="Audit this table of yours (format: data/README.md).")
@click.option("--relations", type=_FILE, help="What its numbers should keep, in TOML.")
def audit(paper: str | None, as_json: bool, table: Path | None, relations: Path | None) -> None:
    """Cross-examine the printed numbers of a paper, or of a table of your own."""
    from reproduce.views import audit_terminal, audit_words

    if (table is None) != (relations is None) or (table and paper):
        raise click.UsageError("give a PAPER, or both --table and --relations, or nothing")
    try:
        found = audit_words.audits(paper, table, relations)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    if as_json:
        told = [audit_words.as_json(one) for one in found]
        click.echo(json.dumps(told, indent=2, ensure_ascii=False))
        return
    width = Console().width
    for one in found:
        for line in audit_terminal.lines(one):
            click.echo(audit_terminal.wrapped(line, width))


def _ledger(keys: tuple[str, ...]) -> Ledger:
    from reproduce.judge import ledger
    from reproduce.papers.catalogue import catalogue

    wanted = list(keys or catalogue())
    with _progress(len(wanted)) as advance:
        return ledger.build(wanted, advance)


@contextmanager
def _progress(total: int) -> Iterator[Any]:
    """Show a bar on a terminal's standard error, and nothing in a pipe."""
    console = Console(stderr=True)
    if not console.is_terminal or total < 2:
        yield None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("recomputing", total=total)
        yield lambda key: bar.update(task, advance=1, description=f"done {key}")


if __name__ == "__main__":
    main()
