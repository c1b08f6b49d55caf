"""A posterior of the book, or the same model on a reader's data. Sampled when looked at."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from functools import cache, cached_property, partial
from importlib.metadata import version
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from reproduce import inference
from reproduce.inference import Sampled, Summary, bimodal, leanings, misfit, sampling
from reproduce.inference.models import (
    MixtureRegistration,
    exact_draws,
    probability_false,
)
from reproduce.inference.modes import Modes
from reproduce.judge.rerun import check_randomness
from reproduce.papers.charts import NARROW, sized, thin
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import robust_similarity
from reproduce.store.files import DRAWS, check_target, replacing, write_text
from reproduce.store.points import STARS, Table, is_table, matched_stars, read_table
from reproduce.version import __version__
from reproduce.views import computed
from reproduce.views.base import by_row, text_of
from reproduce.views.blocks import Block, Blocks, Fold, Grid, Html
from reproduce.views.export import beside, export_frame, provenance
from reproduce.views.figure import Paint, pictured
from reproduce.views.measurements import Remade, platform_of
from reproduce.views.numbers import digits, minus, moments

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# In standard deviations: a mark further out would leave no room for the posterior.
_FAR = 8.0
# Arguments that belong to your data.
_OWN = (
    "pivot",
    "platform",
    "model",
    "weights",
    "source_covariance",
    "target_covariance",
)
# Likely false stars that a line names.
_SHOWN = 5
# Arrays of a sampled posterior that a build keeps.
_KEPT = ("chain", "log_posterior", "acceptance")


@cache
def book_posterior(name: str) -> Sampled:
    """Return a posterior of the book, which only one process of a build samples."""
    model, plan = posteriors()[name].model(), posteriors()[name].plan()

    def dump(found: Sampled) -> bytes:
        content = BytesIO()
        np.savez(content, **{key: getattr(found, key) for key in _KEPT})
        return content.getvalue()

    def load(content: bytes) -> Sampled:
        with np.load(BytesIO(content), allow_pickle=False) as arrays:
            chain, density, acceptance = (arrays[key] for key in _KEPT)
        return Sampled(model, plan.seed, chain, density, tuple(acceptance.tolist()))

    return computed.once(
        f"posterior-{name}.npz", lambda: sampling.sample(model, plan), dump, load
    )


class Posterior(Remade):
    """A posterior of the book, or the same model on a reader's data. Sampled when looked at.

    It is made from the arguments of `reproduce.posterior`.
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
        self.plan = self.declared.plan(**self._named("steps", "walkers", "seed"))
        self._table, own = self._read(data)
        self.remarks: tuple[str, ...] = ()
        if self._table is None:
            model = self.declared.model(data_seed)
        else:
            model, self.remarks = self.declared.supplied(self._table, own)
        own = {
            p.name: _prior(p, self._priors[p.name])
            for p in model.parameters
            if p.name in self._priors
        }
        self.model = model.with_priors({**self._priors, **own})
        # Printed cells that reach the model.
        self.reads = self.declared.given if self._table is None else ()

    def _read(self, data: Any) -> tuple[Table | None, dict[str, Any]]:
        """Return your data, and the arguments and columns that belong to them."""
        own = {
            key: self._given[key] for key in _OWN if self._given.get(key) is not None
        }
        if data is None:
            for key in own:
                raise ValueError(
                    f"{key}: expected data of your own beside it; ours have one"
                )
            return None, {}
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
        """What a reader changed, in one line; empty for the posterior of the book."""
        numbers = self._named("data_seed", "steps", "walkers", "seed").items()
        priors = (f"prior of {name}" for name in self._priors)
        return ", ".join((*priors, *(f"{key} = {value}" for key, value in numbers)))

    def _named(self, *keys: str) -> dict[str, int]:
        return {
            key: self._given[key] for key in keys if self._given.get(key) is not None
        }

    @property
    def about(self) -> dict[str, str]:
        """What its files say of it, and of its data."""
        return provenance(
            self.cite("text"), f"data {self.told}; {self.changes or 'no change'}"
        )

    @property
    def _in_book(self) -> bool:
        return self._table is None and not self.changes

    @cached_property
    def sampled(self) -> Sampled:
        """The sampled posterior itself, for what this object does not offer."""
        return book_posterior(self.name) if self._in_book else self.sample()

    def sample(
        self,
        executor: Executor | None = None,
        progress: inference.Progress | None = None,
    ) -> Sampled:
        """Sample now, on an executor if wanted; `progress` is told the ensembles done and all.

        Where no number of steps was asked for, chains that are too short are run again, longer.
        """
        longer = self._given.get("steps") is None
        self.sampled = sampling.sample(
            self.model, self.plan, longer=longer, executor=executor, progress=progress
        )
        return self.sampled

    @property
    def provenance(self) -> dict[str, Any]:
        """What the data are, for programs: their kind, the paper, truth or file, hash and pivot.

        The hash is that of the file, or of the printed cells that reach the model.
        """
        declared, own = self.declared, self._table
        data: dict[str, Any] = {
            "kind": "simulated" if declared.simulated else "printed"
        }
        data |= {"paper": declared.paper} | (
            {"truth": self.truth} if declared.simulated else {}
        )
        if own:
            data = {"kind": "file", "file": own.path, "rows": len(own.rows)}
        data["sha256"] = own.sha256 if own else declared.sha256()
        pivots = [one.tolist() for one in getattr(self.model.likelihood, "pivots", ())]
        return data | ({"pivot": pivots} if pivots else {})

    @property
    def told(self) -> str:
        """What the data are, in one line."""
        found, paper = self.provenance, self.declared.paper
        if self._table is None:
            simulated = f"simulated by us with printed settings of {paper}"
            return simulated if self.declared.simulated else f"as printed in {paper}"
        line = f"of {Path(found['file']).name}, {found['rows']} rows"
        if "pivot" in found:
            places = dict.fromkeys(
                "({:.6g}, {:.6g})".format(*one) for one in found["pivot"]
            )
            line += f", pivot {' and '.join(places)} px"
            line += "" if self._given.get("pivot") else ", the mean of the stars"
        return line

    @cached_property
    def checks(self) -> list[inference.PredictiveCheck]:
        """Numbers of the data beside those of data simulated from the posterior."""
        return inference.posterior_checks(self.sampled)

    def stars(self) -> pd.DataFrame:
        """Return each star's posterior probability of being false, the mean over the draws.

        One row per star, with its row in the source or its number, and its place in the channel.

        Raises
        ------
        ValueError
            If the posterior tells of no star whether it is false.
        """
        if self._stars is None:
            raise ValueError(
                f"{self.name} holds all stars for true; take registration-mixture"
            )
        return self._stars.copy()

    @cached_property
    def _stars(self) -> pd.DataFrame | None:
        likelihood = self.model.likelihood
        if not isinstance(likelihood, MixtureRegistration):
            return None
        x, y = likelihood.source.T
        table = self._table
        rows = table.rows if table else range(1, len(x) + 1)
        false = {"x": x, "y": y, "probability_false": probability_false(self.sampled)}
        return pd.DataFrame({"row" if table else "star": rows, **false})

    @property
    def false_stars(self) -> str:
        """Which stars are probably false, in one line; empty where the model tells of none."""
        if self._stars is None:
            return ""
        found = self._stars.sort_values(
            "probability_false", ascending=False, kind="stable"
        )
        likely = [
            str(line) for line in found.loc[found["probability_false"] > 0.5].iloc[:, 0]
        ]
        if not likely:
            return f"None of {len(found)} stars is probably matched wrongly"
        rest = f" and {len(likely) - _SHOWN} more" if len(likely) > _SHOWN else ""
        shown = f"{found.columns[0]} {', '.join(likely[:_SHOWN])}{rest}"
        return (
            f"{len(likely)} of {len(found)} stars are probably matched wrongly: {shown}"
        )

    @property
    def source(self) -> str:
        """The text of the function that makes the model, and of its likelihood."""
        likelihood = dedent(text_of(type(self.model.likelihood).__call__))
        return f"{text_of(self.declared.build)}\n\n{likelihood}"

    @property
    def setup(self) -> Blocks:
        """What is sampled, from which data, under which priors and why; its code unfolds."""
        rows = [(*row[:2], minus(row[2]), row[3]) for row in self.priors.itertuples()]
        heads = ("Parameter", "Unit", "Prior", "Why")
        priors = Grid(
            f"What is sampled. Data {self.told}.", heads, rows, kind="rp-small"
        )
        code = Markup('<pre class="rp-source">{}</pre>').format(self.source)
        return Blocks((priors, Fold("The model as code", (Html(code),))))

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the unit shown."""
        rows = {row.name: vars(row) for row in self.sampled.summaries()}
        return by_row(rows).drop(columns="name").rename_axis("parameter")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Every parameter with its unit, its prior and the reason for it."""
        rows = {
            one.name: (one.unit, str(one.prior.in_unit(one.shown)), one.prior.reason)
            for one in self.model.parameters
        }
        return by_row(rows, ["unit", "prior", "why"])

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the unit shown."""
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
        heads = [f"{one.name} ({one.unit})" for one in self.model.parameters]
        return pd.DataFrame(
            rows * [one.shown for one in self.model.parameters], columns=heads
        )

    def log_likelihood(self) -> pd.DataFrame:
        """Return the log likelihood of each star or spot, one row for each of some draws."""
        found = self.sampled.log_likelihood()
        return pd.DataFrame(found.reshape(found.shape[0] * found.shape[1], -1))

    @property
    def truth(self) -> dict[str, float]:
        """The parameters with which the data were simulated, in the unit shown; none otherwise."""
        return {} if self._table else self._shown(self.declared.true_values())

    def _shown(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values of parameters in the unit shown."""
        factors = {one.name: one.shown for one in self.model.parameters}
        return {name: value * factors[name] for name, value in values.items()}

    def corner(self, *names: str) -> Html:
        """Return the corner plot of up to five parameters, the first ones by default.

        Where the data are simulated the truth is marked, else a least-squares or nominal estimate.
        """
        known = self.model.names
        chosen = names or known[:_MOST]
        if len(set(chosen) & set(known)) < len(chosen) or len(chosen) > _MOST:
            raise ValueError(
                f"expected up to {_MOST} different parameters of {', '.join(known)}; got "
                f"{', '.join(chosen)}; all draws are in `draws`"
            )
        rows = {row.name: row for row in self.sampled.rows}
        marks = {
            name: value
            for name, value in (self.truth or self._shown(self.model.estimate)).items()
            if name in chosen
            and abs(value - rows[name].mean) < _FAR * rows[name].deviation
        }
        mark = (
            "truth of the simulation"
            if self.truth
            else "least-squares or nominal estimate"
        )
        caption = (
            f"Posterior of {self.name}, data {self.told}."
            + f" Orange: {mark}." * bool(marks)
        )
        caption += " Contours hold 50 % and 95 % of the draws." * (len(chosen) > 1)
        alternative = (
            f"Histograms and contours of {', '.join(chosen)} in the posterior."
        )
        paint = partial(_corner_plot, posterior=self.sampled, names=chosen, marks=marks)
        return self._pictured("corner", paint, alternative, caption)

    def traces(self) -> Html:
        """Return the chains: the median of the walkers, a line for each ensemble."""
        alternative = (
            f"One panel for each parameter of {self.name}: lines against the step."
        )
        caption = f"Traces of {self.name}: the median of the walkers, a line for each ensemble."
        paint = partial(_traces, posterior=self.sampled)
        return self._pictured("traces", paint, alternative, caption)

    def _pictured(
        self, kind: str, paint: Paint, alternative: str, caption: str
    ) -> Html:
        name = f"figure-posterior-{self.model.name}-{kind}" + "-own" * (
            not self._in_book
        )
        return pictured(name, paint, alternative, caption)

    def save(self, path: str | Path) -> Path:
        """Write the draws, in the units shown: ``.csv``, or ``.nc`` for ArviZ.

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
            write_text(path, export_frame(self.draws, "csv", self.about))
            return path
        tree = self.sampled.to_datatree()
        facts = {
            "data": json.dumps(self.provenance),
            "versions": json.dumps(_versions()),
        }
        tree.attrs |= {"kind_of_data": self.provenance["kind"], **facts, **self.about}
        with replacing(path) as part:
            tree.to_netcdf(part)
        return path

    @staticmethod
    def check_file(path: str | Path) -> Path:
        """Return `path`, or raise `ValueError` before the sampling if it cannot be written."""
        path = check_target(path, DRAWS)
        if path.suffix.lower() == ".nc" and not all(
            map(find_spec, ("xarray", "h5netcdf"))
        ):
            raise ValueError(
                f"path: {path} needs other packages. Install xarray and h5netcdf"
            )
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the paper that it rests on: bibtex, ris, csl or text."""
        return beside(
            "Posterior", self.name, self.declared.paper, self.declared.title, form
        )

    def rerun(self, **changes: Any) -> Self:
        """Return the same model with other arguments of `reproduce.posterior`, not yet sampled.

        Priors of parameters that are not named stay.
        """
        priors = {**self._priors, **(changes.get("priors") or {})}
        return super().rerun(**{**changes, "priors": priors})

    def record(self) -> dict[str, Any]:
        """Return everything of the summary for other programs."""
        found = self.sampled
        stars = {} if self._stars is None else {"stars": self._stars.to_dict("records")}
        return {
            "model": found.model.name,
            "seed": found.seed,
            **dict(
                zip(
                    ("ensembles", "steps", "walkers"),
                    found.chain.shape[:3],
                    strict=True,
                )
            ),
            "acceptance": list(found.acceptance),
            "at_prior_end": leanings(found),
            "modes": {name: modes._asdict() for name, modes in self.modes.items()},
            "parameters": [asdict(row) for row in found.rows],
            "consequences": [asdict(row) for row in found.consequences],
            "data": self.provenance,
            "priors": self.priors.rename_axis("name").reset_index().to_dict("records"),
            "checks": [asdict(one) for one in self.checks],
            "misfit": misfit(self.checks),
            "versions": _versions(),
            "remarks": list(self.remarks),
        } | stars

    def blocks(self) -> Iterator[Block]:
        """Yield the summary, what follows from it, how precise it is, and warnings."""
        true, found = self.truth, self.sampled.summaries()
        head = ("Quantity", *(["truth"] if true else []), "mean ± sd", "95 % interval")
        marks = {name: (minus(f"{value:.6g}"),) for name, value in true.items()}
        none = ("",) if true else ()
        rows = [
            (_titled(row.name, row.unit), *marks.get(row.name, none), *interval(row))
            for row in found
        ]
        changed = f" Changed: {self.changes}." if self.changes else ""
        identifier = f"posterior-{self.name}" if self._in_book else ""
        caption = f"Posterior {self.name}, data {self.told}.{changed}"
        yield Grid(caption, head, rows, identifier, whole=range(1, len(head)))
        yield self._precision
        if false := self.false_stars:
            yield f"{false}."
        if not self._in_book:
            yield from (f"Warning: {text}." for text in self.findings)

    @property
    def findings(self) -> list[str]:
        """Warnings: priors, modes, stars that a robust fit drops, predictive checks, the data."""
        found = [
            *leanings(self.sampled),
            *map(self._bimodal, self.modes.items()),
            self._dropped,
        ]
        return [one for one in (*found, misfit(self.checks), *self.remarks) if one]

    @cached_property
    def modes(self) -> dict[str, Modes]:
        """Two modes of each parameter that has two, with the fractions of the draws, by name."""
        return bimodal(self.sampled)

    def _bimodal(self, found: tuple[str, Modes]) -> str:
        name, modes = found
        unit = next(
            _unit(one.unit) for one in self.model.parameters if one.name == name
        )
        return (
            f"{name} has two modes: {100 * modes.below:.0f} % of the draws near {modes.low:.3g}"
            f"{unit}, {100 * modes.above:.0f} % near {modes.high:.3g}{unit}. Its mean is neither"
        )

    @property
    def _dropped(self) -> str:
        """A warning if a robust fit drops more stars than the mixture calls false."""
        likelihood = self.model.likelihood
        if self._stars is None or not isinstance(likelihood, MixtureRegistration):
            return ""
        fit = robust_similarity(likelihood.source, likelihood.target, likelihood.pivot)
        dropped, false = (
            (fit.weights == 0).sum(),
            (self._stars["probability_false"] > 0.5).sum(),
        )
        if dropped <= false:
            return ""
        return (
            f"a robust fit drops {dropped} stars, the mixture {false}: wrong stars close to their "
            "places widen the noise; compare with register(robust=True)"
        )

    @property
    def _precision(self) -> str:
        found, frame = self.sampled, self.frame()
        ensembles, steps, walkers = found.chain.shape[:3]
        return (
            f"{ensembles} ensembles of {walkers} walkers, {steps} steps each, seed {found.seed}; "
            f"acceptance {min(found.acceptance):.2f} to {max(found.acceptance):.2f}, R-hat up to "
            f"{frame['rhat'].max():.3f}, effective sample sizes from "
            f"{frame[['bulk', 'tail']].to_numpy().min():.0f}; frame() has them of each quantity."
        )


def _versions() -> dict[str, str]:
    """Return the versions of the software that made a posterior."""
    found = {name: version(name) for name in ("numpy", "scipy", "emcee")}
    return {"reproduce-pointing": __version__, **found}


def _titled(name: str, unit: str) -> str:
    """Write a name with its unit, if it has one."""
    return name if unit == "1" else f"{name} ({unit})"


def _unit(unit: str) -> str:
    """Write a unit after a number."""
    return "" if unit == "1" else f" {unit}"


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the ends of its 95 %."""
    ends = (digits(row.low, row.mcse_end), digits(row.high, row.mcse_end))
    return (digits(row.mean, row.mcse), f"{row.deviation:.2g}", *ends)


def interval(row: Summary) -> tuple[str, str]:
    """Write mean ± standard deviation of a summary, and the ends of its 95 %."""
    _, _, low, high = spread(row)
    return moments(row.mean, row.deviation), minus(f"{low} to {high}")


def _prior(
    parameter: inference.Parameter, prior: inference.Prior | tuple[float, float]
) -> inference.Prior:
    """Return a user's prior in SI units; its numbers are in the displayed unit."""
    if isinstance(prior, inference.Prior):
        return prior.in_unit(1 / parameter.shown)
    try:
        low, high = (float(one) for one in prior)
        if low < 0 and isinstance(parameter.prior, inference.LogUniform):
            raise ValueError(f"expected zero or more, got {low:g}")
        return inference.Uniform(low, high, "a reader's own").in_unit(
            1 / parameter.shown
        )
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"prior of {parameter.name}: {error}. Give two bounds"
        ) from error


_Values = NDArray[np.float64]
# More draws than this do not change the contours, nor more points a trace.
_POINTS, _TRACE_POINTS = 10_000, 45
# Parameters of a corner plot: with more its labels could not be read.
_MOST = 5
# What of the draws an axis leaves out on either side.
_TAILS = (0.002, 0.998)
# Of a corner plot, in inches: the room for ticks and labels, and how far out a label clears ticks
# of seven digits, as of a scale.
_EDGES, _BELOW = 1.1, 0.68
_SMALL = 8.0  # points
_BLUE, _ORANGE = "#0072B2", "#D55E00"


def _traces(figure: Figure, posterior: Sampled) -> None:
    """Draw the median of the walkers of every ensemble against its steps."""
    parameters = posterior.model.parameters
    stride = max(1, posterior.chain.shape[1] // _TRACE_POINTS)
    medians = np.median(posterior.chain[:, ::stride], axis=2)
    steps = np.arange(medians.shape[1]) * stride
    sized(figure, 6.8, 0.9 * len(parameters) + 0.6)
    panels = figure.subplots(len(parameters), sharex=True, squeeze=False).ravel()
    for i, (axes, parameter) in enumerate(zip(panels, parameters, strict=True)):
        axes.plot(steps, parameter.shown * medians[..., i].T, linewidth=0.7)
        axes.set_ylabel(
            _titled(f"${parameter.label}$", parameter.unit), fontsize=_SMALL
        )
        axes.tick_params(labelsize=_SMALL)
        axes.locator_params(axis="y", nbins=2)
        axes.grid(visible=False)
    panels[-1].set_xlabel("step", fontsize=_SMALL)


def _corner_plot(
    figure: Figure, posterior: Sampled, names: Sequence[str], marks: Mapping[str, float]
) -> None:
    """Draw the corner plot of some parameters, with marks in the unit shown where there are any."""
    import corner

    columns = [posterior.model.names.index(name) for name in names]
    chosen = [posterior.model.parameters[i] for i in columns]
    rows = posterior.draws[:, columns]
    rows = rows[np.linspace(0, len(rows) - 1, min(_POINTS, len(rows))).astype(int)]
    values = rows * [one.shown for one in chosen]
    marked = [marks.get(one) for one in names]
    side = NARROW if thin(figure) else min(6.8, 1.3 * len(chosen) + 1.2)
    figure.set_layout_engine(None)
    figure.set_size_inches(side, side)
    corner.corner(
        values,
        range=[_span(*pair) for pair in zip(values.T, marked, strict=True)],
        fig=figure,
        labels=[
            _titled(f"${one.label}$", one.unit).replace(" (", "\n(") for one in chosen
        ],
        label_kwargs={"fontsize": _SMALL},
        max_n_ticks=3,
        truths=marked,
        truth_color=_ORANGE,
        quiet=True,
        color=_BLUE,
        bins=20,
        smooth=1.0,
        levels=(0.5, 0.95),
        plot_datapoints=False,
        plot_density=False,
        no_fill_contours=True,
    )
    below = -_BELOW * len(chosen) / (side - _EDGES)
    for axes in figure.axes:
        axes.tick_params(labelsize=_SMALL)
        axes.grid(visible=False)
        axes.xaxis.set_label_coords(0.5, below)
        axes.yaxis.set_label_coords(below, 0.5)
        for axis in (
            axes.xaxis,
            axes.yaxis,
        ):  # numbers near the ends would meet their neighbours
            ticks, (low, high) = (
                np.asarray(axis.get_majorticklocs()),
                axis.get_view_interval(),
            )
            axis.set_ticks(ticks[np.abs(ticks - (low + high) / 2) < 0.4 * (high - low)])
    figure.subplots_adjust(
        left=_EDGES / side, bottom=_EDGES / side, right=1 - 0.15 / side, top=0.99
    )


def _span(values: _Values, mark: float | None) -> tuple[float, float]:
    """Return the ends of an axis: nearly all draws, and the mark."""
    low, high = np.quantile(values, _TAILS).tolist()
    beside = 0.05 * (high - low)
    return (
        (low, high)
        if mark is None
        else (min(low, mark - beside), max(high, mark + beside))
    )
