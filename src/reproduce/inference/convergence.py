"""The gates: a chain that misses one is refused, with its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.inference import diagnostics
from reproduce.physics.validate import FloatArray

# Steps advised: so many times those that the gates need, since short chains tell of too short a
# time; and how many times more where ensembles differ, which no size tells.
MARGIN, MIXING = 2.0, 2.0


@dataclass(frozen=True)
class Gates:
    """What a set of ensembles must reach.

    Parameters
    ----------
    rhat : float
        Largest rank-normalised split R-hat over ensembles (Vehtari et al., 2021).
    times : float
        Smallest number of autocorrelation times in the steps kept (emcee's own gate).
    size : float
        Smallest bulk and tail effective sample size: 100 per chain of four.
    acceptance : float
        Smallest share of accepted moves: below it an ensemble may be stuck.
    """

    rhat: float = 1.01
    times: float = 50.0
    size: float = 400.0
    acceptance: float = 0.05


@dataclass(frozen=True)
class Diagnosis:
    """The numbers of one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    rhat, time, times : float
        Split R-hat; autocorrelation time in steps; steps over that time.
    bulk, tail : float
        Effective sample sizes.
    mcse : float
        Monte Carlo standard error of the mean, in SI units or px.
    """

    name: str
    rhat: float
    time: float
    times: float
    bulk: float
    tail: float
    mcse: float


class ConvergenceError(ArithmeticError):
    """Chains that miss the gates; the message is short, the attributes carry all numbers.

    Parameters
    ----------
    missed : list of str
        Every gate that was missed, the worst first.
    diagnoses : tuple of Diagnosis
        Of each parameter.
    acceptance : tuple of float
        Of each ensemble.
    steps : int, optional
        How many kept steps would do, by the autocorrelation found; none where more steps do not
        help.
    """

    def __init__(
        self,
        missed: list[str],
        diagnoses: tuple[Diagnosis, ...],
        acceptance: tuple[float, ...],
        steps: int | None = None,
    ) -> None:
        self.missed, self.diagnoses, self.acceptance = missed, diagnoses, acceptance
        self.steps = steps
        more = f" (and {len(missed) - 1} more)" if len(missed) > 1 else ""
        advice = "find out what keeps the ensembles from mixing"
        if steps is not None:
            advice = f"take about {steps} steps"
        super().__init__(f"the chains are refused: {missed[0]}{more}; {advice}")

    def __reduce__(self) -> tuple[object, ...]:
        """Survive the way back from a worker process."""
        return (type(self), (self.missed, self.diagnoses, self.acceptance, self.steps))


def thinned(chains: FloatArray, time: float) -> FloatArray:
    """Draws of each ensemble in time order, thinned by the autocorrelation time.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers, ...)
        All draws.
    time : float
        Steps between the draws that are kept, rounded up.

    Returns
    -------
    ndarray, shape (ensembles, draws, ...)
        Step by step, all walkers of a step beside each other.
    """
    kept = chains[:, :: max(1, int(np.ceil(time)))]
    return kept.reshape(len(kept), -1, *kept.shape[3:])


def diagnose(names: tuple[str, ...], chain: FloatArray) -> tuple[Diagnosis, ...]:
    """Return the numbers of every parameter.

    Parameters
    ----------
    names : tuple of str
        The parameters.
    chain : ndarray, shape (ensembles, steps, walkers, parameters)
        All draws after warm-up.

    Returns
    -------
    tuple of Diagnosis
        In the order of the parameters.
    """
    return tuple(diagnosed(name, chain[..., i]) for i, name in enumerate(names))


def diagnosed(name: str, draws: FloatArray) -> Diagnosis:
    """Return the numbers of one quantity.

    Parameters
    ----------
    name : str
        Which.
    draws : ndarray, shape (ensembles, steps, walkers)
        All draws after warm-up.

    Returns
    -------
    Diagnosis
        The standard error in the unit of the draws.
    """
    time = diagnostics.autocorrelation_time(draws)
    return Diagnosis(
        name,
        diagnostics.split_rhat(thinned(draws, time)),
        time,
        draws.shape[1] / time,
        diagnostics.bulk_size(draws),
        diagnostics.tail_size(draws),
        float(draws.std() / np.sqrt(draws.size / time)),
    )


def require(diagnoses: tuple[Diagnosis, ...], acceptance: tuple[float, ...], gates: Gates) -> None:
    """Refuse chains that miss a gate.

    Parameters
    ----------
    diagnoses : tuple of Diagnosis
        From `diagnose`.
    acceptance : tuple of float
        Share of accepted moves of each ensemble.
    gates : Gates
        What must be reached.

    Raises
    ------
    ConvergenceError
        If a gate is missed, or a number is not finite.
    """
    # How many times more steps each gate needs, and which it is; NaN misses and comes first.
    missed: list[tuple[float, str]] = []
    for one in diagnoses:
        if not one.rhat <= gates.rhat:
            words = f"{one.name}: R-hat {one.rhat:.4f}, at most {gates.rhat:g} allowed"
            missed.append((MIXING if np.isfinite(one.rhat) else np.inf, words))
        if not one.times >= gates.times:
            words = (
                f"{one.name}: {one.times:.1f} autocorrelation times (one is {one.time:.1f} steps), "
                f"at least {gates.times:g} required"
            )
            missed.append((_short(gates.times, one.times), words))
        for kind, size in (("bulk", one.bulk), ("tail", one.tail)):
            if not size >= gates.size:
                words = f"{one.name}: {kind} ESS {size:.0f}, at least {gates.size:g} needed"
                missed.append((_short(gates.size, size), words))
    if not min(acceptance) >= gates.acceptance:
        words = f"acceptance {min(acceptance):.3f}, at least {gates.acceptance:g} required"
        missed.append((np.inf, words))
    if missed:
        missed.sort(key=lambda miss: -miss[0])
        factor, steps = missed[0][0], None
        if np.isfinite(factor):
            kept = diagnoses[0].time * diagnoses[0].times
            steps = int(np.ceil(MARGIN * factor * kept / 100)) * 100
        raise ConvergenceError([words for _, words in missed], diagnoses, acceptance, steps)


def _short(needed: float, found: float) -> float:
    """How many times more steps are needed; infinite where that cannot be told."""
    return needed / found if found > 0 else np.inf
