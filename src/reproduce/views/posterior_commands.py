"""The subcommands `posterior` and `calibrate`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click


@click.command()
@click.argument("model", required=False)
@click.option("--list", "list_models", is_flag=True, help="Name all models.")
@click.option(
    "--data",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Your own CSV in place of ours; the book's page on the method tells the columns.",
)
@click.option("--pivot", type=float, nargs=2, help="Principal point of your data, in px.")
@click.option("--ensembles", type=click.IntRange(min=4), default=4, show_default=True)
@click.option("--steps", type=click.IntRange(min=1), help="Kept steps of each ensemble.")
@click.option("--workers", type=click.IntRange(min=1), default=1, show_default=True)
@click.option("--resume", is_flag=True, help="Continue what a killed run left in --out.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Store chains here.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for other programs.")
def posterior(model: str | None, list_models: bool, as_json: bool, **options: Any) -> None:
    """Sample the posterior of MODEL and print its summary.

    A chain that misses the gates (R-hat, autocorrelation times, effective sample sizes) is refused:
    the numbers are printed and the exit status is 1.
    """
    if list_models:
        _list_models(as_json)
        return
    name = _known(model)
    out, resume = options["out"], options["resume"]
    if resume and out is None:
        raise click.UsageError("--resume needs --out: the folder of the run to continue")
    if out is not None and (out / "plan.json").exists() and not resume:
        raise click.UsageError(f"{out} holds a run already; add --resume, or choose another folder")
    _sample(name, as_json, options)


def _sample(name: str, as_json: bool, options: dict[str, Any]) -> None:
    from rich.console import Console

    from reproduce.inference.convergence import ConvergenceError
    from reproduce.inference.sampling import ResumeError
    from reproduce.views import posterior as running

    built = _build(name, options["data"], options["pivot"])
    plan = running.plan_for(name, options["steps"], options["ensembles"])
    try:
        with _bar("sampling") as advance:
            found = running.run(
                built, plan, workers=options["workers"], folder=options["out"], progress=advance
            )
    except ConvergenceError as error:
        click.echo(f"{name}: {error}", err=True)
        sys.exit(1)
    except ResumeError as error:
        raise click.UsageError(str(error)) from error
    if as_json:
        click.echo(json.dumps(running.record(found), indent=2, ensure_ascii=False))
        return
    console = Console()
    console.print(f"{built.name}: {built.title}", style="bold", highlight=False)
    console.print(running.summary_table(found))
    console.print(
        f"{found.chain.shape[0]} ensembles of {found.chain.shape[2]} walkers, "
        f"{found.chain.shape[1]} steps each; "
        f"acceptance {min(found.acceptance):.2f} to {max(found.acceptance):.2f}; "
        f"seed {found.seed}",
        highlight=False,
    )


def _build(name: str, data: Path | None, pivot: tuple[float, float] | None) -> Any:
    from reproduce.papers.posteriors import posteriors

    if data is None:
        return posteriors()[name].model()
    from reproduce.views.posterior_data import from_file

    try:
        return from_file(name, data, pivot)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


def _list_models(as_json: bool) -> None:
    from reproduce.papers.posteriors import posteriors

    known = posteriors()
    titles = {name: declared.model().title for name, declared in known.items()}
    if as_json:
        click.echo(json.dumps(titles, indent=2, ensure_ascii=False))
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("model", no_wrap=True)
    table.add_column("paper", no_wrap=True)
    table.add_column("about")
    for name, title in titles.items():
        table.add_row(name, known[name].paper, title)
    Console().print(table)


def _known(model: str | None) -> str:
    import difflib

    from reproduce.papers.posteriors import posteriors

    if model is None:
        raise click.UsageError("name a model, or use --list to see them all")
    known = list(posteriors())
    if model not in known:
        near = difflib.get_close_matches(model, known, n=3, cutoff=0.4)
        hint = f"; did you mean {', '.join(near)}?" if near else ""
        raise click.UsageError(f"unknown model {model!r}{hint} (--list names them all)")
    return model


@click.command()
@click.argument("model")
@click.option("--replicates", type=click.IntRange(min=1), default=1000, show_default=True)
@click.option("--seed", type=int, default=20240105, show_default=True)
@click.option("--workers", type=click.IntRange(min=1), help="Processes; all processors by default.")
@click.option("--store", is_flag=True, help="Replace the stored study of this model.")
@click.option(
    "--intervals",
    is_flag=True,
    help="Redo the published estimator's intervals in the stored study; nothing is sampled.",
)
def calibrate(
    model: str, replicates: int, seed: int, workers: int | None, store: bool, intervals: bool
) -> None:
    """Run simulation-based calibration of MODEL: are its posteriors right?"""
    from rich.console import Console

    from reproduce.store.studies import StudyError
    from reproduce.views import posterior_calibration

    name = _known(model)
    if intervals:
        try:
            found = posterior_calibration.renew(posterior_calibration.study_of(name))
        except StudyError as error:
            raise click.ClickException(str(error)) from error
    else:
        with _bar("calibrating") as advance:
            found = posterior_calibration.run(
                name, replicates, seed, workers=workers, progress=advance
            )
        if store:
            posterior_calibration.store(name, found, seed)
    Console().print(posterior_calibration.terminal_table(found))
    click.echo(f"{found.replicates} replicates, {int(found.failed.sum())} of them failed.")


@contextmanager
def _bar(what: str) -> Iterator[Any]:
    """Show a bar on a terminal's standard error, and nothing in a pipe."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
