"""Posteriors that lean on an end of a prior, or lie in its tail."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.inference.posterior import Sampled
from reproduce.inference.priors import (
    HalfNormal,
    LogNormal,
    LogUniform,
    Normal,
    Prior,
    Uniform,
)
from reproduce.physics.validate import FloatArray

# A Gaussian that an end cuts two standard deviations from its mean has so large a share of its
# draws within so many standard deviations of the end; one that the end does not reach has none.
BESIDE, LEANING = 0.1, 0.005
# Further out than so many standard deviations a Gaussian prior contradicts the data.
CONTRADICTED = 3.0


@dataclass(frozen=True)
class Leaning:
    """A parameter whose posterior leans on its prior.

    - `parameter`: which.
    - `end`: the end of the prior on which it leans, in the unit shown; none for a Gaussian prior,
      in whose tail it lies.
    - `unit`, `prior`: the unit shown, and the prior in words.
    - `share`: share of draws beside the end; for a Gaussian prior how many of its standard
      deviations the posterior's mean lies out.
    """

    parameter: str
    end: float | None
    unit: str
    prior: str
    share: float

    def __str__(self) -> str:
        """What leans where, in one line."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.end is None:
            return (
                f"{self.parameter} lies {self.share:.1f} standard deviations out in its prior "
                f"({self.prior}{unit}), which pulls it"
            )
        return (
            f"{self.parameter} leans on the end {self.end:.4g}{unit} of its prior ({self.prior}"
            f"{unit}): what is printed of it is a limit, not an estimate"
        )


def leanings(posterior: Sampled) -> list[Leaning]:
    """Return the parameters whose posterior leans on an end of a prior, or lies in its tail."""
    found = []
    for parameter, column in zip(
        posterior.model.parameters, np.moveaxis(posterior.chain, -1, 0), strict=True
    ):
        shown = parameter.prior.in_unit(parameter.shown)
        for end, share in _leaning(parameter.prior, column.ravel()):
            if end in parameter.natural:
                continue
            place = None if end is None else end * parameter.shown
            found.append(Leaning(parameter.name, place, parameter.unit, str(shown), share))
    return found


def _leaning(prior: Prior, draws: FloatArray) -> list[tuple[float | None, float]]:
    if isinstance(prior, Normal | LogNormal):
        place = prior.mean if isinstance(prior, Normal) else np.log(prior.median)
        values = draws if isinstance(prior, Normal) else np.log(draws)
        out = float(abs(values.mean() - place) / prior.sigma)
        return [(None, out)] if out > CONTRADICTED else []
    ends: tuple[float, ...] = ()
    if isinstance(prior, Uniform | LogUniform):
        ends = (prior.low, prior.high)
    elif isinstance(prior, HalfNormal):
        ends = (0.0,)
    # In the scale in which the prior is flat.
    scale = np.log if isinstance(prior, LogUniform) else np.asarray
    values = scale(draws)
    beside = BESIDE * values.std()
    shares = [(end, float((np.abs(values - scale(end)) < beside).mean())) for end in ends]
    return [(end, share) for end, share in shares if share > LEANING]
