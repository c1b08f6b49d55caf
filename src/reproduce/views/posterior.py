"""A posterior of the book, or the same model for your data. It is sampled on first use."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict
from functools import cache, cached_property, partial
from importlib.metadata import version
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from textwrap import dedent
from typing import Any, Self

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from reproduce import inference
from reproduce.inference import (
    PosteriorSamples,
    Summary,
    bimodal,
    misfit,
    prior_warnings,
    sampling,
)
from reproduce.inference.models import (
    MixtureRegistration,
    exact_draws,
    probability_false,
)
from reproduce.inference.modes import Modes
from reproduce.judge.rerun import check_randomness
from reproduce.papers.posteriors import posteriors
from reproduce.store.files import DRAWS, check_target, replacing, write_text
from reproduce.store.points import STARS, DataTable, is_table, matched_stars, read_table
from reproduce.version import __version__
from reproduce.views import computed
from reproduce.views.base import text_of
from reproduce.views.blocks import Block, Blocks, Fold, Grid, Html
from reproduce.views.corner import MAX_PARAMETERS, draw_corner
from reproduce.views.export import cite_related, export_frame, provenance_of
from reproduce.views.figure import figure_block
from reproduce.views.measurements import UserResult, platform_of
from reproduce.views.numbers import digits, minus, moments

# A mark that is further out, in standard deviations, would leave no room for the posterior.
_MAX_MARK = 8.0
# Arguments that belong to your data.
_DATA_ARGUMENTS = (
    "pivot",
    "platform",
    "model",
    "weights",
    "source_covariance",
    "target_covariance",
)
_SAMPLING_ARGUMENTS = ("steps", "walkers", "seed")
# Probably false stars that a line names.
_MAX_NAMED = 5
# Arrays of a sampled posterior that a build stores.
_STORED_ARRAYS = ("chain", "log_posterior", "acceptance")


@cache
def book_posterior(name: str) -> PosteriorSamples:
    """Return a posterior of the book, which only one process of a build samples."""
    model, plan = posteriors()[name].model(), posteriors()[name].plan()

    def dump(found: PosteriorSamples) -> bytes:
        content = BytesIO()
        np.savez(content, **{key: getattr(found, key) for key in _STORED_ARRAYS})
        return content.getvalue()

    def load(content: bytes) -> PosteriorSamples:
        with np.load(BytesIO(content), allow_pickle=False) as arrays:
            chain, density, acceptance = (arrays[key] for key in _STORED_ARRAYS)
        return PosteriorSamples(
            model, plan.seed, chain, density, tuple(acceptance.tolist())
        )

    return computed.cached(
        f"posterior-{name}.npz", lambda: sampling.sample(model, plan), dump, load
    )


class Posterior(UserResult):
    """A posterior of the book, or the same model for your data, sampled on first use.

    The arguments are those of `reproduce.posterior`.
    """

    def __init__(self, name: str, **given: Any) -> None:
        if name not in posteriors():
            raise ValueError(
                f"unknown posterior {name!r}: expected one of {list(posteriors())}"
            )
        self.name, self.declared = name, posteriors()[name]
        self._priors = dict(given.get("priors") or {})
        self._given = {**given, "priors": self._priors, "name": name}
        data, data_seed = given.get("data"), given.get("data_seed")
        if data_seed is not None and (data is not None or not self.declared.simulated):
            raise ValueError(
                f"data_seed: expected none, the data of {name} are not simulated here"
            )
        check_randomness(name, True, (), data_seed)
        self.plan = self.declared.plan(**self._arguments(_SAMPLING_ARGUMENTS))
        self._table: DataTable | None = None
        self.remarks: tuple[str, ...] = ()
        own = self._arguments(_DATA_ARGUMENTS)
        if data is not None:
            self._table, own = self._read(data, own)
            model, self.remarks = self.declared.supplied(self._table, own)
            rows = self._table.rows
            # A star of weight zero is left out.
            self._rows = rows[np.broadcast_to(own.get("weights", 1.0), rows.shape) > 0]
        elif own:
            raise ValueError(
                f"{next(iter(own))}: expected data of your own next to it, got none"
            )
        else:
            model = self.declared.model(data_seed)
        shown = {one.name: one for one in model.parameters}
        priors = {
            key: _prior(shown[key], one) if key in shown else one
            for key, one in self._priors.items()
        }
        self.model = model.with_priors(priors)
        # Printed cells that reach the model.
        self.inputs = self.declared.inputs if self._table is None else ()

    def _arguments(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Return those of the named arguments that are given."""
        given = {name: self._given.get(name) for name in names}
        return {name: value for name, value in given.items() if value is not None}

    def _read(self, data: Any, own: dict[str, Any]) -> tuple[DataTable, dict[str, Any]]:
        """Return your data, and the arguments and columns that belong to them."""
        if not is_table(data):
            raise TypeError(
                f"data: expected a file or a table with named columns, got "
                f"{type(data).__name__}. Use DataFrame(array, columns=[...])"
            )
        file, sep = self.declared.format(), self._given.get("sep")
        for key in own.keys() - {*file.accepts}:
            raise ValueError(
                f"{key}: expected none for {self.name}, got {own[key]!r}. Leave it out"
            )
        if "platform" in own:
            own["platform"] = platform_of(own["platform"])
        if file.columns == STARS:
            return matched_stars(data, None, {**own, "sep": sep})
        return read_table(data, file.columns, file.optional, sep), own

    @property
    def changes(self) -> str:
        """The arguments that differ from the posterior of the book, in one line."""
        numbers = self._arguments(("data_seed", *_SAMPLING_ARGUMENTS)).items()
        priors = (f"prior of {name}" for name in self._priors)
        return ", ".join((*priors, *(f"{key} = {value}" for key, value in numbers)))

    @property
    def provenance(self) -> dict[str, str]:
        """The provenance in its files."""
        setting = f"data {self.data_text}; {self.changes or 'no change'}"
        return provenance_of(self.cite("text"), setting)

    @property
    def _in_book(self) -> bool:
        return self._table is None and not self.changes

    @cached_property
    def sampled(self) -> PosteriorSamples:
        """The sampled posterior itself, for what this object does not offer."""
        return book_posterior(self.name) if self._in_book else self.sample()

    def sample(
        self,
        executor: Executor | None = None,
        progress: inference.Progress | None = None,
    ) -> PosteriorSamples:
        """Sample now, on an executor if given; `progress` receives the ensembles done and all.

        If no number of steps is given, chains that are too short are run again, longer.
        """
        longer = self._given.get("steps") is None
        self.sampled = sampling.sample(
            self.model, self.plan, longer=longer, executor=executor, progress=progress
        )
        return self.sampled

    @property
    def data_record(self) -> dict[str, Any]:
        """The data for programs: kind, paper, truth or file, hash and pivot.

        The hash is that of the file, or of the printed cells that reach the model.
        """
        declared, own = self.declared, self._table
        if own:
            data = {"kind": "file", "file": own.path, "rows": len(own.rows)}
            data["sha256"] = own.sha256
        else:
            kind = "simulated" if declared.simulated else "printed"
            data = {"kind": kind, "paper": declared.paper, "truth": self.truth}
            data["sha256"] = declared.sha256()
        pivots = getattr(self.model.likelihood, "pivots", ())
        return data | ({"pivot": [one.tolist() for one in pivots]} if pivots else {})

    @property
    def data_text(self) -> str:
        """The data in one line."""
        found, paper = self.data_record, self.declared.paper
        if self._table is None:
            simulated = f"simulated by us with printed settings of {paper}"
            return simulated if self.declared.simulated else f"as printed in {paper}"
        line = f"of {Path(found['file']).name}, {found['rows']} rows"
        for x, y in found.get("pivot", ()):
            line += f", pivot ({x:.6g}, {y:.6g}) px"
            line += "" if self._given.get("pivot") else ", the mean of the stars"
        return line

    @cached_property
    def checks(self) -> list[inference.PredictiveCheck]:
        """Numbers of the data compared with those of simulations from the posterior."""
        return inference.posterior_checks(self.sampled)

    def stars(self) -> pd.DataFrame:
        """Return each star's posterior probability of being false, the mean over the draws.

        One row per star, with its row in the source or its number, and its place in the channel.

        Raises
        ------
        ValueError
            If the model has no false stars.
        """
        if self._stars is None:
            raise ValueError(
                f"{self.name} takes all stars as true. Use registration-mixture"
            )
        return self._stars.copy()

    @cached_property
    def _stars(self) -> pd.DataFrame | None:
        likelihood, table = self.model.likelihood, self._table
        if not isinstance(likelihood, MixtureRegistration):
            return None
        found = pd.DataFrame(likelihood.source, columns=["x", "y"])
        found["probability_false"] = probability_false(self.sampled)
        rows = self._rows if table else range(1, len(found) + 1)
        found.insert(0, "row" if table else "star", rows)
        return found

    @property
    def false_stars(self) -> str:
        """The stars that are probably false, in one line; empty if the model has none."""
        if self._stars is None:
            return ""
        found = self._stars.sort_values(
            "probability_false", ascending=False, kind="stable"
        )
        likely = found[found["probability_false"] > 0.5].iloc[:, 0]
        if likely.empty:
            return f"None of {len(found)} stars is probably matched wrongly"
        rest = f" and {len(likely) - _MAX_NAMED} more" * (len(likely) > _MAX_NAMED)
        return (
            f"{len(likely)} of {len(found)} stars are probably matched wrongly: "
            f"{likely.name} {', '.join(map(str, likely[:_MAX_NAMED]))}{rest}"
        )

    @property
    def source(self) -> str:
        """The text of the function that makes the model, and of its likelihood."""
        kind = type(self.model.likelihood)
        parts = (self.declared.build, kind.__call__, kind.pointwise)
        return "\n\n".join(dedent(text_of(part)) for part in parts)

    @property
    def setup(self) -> Blocks:
        """Data, priors with their reasons, and the code of the model."""
        rows = [(*row[:2], minus(row[2]), row[3]) for row in self.priors.itertuples()]
        heads = ("Parameter", "Unit", "Prior", "Why")
        title = f"What is sampled. Data {self.data_text}."
        code = Markup('<pre class="rp-source">{}</pre>').format(self.source)
        fold = Fold("The model as code", (Html(code),))
        return Blocks((Grid(title, heads, rows, kind="rp-small"), fold))

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the displayed unit."""
        rows = {row.name: vars(row) for row in self.sampled.summaries()}
        frame = pd.DataFrame.from_dict(rows, orient="index")
        return frame.drop(columns="name").rename_axis("parameter")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Unit and prior of each parameter, with the reason."""
        rows = {
            one.name: (one.unit, str(one.prior.in_unit(one.shown)), one.prior.reason)
            for one in self.model.parameters
        }
        columns = ["unit", "prior", "why"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns)

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the displayed unit."""
        return self._framed(self.sampled.draws)

    def exact(self, draws: int = 10_000, seed: int = 0) -> pd.DataFrame:
        """Return independent draws of a registration in closed form, as `draws`, without emcee.

        Raises
        ------
        ValueError
            If the model has no closed form.
        """
        return self._framed(exact_draws(self.model, draws, np.random.default_rng(seed)))

    def _framed(self, rows: NDArray[np.float64]) -> pd.DataFrame:
        parameters = self.model.parameters
        heads = [f"{one.name} ({one.unit})" for one in parameters]
        return pd.DataFrame(rows * [one.shown for one in parameters], columns=heads)

    def log_likelihood(self) -> pd.DataFrame:
        """Return the log likelihood of each star or spot, one row for each of some draws."""
        found = self.sampled.log_likelihood()
        return pd.DataFrame(found.reshape(found.shape[0] * found.shape[1], -1))

    @property
    def truth(self) -> dict[str, float]:
        """The parameters of the simulation, in the displayed unit; empty for other data."""
        return {} if self._table else self._shown(self.declared.true_values())

    def _shown(self, values: Mapping[str, float]) -> dict[str, float]:
        factors = {one.name: one.shown for one in self.model.parameters}
        return {name: value * factors[name] for name, value in values.items()}

    def corner(self, *names: str) -> Html:
        """Return the corner plot of up to five parameters, the first ones by default.

        The truth of simulated data is marked, else a least-squares or nominal estimate.
        """
        known = self.model.names
        names = names or known[:MAX_PARAMETERS]
        if len({*names} & {*known}) < len(names) or len(names) > MAX_PARAMETERS:
            raise ValueError(
                f"names: expected up to {MAX_PARAMETERS} different parameters of "
                f"{', '.join(known)}, got {', '.join(names)}. All draws are in `draws`"
            )
        kind, found = "truth of the simulation", self.truth
        if not found:
            kind = "least-squares or nominal estimate"
            start = self.model.likelihood.start()[0].tolist()
            found = self._shown(dict(zip(known, start, strict=True)))
        rows = {row.name: row for row in self.sampled.rows if row.name in names}
        marks = {
            name: found[name]
            for name, row in rows.items()
            if name in found and abs(found[name] - row.mean) < _MAX_MARK * row.deviation
        }
        caption = f"Posterior of {self.name}, data {self.data_text}."
        caption += f" Orange: {kind}." * bool(marks)
        caption += " Contours hold 50 % and 95 % of the draws." * (len(names) > 1)
        return figure_block(
            f"figure-posterior-{self.model.name}-corner" + "-own" * (not self._in_book),
            partial(draw_corner, posterior=self.sampled, names=names, marks=marks),
            f"Histograms and contours of {', '.join(names)} in the posterior.",
            caption,
        )

    def save(self, path: str | Path) -> Path:
        """Write the draws, in the displayed units: ``.csv``, or ``.nc`` for ArviZ.

        The draws are nearly independent. An ``.nc`` file has the groups of ArviZ: posterior,
        sample_stats, log_likelihood, posterior_predictive, prior, prior_predictive and
        observed_data, with units, priors and the source of the data as attributes. It needs the
        packages xarray and h5netcdf.

        Raises
        ------
        ValueError
            If `path` has another ending, or its folder is missing or cannot be written.
        """
        path = self.check_file(path)
        if path.suffix.lower() == ".csv":
            write_text(path, export_frame(self.draws, "csv", self.provenance))
            return path
        tree, data = self.sampled.to_datatree(), self.data_record
        facts = {"data": json.dumps(data), "versions": json.dumps(_versions())}
        tree.attrs |= {"kind_of_data": data["kind"], **facts, **self.provenance}
        with replacing(path) as part:
            tree.to_netcdf(part)
        return path

    @staticmethod
    def check_file(path: str | Path) -> Path:
        """Return `path`, or raise `ValueError` before the sampling if it cannot be written."""
        path = check_target(path, DRAWS)
        packages = ("xarray", "h5netcdf") if path.suffix.lower() == ".nc" else ()
        if not all(map(find_spec, packages)):
            raise ValueError(
                f"path: {path} needs other packages. Install xarray and h5netcdf"
            )
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return its citation with that of the paper: bibtex, ris, csl or text."""
        declared = self.declared
        return cite_related(
            "Posterior", self.name, declared.paper, declared.title, form
        )

    def rerun(self, **changes: Any) -> Self:
        """Return the same model with other arguments of `reproduce.posterior`, not yet sampled.

        Priors of parameters that are not named stay.
        """
        priors = {**self._priors, **(changes.get("priors") or {})}
        return super().rerun(**{**changes, "priors": priors})

    def record(self) -> dict[str, Any]:
        """Return everything of the summary for other programs."""
        found, stars = self.sampled, self._stars
        sizes = zip(("ensembles", "steps", "walkers"), found.chain.shape, strict=False)
        return {
            "model": found.model.name,
            "seed": found.seed,
            **dict(sizes),
            "acceptance": list(found.acceptance),
            "at_prior_end": prior_warnings(found),
            "modes": {name: modes._asdict() for name, modes in self.modes.items()},
            "parameters": [asdict(row) for row in found.rows],
            "consequences": [asdict(row) for row in found.consequences],
            "data": self.data_record,
            "priors": self.priors.rename_axis("name").reset_index().to_dict("records"),
            "checks": [asdict(one) for one in self.checks],
            "misfit": misfit(self.checks),
            "versions": _versions(),
            "remarks": list(self.remarks),
        } | ({} if stars is None else {"stars": stars.to_dict("records")})

    def blocks(self) -> Iterator[Block]:
        """Yield the summary, the convergence, the false stars, and warnings."""
        truth = {name: minus(f"{value:.6g}") for name, value in self.truth.items()}
        rows = [
            (
                row.name if row.unit == "1" else f"{row.name} ({row.unit})",
                *((truth.get(row.name, ""),) if truth else ()),
                *interval(row),
            )
            for row in self.sampled.summaries()
        ]
        head = (
            "Quantity",
            *(("truth",) if truth else ()),
            "mean ± sd",
            "95 % interval",
        )
        changed = f" Changed: {self.changes}." if self.changes else ""
        identifier = f"posterior-{self.name}" if self._in_book else ""
        caption = f"Posterior {self.name}, data {self.data_text}.{changed}"
        yield Grid(caption, head, rows, identifier)
        yield self._convergence
        if false := self.false_stars:
            yield f"{false}."
        if not self._in_book:
            yield from (f"Warning: {text}." for text in self.findings)

    @property
    def findings(self) -> list[str]:
        """Warnings: priors, modes, stars that a robust fit drops, predictive checks, the data."""
        modes = (
            f"{name} has two modes: {100 * one.below:.0f} % of the draws near {one.low:.3g}, "
            f"{100 * one.above:.0f} % near {one.high:.3g} (in {self.priors['unit'][name]}). Its "
            "mean is neither"
            for name, one in self.modes.items()
        )
        found = [*prior_warnings(self.sampled), *modes, self._dropped]
        return [one for one in (*found, misfit(self.checks), *self.remarks) if one]

    @cached_property
    def modes(self) -> dict[str, Modes]:
        """Two modes of each parameter that has two, with the fractions of the draws, by name."""
        return bimodal(self.sampled)

    @property
    def _dropped(self) -> str:
        """A warning if a robust fit drops more stars than the mixture calls false."""
        likelihood = self.model.likelihood
        if self._stars is None or not isinstance(likelihood, MixtureRegistration):
            return ""
        dropped = (~likelihood.agreeing).sum()
        false = (self._stars["probability_false"] > 0.5).sum()
        if dropped <= false:
            return ""
        return (
            f"a robust fit drops {dropped} stars, the mixture {false}: wrong stars close to their "
            "places widen the noise; compare with register(robust=True)"
        )

    @property
    def _convergence(self) -> str:
        found, frame = self.sampled, self.frame()
        ensembles, steps, walkers = found.chain.shape[:3]
        size = frame[["bulk", "tail"]].to_numpy().min()
        return (
            f"{ensembles} ensembles of {walkers} walkers, {steps} steps each, seed {found.seed}; "
            f"acceptance {min(found.acceptance):.2f} to {max(found.acceptance):.2f}, R-hat up to "
            f"{frame['rhat'].max():.3f}, effective sample sizes from {size:.0f}; frame() has them "
            "of each quantity."
        )


def _versions() -> dict[str, str]:
    """Return the versions of the software that made a posterior."""
    found = {name: version(name) for name in ("numpy", "scipy", "emcee")}
    return {"reproduce-pointing": __version__, **found}


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the bounds of its 95 %."""
    low, high = (digits(bound, row.mcse_end) for bound in (row.low, row.high))
    return digits(row.mean, row.mcse), f"{row.deviation:.2g}", low, high


def interval(row: Summary) -> tuple[str, str]:
    """Write mean ± standard deviation of a summary, and the bounds of its 95 %."""
    return moments(row.mean, row.deviation), minus(" to ".join(spread(row)[2:]))


def _prior(
    parameter: inference.Parameter, prior: inference.Prior | tuple[float, float]
) -> inference.Prior:
    """Return your prior in SI units; its numbers are in the displayed unit."""
    if not isinstance(prior, inference.Prior):
        try:
            low, high = (float(one) for one in prior)
            if low < 0 and isinstance(parameter.prior, inference.LogUniform):
                raise ValueError(f"expected zero or more, got {low:g}")
            prior = inference.Uniform(low, high, "bounds given by the user")
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"prior of {parameter.name}: {error}. Give two bounds"
            ) from error
    return prior.in_unit(1 / parameter.shown)
