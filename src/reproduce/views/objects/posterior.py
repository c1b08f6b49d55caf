"""A posterior of the book, or the same model on a reader's data. Sampled when looked at."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, replace
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from reproduce.store.points import is_table
from reproduce.version import __version__
from reproduce.views import computed
from reproduce.views.objects.base import Shown, by_row, text_of
from reproduce.views.platforms import platform_of
from reproduce.views.writing.blocks import Block, Fold, Grid, Html
from reproduce.views.writing.display import Blocks
from reproduce.views.writing.export import beside, export_frame
from reproduce.views.writing.numbers import digits, minus, moments

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.inference import (
        Model,
        Parameter,
        PredictiveCheck,
        Prior,
        Progress,
        Repeat,
        Sampled,
        Share,
        Summary,
    )
    from reproduce.inference.sampling import Plan
    from reproduce.papers.declare_posterior import Declaration, Supplied
    from reproduce.physics.attitude import Platform
    from reproduce.views.objects.figure import Picture

# Rows that a page shows at once.
SHORT = 20
# A correlation that a picture does not show.
WEAK = 0.15
# In standard deviations: a mark further out would leave no room for the posterior.
FAR = 8.0
# Likely false stars that a line names, and from where on their probability is not told apart.
SHOWN, CERTAIN = 5, 0.99
# Files that `save` writes.
ENDINGS = (".nc", ".npz")


@cache
def book_posterior(name: str) -> Sampled:
    """Return the posterior of the book, sampled and summarised once in a build."""
    from reproduce.inference import Sampled, sampling
    from reproduce.papers.posteriors import posteriors

    def sampled() -> Sampled:
        declared = posteriors()[name]
        found = sampling.sample(declared.model(), declared.plan())
        found.summaries()  # kept with the draws
        return found

    return computed.once(f"posterior-{name}", Sampled, sampled)


def book_repeats(name: str) -> tuple[list[Repeat], Share, str] | None:
    """Return the printed numbers among those of repeats, as declared; simulated once in a build."""
    from reproduce.papers.posteriors import posteriors

    declared = posteriors()[name]
    kept = computed.once(f"repeats-{name}", list, lambda: [declared.repeats(book_posterior(name))])
    repeated: tuple[list[Repeat], Share, str] | None = kept[0]
    return repeated


class Posterior(Shown):
    """A posterior of the book, or the same model on a reader's data. Sampled when looked at.

    Parameters
    ----------
    name : str
        Such as ``registration``.
    data : str, Path or DataFrame, optional
        A reader's CSV or table in place of the book's data.
    pivot : tuple of float, optional
        Principal point of these data, in px.
    priors : mapping, optional
        Name of a parameter to its lowest and highest value in the unit shown, between which the
        prior is even, or to a prior of `reproduce.inference.priors`.
    platform : Platform or path, optional
        Lights and tracker of the spots of these data.
    data_seed : int, optional
        Of the data, where they are simulated by us.
    steps, walkers, ensembles, seed : int, optional
        How it is sampled, in place of the book's own plan.
    """

    def __init__(
        self,
        name: str,
        data: str | Path | pd.DataFrame | None = None,
        pivot: tuple[float, float] | None = None,
        priors: Mapping[str, Prior | tuple[float, float]] | None = None,
        platform: Platform | str | Path | None = None,
        data_seed: int | None = None,
        **settings: int | None,
    ) -> None:
        from reproduce.papers.posteriors import posteriors

        if name not in posteriors():
            raise ValueError(f"unknown posterior {name!r}: expected one of {list(posteriors())}")
        self.name, self.data, self.pivot, self.platform = name, data, pivot, platform
        self.data_seed = data_seed
        if data_seed is not None and (data is not None or not self.declared.simulated):
            raise ValueError(f"data_seed: expected none, the data of {name} are not simulated here")
        if platform is not None and data is None:
            raise ValueError("platform: expected data of your own beside it; ours have one")
        self._priors = dict(priors or {})
        self.settings = {key: value for key, value in settings.items() if value is not None}
        if unknown := set(self.settings) - {"steps", "walkers", "ensembles", "seed"}:
            raise TypeError(
                f"unknown {sorted(unknown)}: expected data, pivot, priors, data_seed, steps, "
                "walkers, ensembles or seed"
            )
        if data is not None and not is_table(data):
            raise TypeError(
                f"data: expected a file, - or a DataFrame with named columns, got "
                f"{type(data).__name__}; DataFrame(array, columns=[...]) names them"
            )
        # What is wrong is refused here, not when it is looked at.
        _ = self.plan
        if self._priors:
            _ = self.model

    @cached_property
    def declared(self) -> Declaration:
        """How the posterior is declared: its data and published numbers."""
        from reproduce.papers.posteriors import posteriors

        return posteriors()[self.name]

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of the printed cells that reach the model."""
        return self.declared.given if self.data is None else ()

    @property
    def where(self) -> str:
        """Where the data come from: print, our simulation, or a reader's file."""
        if self._supplied:
            return f"data of {Path(self._supplied.source).name}"
        simulated = self.declared.simulated
        return "data simulated by us from printed settings" if simulated else "data as printed"

    @cached_property
    def _supplied(self) -> Supplied | None:
        if self.data is None:
            return None
        design = None if self.platform is None else platform_of(self.platform)
        return self.declared.from_file(self.data, self.pivot, design)

    @cached_property
    def model(self) -> Model:
        """What is sampled: parameters with their priors, and the likelihood of the data."""
        model = self._supplied.model if self._supplied else self.declared.model(self.data_seed)
        if strays := sorted(set(self._priors) - set(model.names)):
            raise ValueError(
                f"{self.name} has no parameter {', '.join(strays)}; it has {', '.join(model.names)}"
            )
        parameters = (
            replace(one, prior=_prior(one, self._priors[one.name]))
            if one.name in self._priors
            else one
            for one in model.parameters
        )
        return replace(model, parameters=tuple(parameters))

    @property
    def plan(self) -> Plan:
        """How it is sampled."""
        return self.declared.plan(**self.settings)

    @cached_property
    def sampled(self) -> Sampled:
        """The sampled posterior itself, for what this object does not offer."""
        if self.data is None and not self.changes:
            return book_posterior(self.name)
        return self.sample()

    def sample(
        self,
        executor: Executor | None = None,
        folder: Path | None = None,
        progress: Progress | None = None,
    ) -> Sampled:
        """Sample now: on an executor, with its chains kept in a folder and continued from there.

        Where no number of steps was asked for, chains that are too short are run again, longer.
        """
        from reproduce.inference import sampling

        self.sampled = sampling.sample(
            self.model, self.plan, longer="steps" not in self.settings,
            executor=executor, folder=folder, progress=progress,
        )  # fmt: skip
        return self.sampled

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """What the data are, for programs: their kind, the paper, truth or file, hash and pivot.

        The hash is that of the file, or of the printed cells that reach the model.
        """
        declared, given = self.declared, self._supplied
        data: dict[str, Any] = {"kind": "simulated" if declared.simulated else "printed"}
        data |= {"paper": declared.paper} | ({"truth": self.truth} if declared.simulated else {})
        if given:
            data = {"kind": "file", "file": given.source, "rows": len(given.lines)}
        data["sha256"] = given.sha256 if given else declared.sha256()
        pivots = [one.tolist() for one in getattr(self.model.likelihood, "pivots", ())]
        return data | ({"pivot": pivots} if pivots else {})

    @property
    def told(self) -> str:
        """What the data are, in one line."""
        found = self.provenance
        if found["kind"] == "printed":
            return f"as printed in {found['paper']}"
        if found["kind"] == "simulated":
            units = {one.name: one.unit for one in self.model.parameters}
            shown = ", ".join(
                f"{name} {value:.6g}" + ("" if units[name] == "1" else f" {units[name]}")
                for name, value in found["truth"].items()
            )
            return f"simulated by us with printed settings of {found['paper']}; truth: {shown}"
        frame = hasattr(self.data, "iloc")
        file = "DataFrame" if frame else f"file {Path(found['file']).name}"
        line = f"your {file}, {found['rows']} {'rows' if frame else 'lines'}"
        if "pivot" in found:
            places = dict.fromkeys("({:.6g}, {:.6g})".format(*one) for one in found["pivot"])
            line += f", pivot {' and '.join(places)} px"
            line += "" if self.pivot else ", the mean of the stars"
        return line

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should hear of the data of a file."""
        return self._supplied.remarks if self._supplied else ()

    @property
    def warnings(self) -> list[str]:
        """The remarks, after the ends of priors that hold the posterior, and a misfit."""
        from reproduce.inference import leanings, misfit

        told = misfit(self.checks)
        return [*map(str, leanings(self.sampled)), *([told] if told else []), *self.remarks]

    @cached_property
    def checks(self) -> list[PredictiveCheck]:
        """Numbers of the data beside those of data simulated from the posterior."""
        from reproduce.inference import posterior_checks

        return posterior_checks(self.sampled)

    def stars(self) -> pd.DataFrame:
        """Return each star's posterior probability of being false, the mean over the draws.

        One row per star, with its line in the file or its number, and its place in the channel.

        Raises
        ------
        ValueError
            If the posterior tells of no star whether it is false.
        """
        if self._stars is None:
            raise ValueError(f"{self.name} holds all stars for true; take registration-mixture")
        return self._stars.copy()

    @cached_property
    def _stars(self) -> pd.DataFrame | None:
        import pandas as pd

        from reproduce.inference.models import MixtureRegistration, probability_false

        likelihood = self.model.likelihood
        if not isinstance(likelihood, MixtureRegistration):
            return None
        x, y = likelihood.source.T
        lines = self._supplied.lines if self._supplied else range(1, len(x) + 1)
        false = {"x": x, "y": y, "probability_false": probability_false(self.sampled)}
        return pd.DataFrame({"line" if self._supplied else "star": lines, **false})

    @property
    def false_stars(self) -> str:
        """Which stars are probably false, in one line; empty where the model tells of none."""
        if self._stars is None:
            return ""
        found = self._stars.sort_values("probability_false", ascending=False, kind="stable")
        likely = found[found["probability_false"] > 0.5]
        if likely.empty:
            return f"None of {len(found)} stars is probably matched wrongly"
        shown = ", ".join(
            f"{found.columns[0]} {line:.0f} ({_probability(value)})"
            for line, _, _, value in likely.head(SHOWN).itertuples(index=False)
        )
        rest = f" and {len(likely) - SHOWN} more" if len(likely) > SHOWN else ""
        return (
            f"{len(likely)} of {len(found)} stars are probably matched wrongly, with probability: "
            f"{shown}{rest}"
        )

    @property
    def source(self) -> str:
        """The text of the declaration, of the function that makes the model, and of its likelihood.

        What is sampled, from which data, and what the data say of it.
        """
        likelihood = dedent(text_of(type(self.model.likelihood).__call__))
        return "\n\n".join((_declaration(self.declared), text_of(self.declared.build), likelihood))

    @property
    def setup(self) -> Blocks:
        """What is sampled, from which data, under which priors and why; its code unfolds."""
        rows = list(self.priors.itertuples(name=None))
        rows = [(name, unit, prior.replace(" -", " −"), why) for name, unit, prior, why in rows]
        caption = f"What is sampled. {self.where.capitalize()}."
        priors = Grid(caption, ("Parameter", "Unit", "Prior", "Why"), rows, kind="rp-small")
        code = Markup('<pre class="rp-source">{}</pre>').format(self.source)
        return Blocks((priors, Fold("The model as code", (Html(code),))))

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the unit shown."""
        rows = {row.name: vars(row) for row in self.sampled.summaries()}
        return by_row(rows).drop(columns="name")

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
        import pandas as pd

        found = self.sampled
        shown = {
            f"{one.name} ({one.unit})": column * one.shown
            for one, column in zip(found.model.parameters, found.draws.T, strict=True)
        }
        return pd.DataFrame(shown)

    @property
    def truth(self) -> dict[str, float]:
        """The parameters with which the data were simulated, in the unit shown; none otherwise."""
        if self.data is not None:
            return {}
        factors = {one.name: one.shown for one in self.model.parameters}
        return {name: value * factors[name] for name, value in self.declared.true_values().items()}

    def corner(self, *names: str) -> Html:
        """Return the corner plot of up to five parameters, the first ones by default.

        Where the data are simulated the truth is marked, else a least-squares or nominal estimate.
        """
        from reproduce.views.writing.posterior_figures import MOST, corner

        known = self.model.names
        chosen = names or known[:MOST]
        if len(chosen) > MOST or len(set(chosen)) < len(chosen) or not set(chosen) <= set(known):
            raise ValueError(
                f"expected up to {MOST} different parameters of {', '.join(known)}; got "
                f"{', '.join(chosen)}; all draws are in `draws`"
            )
        factors = {one.name: one.shown for one in self.model.parameters}
        true = {name: value / factors[name] for name, value in self.truth.items()}
        rows = {row.name: row for row in self.sampled.rows()}
        marks = {
            name: value
            for name, value in (true or self.model.estimate).items()
            if len(chosen) == 1
            or abs(value * factors[name] - rows[name].mean) < FAR * rows[name].deviation
        }
        mark = "truth of the simulation" if true else "least-squares or nominal estimate"
        caption = f"Posterior of {self.name}, {self.where}."
        caption += f" Orange: {mark}." if set(marks) & set(chosen) else ""
        caption += " Contours hold 50 % and 95 % of the draws." if len(chosen) > 1 else ""
        alternative = f"Histograms of {', '.join(chosen)} in the posterior of {self.name}"
        alternative += self._related(chosen) if len(chosen) > 1 else "."
        return self._pictured(corner(self.sampled, chosen, marks), alternative, caption, corner)

    def traces(self) -> Html:
        """Return the chains: the median of the walkers, a line for each ensemble."""
        from reproduce.views.writing.posterior_figures import traces

        alternative = (
            f"One panel for each parameter of {self.name}, with the median of the walkers of each "
            "ensemble against the step."
        )
        caption = f"Traces of {self.name}: the median of the walkers, a line for each ensemble."
        return self._pictured(traces(self.sampled), alternative, caption, traces)

    def _pictured(
        self, picture: Picture, alternative: str, caption: str, draw: Callable[..., Picture]
    ) -> Html:
        """Return a picture with its downloads; a reader's own is in no file of the book."""
        from reproduce.views.objects.figure import (
            Vectors,
            captioned,
            drawn,
            inline,
            pictured,
            vector_of,
        )

        if self.data is None and not self.changes:
            return pictured(picture, alternative, caption, text_of(draw))
        wide, narrow = (vector_of(drawn(picture.paint, narrow=one)) for one in (False, True))
        name = f"figure-{picture.key}-own"
        return Html(inline(Vectors(wide, narrow), name, alternative, captioned(caption)))

    def _related(self, names: Sequence[str]) -> str:
        """Say which two parameters are correlated most."""
        found = self.draws.to_numpy()[:, [self.model.names.index(name) for name in names]]
        related = np.triu(np.corrcoef(found.T), 1)
        i, j = (int(k) for k in np.unravel_index(np.argmax(np.abs(related)), related.shape))
        if abs(related[i, j]) < WEAK:
            return ", with contours of each pair. No two of them are notably correlated."
        return (
            f", with contours of each pair. The pair with the strongest correlation is {names[i]} "
            f"and {names[j]}, {related[i, j]:z.1f}.".replace("-0", "−0")
        )

    def export(self, form: str) -> str:
        """Return the summary as csv, json, latex or markdown."""
        return export_frame(self.frame().rename_axis("parameter").reset_index(), form)

    def save(self, path: str | Path) -> Path:
        """Write the chains: ``.nc`` for ArviZ (the extra ``netcdf``), ``.npz`` for NumPy alone.

        In the units shown. An ``.nc`` holds draws that are nearly independent, with units, priors
        and what the data are; an ``.npz`` every step.

        Raises
        ------
        ValueError
            If the ending is another one.
        """
        path = Path(path)
        if path.suffix == ".nc":
            tree = self.sampled.to_datatree()
            facts = {"data": json.dumps(self.provenance), "versions": json.dumps(_versions())}
            tree.attrs |= {"kind_of_data": self.provenance["kind"], **facts}
            tree.to_netcdf(path)
        elif path.suffix == ".npz":
            found = self.sampled
            parameters = found.model.parameters
            names, units = (np.array([getattr(p, a) for p in parameters]) for a in ("name", "unit"))
            chain = found.chain * [one.shown for one in parameters]
            np.savez_compressed(
                path, names=names, units=units, chain=chain, log_posterior=found.log_posterior
            )
        else:
            raise ValueError(f"unknown ending {path.suffix!r}: expected {' or '.join(ENDINGS)}")
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the paper that it rests on: bibtex or text."""
        return beside("Posterior", self.name, self.declared.paper, self.declared.title, form)

    def rerun(
        self,
        data: str | Path | pd.DataFrame | None = None,
        pivot: tuple[float, float] | None = None,
        priors: Mapping[str, Prior | tuple[float, float]] | None = None,
        platform: Platform | str | Path | None = None,
        data_seed: int | None = None,
        **settings: int | None,
    ) -> Posterior:
        """Return the same model on other data, under other priors, or sampled in another way.

        Parameters
        ----------
        data, pivot, platform
            A reader's CSV, its principal point or instrument; those of this object by default.
        priors : mapping, optional
            As for `Posterior`; those of other parameters stay.
        data_seed : int, optional
            Of the data, where they are simulated by us.
        **settings : int
            ``steps``, ``walkers``, ``ensembles`` or ``seed``.

        Returns
        -------
        Posterior
            Not yet sampled.
        """
        kept = {**self.settings, **settings}
        changed = {**self._priors, **(priors or {})}
        design = self.platform if platform is None else platform
        given = self.data if data is None else data
        drawn = self.data_seed if data_seed is None else data_seed
        return Posterior(self.name, given, pivot or self.pivot, changed, design, drawn, **kept)

    def record(self) -> dict[str, Any]:
        """Return everything of the summary for other programs."""
        from reproduce.inference import leanings, misfit

        found = self.sampled
        stars = {} if self._stars is None else {"stars": self._stars.to_dict("records")}
        return {
            "model": found.model.name,
            "seed": found.seed,
            "ensembles": found.chain.shape[0],
            "steps": found.chain.shape[1],
            "walkers": found.chain.shape[2],
            "acceptance": list(found.acceptance),
            "at_prior_end": [asdict(one) for one in leanings(found)],
            "parameters": [asdict(row) for row in found.rows()],
            "consequences": [asdict(row) for row, _ in found.consequences()],
            "data": self.provenance,
            "priors": self.priors.rename_axis("name").reset_index().to_dict("records"),
            "checks": [asdict(one) for one in self.checks],
            "misfit": misfit(self.checks),
            "versions": _versions(),
            "remarks": list(self.remarks),
        } | stars

    def blocks(self) -> Iterator[Block]:
        """Yield the summary, what follows from it, how precise it is, and what to beware of."""
        true, own = self.truth, self.changes
        head = ("Quantity", *(["truth"] if true else []), "mean ± sd", "95 % interval")
        marks = {name: (minus(f"{value:.6g}"),) for name, value in true.items()}
        none = ("",) if true else ()
        found = self.sampled.summaries()
        rows = [(_named(row), *marks.get(row.name, none), *interval(row)) for row in found]
        caption = f"Posterior {self.name}, {self.where}." + (f" Changed: {own}." if own else "")
        first = len(rows) if len(rows) <= SHORT else self.model.dimension
        identifier = "" if self._supplied or own else f"posterior-{self.name}"
        yield Grid(caption, head, rows[:first], identifier, whole=range(1, len(head)))
        if rows[first:]:
            rest = Grid("What follows from the parameters.", head, rows[first:])
            yield Fold(f"{len(rows) - first} consequences", (rest,))
        yield Fold("Data and precision", (f"Data: {self.told}.", self._chains, self._precision))
        yield from (f"{line}." for line in self.lines)

    @property
    def _chains(self) -> str:
        found = self.sampled
        return (
            f"{found.chain.shape[0]} ensembles of {found.chain.shape[2]} walkers, "
            f"{found.chain.shape[1]} steps each; acceptance {min(found.acceptance):.2f} to "
            f"{max(found.acceptance):.2f}; seed {found.seed}."
        )

    @property
    def _precision(self) -> Grid:
        rows = [
            (_named(one), f"{one.mcse:.1g}", f"{one.rhat:.3f}", *(f"{n:.0f}" for n in sizes))
            for one in self.sampled.summaries()
            for sizes in ((one.bulk, one.tail),)
        ]
        caption = (
            "Monte Carlo standard error of the mean, R-hat over the ensembles, effective sizes of "
            "the middle (bulk) and of the tails."
        )
        return Grid(caption, ("Quantity", "MCSE", "R-hat", "bulk", "tail"), rows, whole=range(1, 5))

    @property
    def lines(self) -> list[str]:
        """What is said below the summary: the likely false stars, and what to beware of."""
        warnings = self.warnings if self._supplied or self.changes else []
        false = [self.false_stars] if self.false_stars else []
        return [*false, *(f"Beware: {text}" for text in warnings)]

    @property
    def changes(self) -> str:
        """What a reader changed, in one line; empty for the posterior of the book."""
        named = [f"prior of {name}" for name in self._priors]
        named += [] if self.data_seed is None else [f"data_seed = {self.data_seed}"]
        return ", ".join((*named, *(f"{key} = {value}" for key, value in self.settings.items())))


def _versions() -> dict[str, str]:
    """Return the versions of the software that made a posterior."""
    found = {name: version(name) for name in ("numpy", "scipy", "emcee")}
    return {"reproduce-pointing": __version__, **found}


def _named(row: Any) -> str:
    """Write a name with its unit, if it has one."""
    return str(row.name) if row.unit == "1" else f"{row.name} ({row.unit})"


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the ends of its 95 %."""
    ends = (digits(row.low, row.mcse_end), digits(row.high, row.mcse_end))
    return (digits(row.mean, row.mcse), f"{row.deviation:.2g}", *ends)


def interval(row: Summary) -> tuple[str, str]:
    """Write mean ± standard deviation of a summary, and the ends of its 95 %."""
    _, _, low, high = spread(row)
    return moments(row.mean, row.deviation), minus(f"{low} to {high}")


def _probability(value: float) -> str:
    """Write a probability that is never quite one."""
    return f"{value:.2f}" if value < CERTAIN else f"> {CERTAIN}"


def _declaration(declared: Declaration) -> str:
    """Return the text in which a posterior is declared, beside the function that makes it."""
    text = inspect.getsource(inspect.getmodule(declared.build) or declared.build)
    for node in ast.walk(ast.parse(text)):
        first = node.args[0] if isinstance(node, ast.Call) and node.args else None
        if isinstance(first, ast.Constant) and first.value == declared.key:
            found = ast.get_source_segment(text, node, padded=True) or ""
            return dedent(found).rstrip()
    raise LookupError(f"{declared.key}: not declared in the module of {declared.build.__name__}")


def _prior(parameter: Parameter, prior: Prior | tuple[float, float]) -> Prior:
    """Return a reader's prior; two ends are in the unit shown."""
    if not isinstance(prior, tuple | list):
        return prior
    from reproduce.inference import HalfNormal, LogNormal, LogUniform, Uniform

    low, high = prior
    if low < 0 and isinstance(parameter.prior, HalfNormal | LogNormal | LogUniform):
        raise ValueError(f"prior of {parameter.name}: expected zero or more, got {low:g}")
    if not low < high:
        raise ValueError(
            f"prior of {parameter.name}: expected low below high, got {low:g} and {high:g}"
        )
    return Uniform(low / parameter.shown, high / parameter.shown, "a reader's own")
