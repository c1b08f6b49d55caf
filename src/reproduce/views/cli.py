"""The command line over the public API, which reports each error of the input in one line."""

from __future__ import annotations

import io
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from reproduce.physics.registration import MODELS
from reproduce.physics.validate import without_none
from reproduce.store.files import DRAWS, FIGURES, check_target
from reproduce.version import __version__
from reproduce.views._blocks import Display, printable


class _Shell(click.Group):
    """Commands whose output is UTF-8, and whose errors are one line.

    With ``--json`` an error is an object with "error". For chains that fail a convergence criterion
    it also has the number of steps and the failures.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        as_json = "--json" in ctx.args
        try:
            return super().invoke(ctx)
        except Exception as error:  # errors of the input become one line, others rise
            reported = _reported(error)
            if reported is None:
                raise
            if as_json:
                record: dict[str, Any] = {"error": reported.format_message()}
                if missed := getattr(error, "missed", ()):
                    record["steps_needed"] = getattr(error, "steps", None)
                    record["missed"] = missed
                click.echo(json.dumps(record, indent=2))
            raise reported from error

    def main(self, *arguments: Any, **settings: Any) -> Any:
        """Run the program."""
        for name in ("stdin", "stdout", "stderr"):
            if getattr(sys, name) is None:  # closed by the caller
                setattr(sys, name, io.TextIOWrapper(io.BytesIO()))
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(encoding="utf-8", errors="backslashreplace")
        try:
            return super().main(*arguments, **settings)
        except OSError as error:  # a stream, such as a full disk
            sys.stdout = io.StringIO()  # nothing is left to flush at the end
            sys.exit(f"reproduce: {error.strerror}")


def _reported(error: Exception) -> click.ClickException | None:
    """Return an error of the input with one line for the user; None for another error."""
    match error:
        case click.ClickException():
            return error
        case MemoryError():
            text = "the input does not fit into memory. Use a smaller one"
            return click.ClickException(text)
        case ArithmeticError() if hasattr(error, "missed"):  # unconverged chains
            return click.ClickException(printable(str(error)))
        case KeyError():
            text = str(error.args[0])
        case ValueError():
            text = str(error)
        case OSError() if error.filename:
            text = f"{error.filename}: {error.strerror}"
        case _:
            return None
    return click.UsageError(printable(text))


def _target(*endings: str) -> Callable[..., Path | None]:
    """Return a check of an output file, which runs before the computation starts."""
    return lambda ctx, param, value: (
        value and check_target(value, endings, param.opts[0])
    )


def _pairs(
    ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]
) -> dict[str, str]:
    """Return the texts to the left and to the right of the equals signs."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = map(str.strip, text.partition("="))
        if not (name and equals) or name in pairs:
            raise click.UsageError(
                f"{param.opts[0]} {text}: expected {param.metavar}, each only once"
            )
        pairs[name] = value
    return pairs


def _show(as_json: bool, record: Callable[[], Any], view: Display) -> None:
    """Print a record for programs, or its view for a reader."""
    if as_json:
        click.echo(json.dumps(record(), indent=2, ensure_ascii=False))
    else:
        view.print()


def _save(save: Callable[[Path], Any], out: Path) -> Any:
    """Write a file, and return its path, or the paths of panels."""
    try:
        return save(out)
    except (OSError, RuntimeError) as error:  # the latter of netCDF
        reason = getattr(error, "strerror", "") or error
        click.echo(printable(f"Error: cannot write {out}: {reason}"), err=True)
        sys.exit(1)


def _item(address: str) -> Any:
    """Return the table, cell, supplementary table, figure or panels of an address."""
    from reproduce.papers.catalogue import catalogue
    from reproduce.printed.cells import library
    from reproduce.views.figure import figure
    from reproduce.views.table import table

    if address.partition("#")[0] in {*library(), *catalogue("studies")}:
        return table(address)
    return figure(address)


# A FITS file may have the name of an extension in brackets behind it.
_FILE = click.Path(path_type=Path)
_ADDRESS = click.argument("address", metavar="KEY[#CELL]")
_JSON = click.option(
    "--json", "as_json", is_flag=True, help="JSON output for other programs."
)
_SEED = click.option(
    "--seed",
    type=int,
    help="Seed of the random number generator.  [default: the seed of the book]",
)
_SET = click.option(
    "--set",
    "changes",
    multiple=True,
    callback=_pairs,
    metavar="CELL=VALUE",
    help="Value of a printed input, in its unit. Repeatable.",
)
_PIVOT = click.option(
    "--pivot",
    type=float,
    nargs=2,
    metavar="X Y",
    help="Principal point of your stars, in px.  [default: their mean]",
)
_SEP = click.option(
    "--sep", help="Separator of the columns of a text file.  [default: a comma]"
)
_PLATFORM = click.option(
    "--platform",
    type=_FILE,
    help="TOML file of your lights and tracker.  [default: the platform of chen2023]",
)
_MODEL = click.option(
    "--model",
    type=click.Choice(list(MODELS)),
    help="Type of the transform.  [default: similarity]",
)


@click.group(cls=_Shell, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="reproduce")
def main() -> None:
    """Recompute the printed numbers of niu2024 and chen2023, and judge every number.

    A KEY names a table, a figure or a group of quoted numbers, such as niu2024/table-3. KEY#CELL
    names one number.

    \b
    Example:
      $ reproduce show "niu2024/table-2#scale.red"
      Scale factor, Red
      Cell        niu2024/table-2#scale.red
      ─────────────────────────────────────
      printed     0.9976
      stands for  0.99755 to 0.99765
      computed    0.99760
      ...
    """


@main.command("contents")
@_JSON
def _contents(as_json: bool) -> None:
    """List all items in the order of the papers, and the supplementary tables.

    \b
    Example:
      $ reproduce contents
      Items in printed order, then supplementary tables.
      key                   place            title
      ───────────────────────────────────────────────────────────
      niu2024/text-context  Text, section 1  Figures quoted in the
                                             introduction
      ...
    """
    from reproduce.views.contents import Contents

    listing = Contents()
    _show(as_json, listing.entries, listing.listed)


@main.command("check")
@click.argument("keys", nargs=-1, metavar="[KEY|PAPER]...")
@_JSON
def _check(keys: tuple[str, ...], as_json: bool) -> None:
    """Judge every printed cell and compare the verdicts with the frozen ones.

    The exit status is 0 only if every verdict is as frozen and every file of printed numbers has
    its checksum, otherwise 1.

    \b
    Example:
      $ reproduce check niu2024/table-2
      Cells by verdict.
      key              exact  cons.  differs  ambig.  unpub.  input  weak
      ───────────────────────────────────────────────────────────────────
      niu2024/table-2      2      ·        4       ·       ·      2     ·
      all                  2      ·        4       ·       ·      2     ·
      All 8 verdicts are as frozen.
    """
    from reproduce.views import contents

    result = contents.check(*keys)
    if as_json:
        click.echo(result.ledger.model_dump_json(indent=2))
        for line in result.faults():
            click.echo(line, err=True)
    else:
        result.print()
    if not result:
        sys.exit(1)


@main.command("show")
@_ADDRESS
@_SET
@_SEED
@click.option(
    "--replicates",
    type=int,
    help="Number of simulated tables.  [default: the number of the book]",
)
@click.option(
    "--option",
    "options",
    multiple=True,
    callback=_pairs,
    metavar="NAME=ALTERNATIVE",
    help="Reading of the text. Repeatable.  [default: the literal reading]",
)
def _show_item(
    address: str,
    changes: dict[str, str],
    options: dict[str, str],
    **numbers: int | None,
) -> None:
    """Show the printed and computed values of an item or a cell, or compute it with a change.

    A change is a cell with a value, such as niu2024/text-simulation#noise="0.2 px". An option
    selects a reading of the text, such as translations=table-2. With options only, each cell has
    its verdict under this reading.

    \b
    Example:
      $ reproduce show niu2024/table-3
      Table 3, section 4.1. Registration parameters calibrated from ...
      cell                   Printed  Computed  Verdict
      ────────────────────────────────────────────────────
      scale.red               0.9973   0.99756  differs
      ...
    """
    item = _item(address)
    settings = without_none(numbers)
    if names := options.keys() & {"self", "changes", *numbers}:
        raise click.UsageError(
            f"--option {min(names)}: expected an option of the text. Leave it out"
        )
    if changes or options or settings:
        item = item.rerun(changes, **settings, **options)
    item.print()


@main.command("export")
@_ADDRESS
@click.option(
    "--format",
    "form",
    required=True,
    help="Format: csv, json, latex, markdown or covariance. Of a paper: codecheck, rescience, "
    "nanopublications or decisions.",
)
def _export(address: str, form: str) -> None:
    """Write the records of an item or a cell, or a report on a paper, to standard output.

    The format csv has the layout of the table, and json contains every field. A report is the
    judgement of a paper in the form of another register.

    \b
    Example:
      $ reproduce export niu2024/table-2 --format csv
      # software: reproduce-pointing ...
      # citation: The reproduce-pointing developers (2026). Reproduction of Table 2 ...
      "row","value","Red","Blue"
    """
    from reproduce.views._reports import FORMS, report

    if form in FORMS:
        click.echo("\n".join(report(address, form).values()))
    else:
        click.echo(_item(address).export(form))


@main.command("figure")
@click.argument("key")
@click.option(
    "--out",
    type=_FILE,
    callback=_target(*FIGURES),
    metavar="FILE",
    required=True,
    help="Output file: .svg, .pdf or .png.",
)
@_SET
@_SEED
def _figure(key: str, out: Path, changes: dict[str, str], seed: int | None) -> None:
    """Draw the figure of an item.

    The panels of a figure such as chen2023/fig-11 are files with their letters.

    \b
    Example:
      $ reproduce figure niu2024/fig-4 --out angles.svg
      Wrote angles.svg
    """
    from reproduce.views.figure import figure

    written = _save(figure(key).rerun(changes, seed=seed).save, out)
    paths = written if isinstance(written, list) else [written]
    click.echo(printable(f"Wrote {' '.join(map(str, paths))}"))


@main.command("cite")
@_ADDRESS
@click.option(
    "--format",
    "form",
    default="bibtex",
    show_default=True,
    help="Format: bibtex, ris, csl, text or sentence.",
)
def _cite(address: str, form: str) -> None:
    """Print the citation of a reproduced item or cell and its paper.

    \b
    Example:
      $ reproduce cite "niu2024/table-2#scale.red" --format text
      The reproduce-pointing developers (2026). Table 2, scale factor, red, of Niu et al. ...
    """
    from reproduce.views import citations

    click.echo(citations.cite(address, form))


@main.command("verify")
@click.argument("citation")
def _verify(citation: str) -> None:
    """Compare the citation of a cell, as text, with known statements.

    The result is "current", "moved since VERSION" or "unknown". The exit status is 0 for a current
    statement, otherwise 1.

    \b
    Example:
      $ reproduce verify "... Table 2, scale factor, red, of Niu et al. (2024) ... rp:..."
      current
    """
    from reproduce.views.verify import verify

    click.echo(result := verify(citation))
    sys.exit(result != "current")


@main.command("audit")
@click.argument("paper", required=False, metavar="[PAPER]")
@_JSON
def _audit(paper: str | None, as_json: bool) -> None:
    """Check the printed numbers of a paper for consistency.

    \b
    Example:
      $ reproduce audit chen2023
      The consistency checks
      chen2023
        Numbers: 218
        Relations: 269
      ...
    """
    from reproduce.views.consistency import ConsistencyAudit

    result = ConsistencyAudit(paper)
    _show(as_json, result.as_json, result)


@main.command("register")
@click.argument("source", type=_FILE, metavar="FILE")
@click.argument("target", type=_FILE, required=False, metavar="[FILE]")
@_PIVOT
@_MODEL
@click.option(
    "--robust",
    is_flag=True,
    default=None,
    help="Guard against wrong matches.  [default: for two FILEs]",
)
@_SEP
@click.option(
    "--threshold",
    type=float,
    help="Detection threshold, in standard deviations of the noise.  [default: 5]",
)
@click.option(
    "--radius",
    type=float,
    help="Largest distance of the stars of a pair, in px.  [default: 2 and 1/1000 of the field]",
)
@click.option(
    "--start",
    type=float,
    nargs=4,
    metavar="SCALE ROTATION SHIFT_X SHIFT_Y",
    help="Rough transform about the pivot, in degrees and px.  [default: found from the stars]",
)
@_JSON
def _register(
    as_json: bool,
    start: tuple[float, float, float, float] | None,
    **settings: Any,
) -> None:
    """Fit the transform that maps your stars onto the same stars of another image.

    One FILE is a table of matched stars: a text file with the names in its first line, - for
    standard input, or an ECSV, FITS, VOTable or SExtractor file. A row is a star, in px, with the
    columns x, y (source) and x_reference, y_reference (target), in any order and case. Optional
    columns are sigma (px, one coordinate of the difference; or sigma_x, sigma_y) and weight (0
    drops the row). The default pivot is the mean of the source stars.

    Two FILEs are FITS images, such as field.fits or field.fits[SCI], or tables with the columns
    x, y, and flux or mag if known. Their stars are found and matched, and the fit is robust. The
    second FILE is the target, and the default pivot is the middle of the first image. If the match
    fails, give a rough transform by --start.

    \b
    Example:
      $ reproduce register stars.csv
      similarity from 5 stars, pivot (502, 508) px
      parameter  unit  value ± standard deviation          95 % interval
      ──────────────────────────────────────────────────────────────────
      scale      1            1.000006 ± 0.000034   0.999922 to 1.000089
      ...
    """
    from reproduce.views import register as registers

    if start:
        scale, rotation, *shift = start
        settings["start"] = scale, math.radians(rotation), *shift
    fit = registers.register(**settings)
    _show(as_json, fit.record, fit)


@main.command("misalignment")
@click.argument("file", type=_FILE)
@_PLATFORM
@_SEP
@_JSON
def _misalignment(file: Path, as_json: bool, **settings: Any) -> None:
    """Measure the misalignment of your camera since the zero point, from spots of its lights.

    FILE is a table, as for register: one spot per row, in px, with the columns group (0 at
    the zero point, 1 at the present), laser (from 1, in the order of the platform), x, y, in any
    order and case. A column frame, a number that the spots of an image share, is necessary if
    spots are lost. A platform is a TOML file of the arguments of Platform.

    \b
    Example:
      $ reproduce misalignment spots.csv
      misalignment in 20 images since the zero point; ...
      about  mean (arcsec)  scatter (arcsec)  ...
      ...
    """
    from reproduce.views import measurements

    result = measurements.misalignment(file, **settings)
    _show(as_json, result.record, result)


@main.command("posterior")
@click.argument("name", required=False, metavar="[NAME]")
@click.option(
    "--list",
    "listed",
    is_flag=True,
    help="List of all posteriors, and of the columns for --data.",
)
@click.option("--data", type=_FILE, help="Your table.  [default: the data of the book]")
@_PIVOT
@_MODEL
@_PLATFORM
@_SEP
@click.option(
    "--prior",
    "priors",
    multiple=True,
    callback=_pairs,
    metavar="PARAMETER=LOW,HIGH",
    help="Uniform prior, in the displayed unit. Repeatable.  [default: the prior of the book]",
)
@_SEED
@click.option(
    "--steps",
    type=int,
    help="Kept steps of each ensemble.  [default: the number of the book]",
)
@click.option(
    "--walkers",
    type=int,
    help="Walkers of each ensemble, an even number.  [default: the number of the book]",
)
@click.option(
    "--out",
    type=_FILE,
    callback=_target(*DRAWS),
    metavar="FILE",
    help="Output file of the draws: .csv, or .nc (ArviZ).",
)
@_JSON
def _posterior(
    name: str | None, listed: bool, as_json: bool, out: Path | None, **settings: Any
) -> None:
    """Sample the posterior NAME and print its summary.

    With --data the same model takes your table (- is standard input) as its data.
    A chain that fails a convergence criterion (R-hat, autocorrelation times, effective sample
    sizes) is rejected: the exit status is 1, and the message gives the number of steps. A warning
    names each bound of a prior at which the posterior piles up.

    \b
    Example:
      $ reproduce posterior simulation-red
      Posterior simulation-red, data as printed in niu2024.
      Quantity               mean ± sd         95 % interval
      ──────────────────────────────────────────────────────
      scale        0.997300 ± 0.000030  0.997248 to 0.997352
      ...
    """
    from reproduce.papers.posteriors import posteriors as declared
    from reproduce.views import posteriors

    if listed:
        titles = {name: one.title for name, one in declared().items()}
        _show(as_json, lambda: titles, posteriors.Posteriors().models)
        return
    if name is None:
        raise click.UsageError("NAME: expected a posterior, got none. Use --list")
    if out and str(out) == str(settings["data"]):
        raise click.UsageError(f"--out: expected another file than the data, got {out}")
    result: Any = posteriors.posterior(name, **settings)
    if out:
        result.check_file(out)
    # On a terminal's standard error, and nothing in a pipe.
    with click.progressbar(
        length=100, label="sampling", file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:
        result.sample(
            progress=lambda done, total: bar.update(100 * done // total - bar.pos)
        )
    _show(as_json, result.record, result)
    if out:
        _save(result.save, out)
