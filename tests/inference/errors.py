"""Monte Carlo standard errors of what tests compare, of chains (ensembles, steps, walkers)."""

import numpy as np

from reproduce.inference.diagnostics import _effective_size


def mcse_mean(chains):
    """Standard error of the mean."""
    return float(chains.std() / np.sqrt(_effective_size(chains)))


def mcse_deviation(chains):
    """Standard error of the standard deviation."""
    return mcse_mean(np.square(chains - chains.mean())) / (2 * chains.std())
