"""Monte Carlo standard errors of chains, shape (ensembles, steps, walkers)."""

import numpy as np

from reproduce.inference import autocorrelation_time


def mcse_mean(chains):
    """Return the standard error of the mean."""
    return float(chains.std() * np.sqrt(autocorrelation_time(chains) / chains.size))


def mcse_deviation(chains):
    """Return the standard error of the standard deviation."""
    return mcse_mean(np.square(chains - chains.mean())) / (2 * chains.std())
