"""Light of stars in bands of wavelength: blackbodies and tabulated spectra, counted in photons.

Wavelengths are in metres, temperatures in kelvin, magnitudes are Johnson's V. Spectra are photon
spectra: photons per metre of wavelength, not energy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive

# Second radiation constant hc/k, in m K: exact since the SI of 2019.
SECOND_RADIATION = 1.438776877e-2
# A star of V = 0 gives 3.631e-9 erg/(s cm^2 angstrom) at 550 nm (Bessell, Castelli and Plez 1998);
# one photon there is 3.6117e-19 J. In photons per second, square metre and metre of wavelength.
V_WAVELENGTH = 550e-9
ZERO_MAGNITUDE = 3.631e-2 / 3.6117e-19
V_WIDTH = 10e-9  # over which a tabulated spectrum is averaged there
NODES = 40


def blackbody_photons(wavelength: ArrayLike, temperature: ArrayLike) -> FloatArray:
    """Photon spectrum of a blackbody, in units of its value at 550 nm.

    Parameters
    ----------
    wavelength : array_like, shape (...)
        In metres.
    temperature : array_like, shape (...)
        In kelvin; both broadcast against each other.

    Returns
    -------
    ndarray, shape (...)
        Proportional to wavelength^-4 / (exp(hc / (wavelength k temperature)) - 1).

    Raises
    ------
    ValueError
        If an argument is not finite and above zero.

    Examples
    --------
    >>> float(blackbody_photons(550e-9, 5800))
    1.0
    """
    length, heat = positive("wavelength", wavelength), positive("temperature", temperature)
    common_batch(wavelength=length.shape, temperature=heat.shape)
    # The ratio of exponentials by their logarithm: a cool star's own ones overflow.
    here, there = SECOND_RADIATION / (length * heat), SECOND_RADIATION / (V_WAVELENGTH * heat)
    ratio = np.exp(there - here) * np.expm1(-there) / np.expm1(-here)
    return np.asarray((V_WAVELENGTH / length) ** 4 * ratio)


def blackbody_band(
    magnitude: ArrayLike, temperature: ArrayLike, low: float, high: float
) -> FloatArray:
    """Photons of a blackbody star in a band, above the atmosphere.

    The magnitude fixes the spectrum at 550 nm. That is V but for a few hundredths, because the band
    V is narrow beside the features of a blackbody.

    Parameters
    ----------
    magnitude, temperature : array_like, shape (...)
        V magnitude; kelvin.
    low, high : float
        Edges of the band, in metres.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Raises
    ------
    ValueError
        If an argument is not finite, a temperature or edge is not above zero, or the band is empty.

    Examples
    --------
    Ten million photons a second on a square metre, for a star of magnitude 7.5 in 100 nm.

    >>> float(blackbody_band(7.5, 5800, 500e-9, 600e-9).round(-6))
    10000000.0
    """
    bright = finite_array("magnitude", magnitude)
    middle, half = _band(low, high)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    heat = positive("temperature", temperature)
    spectrum = blackbody_photons(middle + half * nodes, heat[..., None])
    common_batch(magnitude=bright.shape, temperature=heat.shape)
    return np.asarray(ZERO_MAGNITUDE * 10 ** (-0.4 * bright) * half * (spectrum @ weights))


def tabulated_band(
    wavelength: ArrayLike, photons: ArrayLike, low: float, high: float
) -> FloatArray:
    """Photons of a tabulated spectrum in a band, straight lines between its points.

    Parameters
    ----------
    wavelength : array_like, shape (n,)
        Rising, in metres; the table must reach over the band.
    photons : array_like, shape (..., n)
        Per second, square metre and metre of wavelength.
    low, high : float
        Edges of the band, in metres.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Raises
    ------
    ValueError
        If the table does not rise or reach over the band, or an argument is not finite.

    Examples
    --------
    >>> float(tabulated_band([400e-9, 600e-9], [0.0, 2e9], 400e-9, 500e-9))
    50.0
    """
    length = positive("wavelength", finite_array("wavelength", wavelength, shape=(None,)))
    table = finite_array("photons", photons, shape=(len(length),))
    _band(low, high)
    if length.ndim != 1 or (np.diff(length) <= 0).any():
        raise ValueError("wavelength: expected one rising column, got another; sort the table")
    if length[0] > low or length[-1] < high:
        raise ValueError(
            f"wavelength: expected a table from {low:g} to {high:g} m, got one from "
            f"{length[0]:g} to {length[-1]:g} m; extend it, or narrow the band"
        )
    inside = (length > low) & (length < high)
    at = np.concatenate([[low], length[inside], [high]])
    flat = table.reshape(-1, len(length))
    values = np.stack([np.interp(at, length, row) for row in flat])
    middles = (values[:, 1:] + values[:, :-1]) / 2
    return np.asarray((middles @ np.diff(at)).reshape(table.shape[:-1]))


def tabulated_star(
    magnitude: ArrayLike, wavelength: ArrayLike, photons: ArrayLike, low: float, high: float
) -> FloatArray:
    """Photons of a star in a band, from a tabulated spectrum that is scaled to a magnitude.

    As for a blackbody, the magnitude fixes the spectrum at 550 nm; here its mean over 10 nm, so
    that a narrow line does not count.

    Parameters
    ----------
    magnitude : array_like, shape (...)
        V magnitude.
    wavelength, photons : array_like, shape (n,)
        As for `tabulated_band`; the photons in any unit.
    low, high : float
        Edges of the band, in metres.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Raises
    ------
    ValueError
        If the table does not rise or reach over the band and 550 nm, or an argument is not finite.

    Examples
    --------
    A flat spectrum of V = 0: a hundred million photons in a nanometre.

    >>> float(tabulated_star(0.0, [400e-9, 700e-9], [1.0, 1.0], 600e-9, 601e-9).round(-6))
    101000000.0
    """
    bright = finite_array("magnitude", magnitude)
    edges = V_WAVELENGTH - V_WIDTH / 2, V_WAVELENGTH + V_WIDTH / 2
    level = positive("photons", tabulated_band(wavelength, photons, *edges) / V_WIDTH)
    share = tabulated_band(wavelength, photons, low, high) / level
    return np.asarray(ZERO_MAGNITUDE * 10 ** (-0.4 * bright) * share)


def _band(low: float, high: float) -> tuple[float, float]:
    first, last = float(positive("low", low)), float(positive("high", high))
    if not first < last:
        raise ValueError(f"band: expected a lower edge below the upper one, got {low} and {high}")
    return (first + last) / 2, (last - first) / 2


def channel_ratio(
    signal: ArrayLike, reference: ArrayLike, variance: ArrayLike, reference_variance: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """The colour of a star: the ratio of two channels' signals, and its standard deviation.

    Parameters
    ----------
    signal, reference : array_like, shape (...)
        Light in two channels, in the same unit; the reference above zero.
    variance, reference_variance : array_like, shape (...)
        Their variances, in that unit squared.

    Returns
    -------
    tuple of ndarray, each of shape (...)
        Ratio signal / reference, and its standard deviation to first order.

    Raises
    ------
    ValueError
        If an argument is not finite or the reference is not above zero.

    Examples
    --------
    >>> ratio, sigma = channel_ratio(50.0, 100.0, 25.0, 100.0)
    >>> float(ratio), float(sigma.round(4))
    (0.5, 0.0707)
    """
    top, bottom = finite_array("signal", signal), positive("reference", reference)
    noise = finite_array("variance", variance)
    other = finite_array("reference_variance", reference_variance)
    common_batch(signal=top.shape, reference=bottom.shape, variance=noise.shape, other=other.shape)
    ratio = top / bottom
    return ratio, np.asarray(np.sqrt(noise + ratio**2 * other) / bottom)
