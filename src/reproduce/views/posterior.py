"""A posterior of the book, or the same model for your data. It is sampled on first use."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache, cached_property
from importlib.metadata import version
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from textwrap import dedent, shorten
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.random import default_rng

from reproduce.inference import (
    PosteriorSamples,
    Progress,
    Quantity,
    Summary,
    sampling,
)
from reproduce.inference.models import (
    GaussianRegistration,
    MixtureRegistration,
)
from reproduce.papers.posteriors import posteriors
from reproduce.physics.validate import FloatArray, Text, checked, without_none
from reproduce.printed.cells import find
from reproduce.printed.number import minus
from reproduce.store.files import DRAWS, FilePath, check_target, replacing, write_text
from reproduce.version import __version__
from reproduce.views import _computed as computed
from reproduce.views._base import ResultView, text_of
from reproduce.views._blocks import Block, Blocks, Grid, Html, fold
from reproduce.views._export import export_frame
from reproduce.views._intervals import correlated_pair, draw_intervals
from reproduce.views._keys import check_choice
from reproduce.views._numbers import digits, moments
from reproduce.views.citations import cite_related
from reproduce.views.figure import figure_block

# Arguments that replace numbers of the book: seed of its data, and plan of the sampler.
_NUMBERS = ("data_seed", "steps", "walkers", "seed")
# Characters of the numbers of probably false stars in a sentence.
_NAMES_WIDTH = 40


@cache
def book_posterior(name: str) -> PosteriorSamples:
    """Return a posterior of the book, which only one process of a build samples."""
    declared = posteriors()[name]
    model = declared.model()

    def dump(samples: PosteriorSamples) -> bytes:
        content = BytesIO()
        np.savez(
            content,
            chain=samples.chain,
            acceptance=samples.acceptance,
        )
        return content.getvalue()

    def load(content: bytes) -> PosteriorSamples:
        with np.load(BytesIO(content), allow_pickle=False) as arrays:
            return PosteriorSamples(model, declared.plan.seed, **arrays)

    return computed.cached(
        f"posterior-{name}.npz",
        lambda: sampling.sample(model, declared.plan),
        dump,
        load,
    )


class Posterior(ResultView):
    """A posterior of the book, or the same model for your data, sampled on first use.

    The parameters are those of `reproduce.posterior`; `settings` belong to your data.
    """

    @checked
    def __init__(
        self,
        name: Text,
        data: Any = None,
        priors: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        self.key = self.name = check_choice("name", name, posteriors())
        self.declared = posteriors()[name]
        self._priors = _named(priors)
        settings = without_none(settings)
        self._arguments = {"data": data, **settings}
        numbers = {n: settings.pop(n) for n in _NUMBERS[1:] if n in settings}
        self.plan = replace(self.declared.plan, **numbers)
        self._table, model, self.remarks = self.declared.supplied(data, settings)
        self.model = model.with_priors(self._priors)

    @property
    def changes(self) -> str:
        """Arguments that differ from the posterior of the book, in one line."""
        changes = [f"prior of {name}" for name in self._priors]
        changes += [
            f"{name} = {value}"
            for name, value in self._arguments.items()
            if name in _NUMBERS
        ]
        return ", ".join(changes)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Addresses of the printed cells that the model depends on."""
        return () if self._table else self.declared.inputs

    def _setting(self) -> str:
        return f"data {self.data_text}; {self.changes or 'no change'}"

    @property
    def _in_book(self) -> bool:
        return self._table is None and not self.changes

    @cached_property
    def sampled(self) -> PosteriorSamples:
        """Samples of the posterior, with the model and the chains."""
        return book_posterior(self.name) if self._in_book else self.sample()

    def sample(
        self,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> PosteriorSamples:
        """Sample the posterior now.

        Without the argument `steps`, chains that are too short are sampled again with more steps.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Executor of the ensembles. Default: this process.
        progress : callable, optional
            Function that receives the number of finished and of all ensembles.

        Returns
        -------
        reproduce.inference.PosteriorSamples
            The sampled posterior, also in the attribute ``sampled``.
        """
        self.sampled = sampling.sample(
            self.model,
            self.plan,
            longer="steps" not in self._arguments,
            executor=executor,
            progress=progress,
        )
        return self.sampled

    @property
    def data_record(self) -> dict[str, Any]:
        """Data for programs: kind, paper, truth or file, hash and pivot.

        The hash is the hash of the file, or of the printed cells that the model depends on.
        """
        data: dict[str, Any]
        if table := self._table:
            data = {
                "kind": "file",
                "file": table.path,
                "rows": len(table.values),
                "sha256": table.sha256,
            }
        else:
            data = {
                "kind": "simulated" if self.truth else "printed",
                "paper": self.declared.paper,
                "truth": self.truth,
                "sha256": self.declared.sha256(),
            }
        likelihood = self.model.likelihood
        if isinstance(likelihood, GaussianRegistration):
            data["pivot"] = likelihood.pivot.tolist()
        return data

    @property
    def data_text(self) -> str:
        """Data in one line."""
        if not (table := self._table):
            simulated = "simulated by us with printed settings of"
            source = simulated if self.truth else "as printed in"
            return f"{source} {self.declared.paper}"
        text = f"of {Path(table.path).name}, {len(table.values)} rows"
        if pivot := self.data_record.get("pivot"):
            text += ", pivot ({:.6g}, {:.6g}) px".format(*pivot)
            text += ", the mean of the stars" * ("pivot" not in self._arguments)
        return text

    def stars(self) -> pd.DataFrame:
        """Return the posterior probability of each star to be a wrong match.

        Returns
        -------
        pandas.DataFrame
            One row per star: its row in your table or its number, its position in px,
            ``probability_false``, the mean over the draws, and whether a robust fit drops it.

        Raises
        ------
        ValueError
            If the model has no wrong matches.
        """
        if self._stars is None:
            raise ValueError(
                f"name: expected a model with wrong matches, got {self.name}. Use "
                "registration-mixture"
            )
        return self._stars.copy()

    @cached_property
    def _stars(self) -> pd.DataFrame | None:
        likelihood = self.model.likelihood
        table = self._table
        if not isinstance(likelihood, MixtureRegistration):
            return None
        name, rows = "star", np.arange(len(likelihood.source)) + 1
        if table:
            # Stars of weight zero are omitted.
            name, rows = "row", np.flatnonzero(table.numbers["weight"])
        x, y = likelihood.source.T
        return pd.DataFrame(
            {
                name: rows,
                "x": x,
                "y": y,
                "probability_false": likelihood.probability_false(self.sampled.draws),
                "dropped_by_robust_fit": ~likelihood.agreeing,
            }
        )

    @property
    def false_stars(self) -> str:
        """Stars that are probably matched wrongly, in one line; empty without such a model."""
        if self._stars is None:
            return ""
        false = self._stars.query("probability_false > 0.5").iloc[:, 0]
        names = shorten(", ".join(map(str, false)), _NAMES_WIDTH, placeholder=" ...")
        text = f"{len(false)} of {len(self._stars)} stars are probably matched wrongly"
        return f"{text}: {false.name} {names}" if names else text

    @property
    def source(self) -> str:
        """Source code of the function that makes the model, and of its likelihood."""
        kind = type(self.model.likelihood)
        parts = self.declared.build, kind.__call__, kind.pointwise, kind.white_noise
        return "\n\n".join(dedent(text_of(part)) for part in parts)

    @property
    def setup(self) -> Blocks:
        """Data, priors with their reasons, and the code of the model."""
        grid = Grid.of_frame(
            f"Parameters and priors. Data {self.data_text}.",
            self.priors,
            kind="rp-small",
        )
        code = Markup('<pre class="rp-source">{}</pre>').format(self.source)
        return Blocks((grid, fold("The model as code", Html(code))))

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the displayed unit."""
        rows = pd.DataFrame(self.sampled.summaries)
        return rows.set_index("name").rename_axis("parameter")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Unit and prior of each parameter, with the reason."""
        rows = [
            {
                "parameter": p.name,
                "unit": p.unit,
                "prior": p.text,
                "why": p.prior.reason,
            }
            for p in self.model.parameters
        ]
        return pd.DataFrame(rows).set_index("parameter")

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the displayed unit."""
        return self._in_units(self.sampled.draws)

    def exact(self, draws: int = 10_000, seed: int = 0) -> pd.DataFrame:
        """Return independent draws in closed form, without emcee.

        Registrations and printed registrations have a closed form.

        Parameters
        ----------
        draws : int
            Number of draws.
        seed : int
            Seed of the random number generator.

        Returns
        -------
        pandas.DataFrame
            One row per draw, with the columns of `draws`.

        Raises
        ------
        ValueError
            If the model has no closed form, or none for its priors: log-uniform for the noise,
            uniform for others.
        """
        return self._in_units(self.model.exact(draws, default_rng(seed)))

    def _in_units(self, rows: FloatArray) -> pd.DataFrame:
        columns = self.model.displayed(rows).items()
        return pd.DataFrame({f"{name} ({q.unit})": q.values for name, q in columns})

    def log_likelihood(self) -> pd.DataFrame:
        """Return the log likelihood of each star or spot, one row per thinned draw."""
        values = self.sampled.log_likelihood()
        return pd.DataFrame(values.reshape(-1, values[0, 0].size))

    @property
    def truth(self) -> dict[str, float]:
        """Parameters of the simulation, in the displayed unit; empty for other data."""
        return self._shown(self.model.truth)

    def _shown(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by the name of their parameter in the displayed unit."""
        return {
            p.name: p.shown * values[p.name]
            for p in self.model.parameters
            if p.name in values
        }

    def intervals(self, *names: str) -> Html:
        """Return the interval plot of some quantities, with the most correlated pair.

        The truth of simulated data or the printed value is marked. If a closed form exists, its
        intervals are below those of emcee.

        Parameters
        ----------
        *names : str
            Names of parameters or consequences. Default: all parameters.

        Returns
        -------
        Html
            The plot for a notebook or a page.

        Raises
        ------
        ValueError
            If a name is unknown.
        """
        model, rows, exact = self.model, self.sampled.draws, dict[str, Quantity]()
        known = model.displayed(rows) | model.consequences(rows)
        draws = {
            name: known[check_choice("names", name, known)]
            for name in names or model.names
        }
        labels = {
            name: name.replace(" ", "\n", 1) + _in_brackets(one.unit)
            for name, one in draws.items()
        }
        kind = "truth of the simulation"
        marks = self.truth
        if not (marks or self._table):
            kind = "printed value"
            marks = self._shown(
                {
                    name: find(address)[0].si
                    for name, address in self.declared.summary.items()
                    if "#" in address
                }
            )
        with suppress(ValueError):
            exact = model.displayed(model.exact(len(rows), default_rng(0)))
        pair, correlation = correlated_pair(draws)
        tails = [np.mean(draws[n].values < marks[n]) for n in draws if n in marks]
        inside = sum(0.025 <= tail <= 0.975 for tail in tails)
        sentences = [
            f"Posterior {self.name}, data {self.data_text}.",
            "Boxes: central 50 % with the median; lines: central 95 %; shaded: density.",
            f"Dashed: {kind}." * bool(tails),
            f"The 95 % intervals contain {inside} of {len(tails)} true values."
            * bool(tails and self.truth),
            "Below, in green: the closed form." * bool(exact.keys() & draws),
            f"Panel: draws of {' and '.join(pair)}, with a correlation of "
            f"{minus(f'{correlation:.2f}')}." * bool(pair),
        ]
        return figure_block(
            f"figure-posterior-{model.name}" + "-own" * (not self._in_book),
            lambda figure: draw_intervals(figure, draws, labels, marks, exact, pair),
            f"Medians and intervals of {', '.join(draws)} in the posterior {self.name}.",
            " ".join(filter(None, sentences)),
        )

    def save(self, path: FilePath) -> Path:
        """Write the draws, in the displayed units.

        The draws are nearly independent. An ``.nc`` file has the groups of ArviZ: posterior,
        sample_stats, log_likelihood, posterior_predictive, prior, prior_predictive and
        observed_data, with units, priors and the source of the data as attributes. It needs the
        packages arviz-base and h5netcdf.

        Parameters
        ----------
        path : path
            File with the ending ``.csv``, or ``.nc`` for ArviZ.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        ValueError
            If `path` has another ending, or its folder is missing or cannot be written.
        """
        path = self.check_file(path)
        if path.suffix.lower() == ".csv":
            write_text(path, export_frame(self.draws, "csv", self.provenance))
            return path
        tree = self.sampled.to_datatree()
        data, versions = map(json.dumps, (self.data_record, _versions()))
        tree.attrs |= {"data": data, "versions": versions} | self.provenance
        with replacing(path) as part:
            tree.to_netcdf(part)
        return path

    @staticmethod
    def check_file(path: FilePath) -> Path:
        """Return `path`, or raise `ValueError` if it cannot be written."""
        path = check_target(path, DRAWS)
        if path.suffix.lower() == ".nc" and not all(map(find_spec, _NETCDF_PACKAGES)):
            raise ValueError(
                f"path: expected .csv, because other packages are missing, got {path}. Install "
                f"{' and '.join(_NETCDF_PACKAGES)}"
            )
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return its citation and the citation of the paper: bibtex, ris, csl or text."""
        return cite_related(
            form,
            self.declared.paper,
            f"posterior-{self.name}",
            "Posterior of",
            self.declared.title + ", with other data" * bool(self._table),
            self.changes,
        )

    def rerun(self, **changes: Any) -> Posterior:
        """Return the same model with other arguments of `reproduce.posterior`, not yet sampled.

        Priors of other parameters do not change.
        """
        priors = {**self._priors, **_named(changes.pop("priors", None))}
        arguments = {"name": self.name, **self._arguments, **changes}
        return Posterior(priors=priors, **arguments)

    def record(self) -> dict[str, Any]:
        """Return the summary with its provenance for other programs."""
        samples = self.sampled
        priors = self.priors.reset_index(names="name")
        ensembles, steps, walkers, _ = samples.chain.shape
        stars = {} if self._stars is None else {"stars": self._stars.to_dict("records")}
        return {
            "model": self.name,
            "seed": samples.seed,
            "ensembles": ensembles,
            "steps": steps,
            "walkers": walkers,
            "acceptance": samples.acceptance.tolist(),
            "parameters": [asdict(row) for row in samples.summaries],
            "priors": priors.to_dict("records"),
            "modes": {name: one._asdict() for name, one in samples.modes.items()},
            "checks": samples.checks.reset_index().to_dict("records"),
            "warnings": self.findings,
            "data": self.data_record,
            "versions": _versions(),
            **stars,
        }

    def blocks(self) -> Iterator[Block]:
        """Yield the summary, the convergence, the wrong matches, and warnings."""
        samples = self.sampled
        truth = self.truth
        rows = [
            (row.name + _in_brackets(row.unit), truth.get(row.name, ""), *interval(row))
            for row in samples.summaries
        ]
        columns = ["Quantity", "truth", "mean ± sd", "95 % interval"]
        changed = f" Changed: {self.changes}." if self.changes else ""
        yield Grid.of_frame(
            f"Posterior {self.name}, data {self.data_text}.{changed}",
            pd.DataFrame(rows, columns=columns).set_index("Quantity"),
            identifier=f"posterior-{self.name}" * self._in_book,
        )
        frame = self.frame()
        ensembles, steps, walkers = samples.chain.shape[:3]
        yield (
            f"{ensembles} ensembles of {walkers} walkers, {steps} steps each, seed {samples.seed}; "
            f"acceptance {min(samples.acceptance):.2f} to {max(samples.acceptance):.2f}, R-hat up "
            f"to {frame['rhat'].max():.3f}, effective sample sizes from "
            f"{frame[['bulk', 'tail']].to_numpy().min():.0f}; frame() lists them."
        )
        if self.false_stars:
            yield f"{self.false_stars}."
        if not self._in_book:
            yield from (f"Warning: {text}." for text in self.findings)

    @property
    def findings(self) -> list[str]:
        """Warnings: priors, modes, predictive checks, stars that a robust fit drops, the data."""
        found = [*self.sampled.warnings()]
        stars = self._stars
        if stars is not None:
            dropped = stars["dropped_by_robust_fit"].sum()
            false = (stars["probability_false"] > 0.5).sum()
            if dropped > false:
                found.append(
                    f"a robust fit drops {dropped} stars, the mixture {false}: wrong stars close "
                    "to their positions widen the noise; compare with register(robust=True)"
                )
        return found + self.remarks


_NETCDF_PACKAGES = ("arviz_base", "h5netcdf")


def _versions() -> dict[str, str]:
    """Return the versions of the software that made a posterior."""
    return {
        "reproduce-pointing": __version__,
        **{name: version(name) for name in ("numpy", "scipy", "emcee")},
    }


def _in_brackets(unit: str) -> str:
    return "" if unit == "1" else f" ({unit})"


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Return the mean of a summary, its standard deviation and the bounds of its 95 % as text."""
    low, high = (digits(bound, row.mcse_end) for bound in (row.low, row.high))
    return digits(row.mean, row.mcse), f"{row.deviation:.2g}", low, high


def interval(row: Summary) -> tuple[str, str]:
    """Return mean ± standard deviation of a summary, and the bounds of its 95 % as text."""
    return moments(row.mean, row.deviation), minus(" to ".join(spread(row)[2:]))


def _named(priors: Any) -> Mapping[str, Any]:
    """Return your priors, or raise `TypeError` if they have no names."""
    if not isinstance(priors or {}, Mapping):
        raise TypeError(
            f"priors: expected a mapping of parameters to bounds, got {priors!r}. Write "
            "{name: (low, high)}"
        )
    return priors or {}
