"""The subcommand `posterior`, and the bar of all long commands."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console

if TYPE_CHECKING:
    from reproduce.inference import Progress
    from reproduce.views.objects.posterior import Posterior


class Spoken(click.Command):
    """A command whose refusals are JSON too where JSON is asked for: an object with "error"."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Read the arguments."""
        with self._speaking("--json" in args):
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run."""
        with self._speaking(bool(ctx.params.get("as_json"))):
            return super().invoke(ctx)

    @contextmanager
    def _speaking(self, as_json: bool) -> Iterator[None]:
        try:
            yield
        except click.ClickException as error:
            if as_json:
                more = error.record if isinstance(error, RefusedError) else {}
                click.echo(json.dumps({"error": error.format_message(), **more}, indent=2))
            raise


class RefusedError(click.ClickException):
    """Chains that miss a gate: exit status one, and all numbers for programs."""

    def __init__(self, message: str, record: dict[str, Any]) -> None:
        super().__init__(message)
        self.record = record


DATA = click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path)
_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON for other programs.")
_SEED = click.option("--seed", type=click.IntRange(min=0), help="Of the random numbers.")
_PIVOT = click.option(
    "--pivot", type=float, nargs=2, metavar="X Y", help="Principal point of your stars, in px."
)
_PLATFORM = click.option(
    "--platform",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Lights and tracker of your own, in TOML: the arguments of Platform.",
)


@click.command(cls=Spoken)
@click.argument("model", required=False)
@click.option(
    "--list", "list_models", is_flag=True, help="Name all models, and columns for --data."
)
@click.option(
    "--data",
    type=DATA,
    help="Your own CSV in place of ours, or - for standard input; --list names its columns.",
)
@_PIVOT
@_PLATFORM
@click.option(
    "--prior",
    "priors",
    multiple=True,
    metavar="NAME=LOW,HIGH",
    help="An even prior of your own for a parameter, in the unit of the summary.",
)
@_SEED
@click.option("--data-seed", type=click.IntRange(min=0), help="Of data that are simulated by us.")
@click.option("--ensembles", type=click.IntRange(min=4), default=4, show_default=True)
@click.option("--steps", type=click.IntRange(min=1), help="Kept steps of each ensemble.")
@click.option("--workers", type=click.IntRange(min=1), default=1, show_default=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Write the draws to this .nc (for ArviZ) or .npz.",
)
@_JSON
def posterior(
    model: str | None,
    list_models: bool,
    as_json: bool,
    workers: int,
    out: Path | None,
    priors: tuple[str, ...],
    **asked: Any,
) -> None:
    """Sample the posterior of MODEL and print its summary.

    Below the summary stands what the data are. A chain that misses a gate (R-hat, autocorrelation
    times, effective sample sizes) is refused: the exit status is 1, and the steps needed are told.
    Where the posterior leans on an end of a prior, a line says so; in JSON it is "at_prior_end".
    """
    if list_models:
        _list_models(as_json)
        return
    from reproduce.views.objects.posterior import Posterior  # only now, as in `front`

    name = _known(model)
    if asked["pivot"] is not None and asked["data"] is None:
        raise click.UsageError("--pivot needs --data: our own stars have a pivot of their own")
    _check_file(out)
    ends = {
        key: _ends(key, text) for key, text in pairs("--prior", "NAME=LOW,HIGH", priors).items()
    }
    try:
        wanted = Posterior(name, priors=ends, **asked)
        data = wanted.provenance
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.UsageError(f"--data: cannot read {asked['data']}: {error.strerror}") from error
    record = _sample(wanted, data, workers)
    if out:
        try:
            wanted.save(out)
        except OSError as error:
            raise click.UsageError(f"--out: cannot write {out}: {error.strerror}") from error
    if as_json:
        click.echo(json.dumps(record, indent=2, ensure_ascii=False))
    else:
        wanted.print()


def pairs(option: str, form: str, texts: tuple[str, ...]) -> dict[str, str]:
    """Return what stands left and right of the equals signs."""
    parts = [text.partition("=") for text in texts]
    for name, equals, value in parts:
        if not equals or not name.strip():
            raise click.UsageError(f"{option} {name}{equals}{value}: expected {form}")
    return {name.strip(): value.strip() for name, _, value in parts}


def _ends(name: str, text: str) -> tuple[float, float]:
    """Return the lowest and the highest value of a prior."""
    try:
        low, high = map(float, text.split(","))
    except ValueError as error:
        raise click.UsageError(
            f"--prior {name}={text}: expected NAME=LOW,HIGH, such as noise=0.01,1"
        ) from error
    return low, high


def _check_file(out: Path | None) -> None:
    """Refuse before the sampling what could not be written after it."""
    from reproduce.views.objects.posterior import ENDINGS

    if out and out.suffix not in ENDINGS:
        raise click.UsageError(f"--out: expected {' or '.join(ENDINGS)}, got {out}")
    if out and not out.parent.is_dir():
        raise click.UsageError(f"--out: cannot write {out}: no folder {out.parent}")
    if out and out.suffix == ".nc" and not all(map(find_spec, ("arviz_base", "h5netcdf"))):
        raise click.UsageError("--out: an .nc file needs the extra reproduce-pointing[netcdf]")


def _sample(wanted: Posterior, data: dict[str, Any], workers: int) -> dict[str, Any]:
    """Sample and return the record; say in one line what does not go."""
    from reproduce.inference import StartError, UnconvergedError, processes

    try:
        pool = nullcontext(None) if workers == 1 else processes(workers)
        with pool as executor, bar("sampling") as progress:
            wanted.sample(executor, progress)
        # Consequences are held to the gates too, when they are first asked for.
        return wanted.record()
    except UnconvergedError as error:
        taken = error.taken
        steps = {} if error.steps is None else {"steps_needed": error.steps}
        record = {"model": wanted.name, "data": data, "steps": taken, **steps,
                  "missed": error.missed}  # fmt: skip
        advice = "" if error.steps is None else f" (--steps; there were {taken})"
        raise RefusedError(f"{wanted.name}: {error}{advice}", record) from error
    except StartError as error:
        raise click.UsageError(str(error)) from error


def _list_models(as_json: bool) -> None:
    from reproduce.papers.posteriors import posteriors

    if as_json:
        titles = {name: declared.title for name, declared in posteriors().items()}
        click.echo(json.dumps(titles, indent=2, ensure_ascii=False))
        return
    from reproduce.views.objects.posteriors import Posteriors

    Posteriors().models.print()


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


@contextmanager
def bar(what: str, total: int | None = None) -> Iterator[Progress | None]:
    """Show a bar on a terminal's standard error, and nothing in a pipe."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    from rich import progress

    with progress.Progress(console=console, transient=True) as shown:
        task = shown.add_task(what, total=total)
        yield lambda done, total: shown.update(task, completed=done, total=total)
