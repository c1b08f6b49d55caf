"""An image sensor after the linear model of EMVA 1288: photons in, digital numbers out.

Light is in photons per pixel and exposure, charge in electrons, the output in digital numbers
(DN). Arrays are images or windows of any shape: every pixel is alike and independent, so shapes
pass through unchanged. Random numbers come from the generator that the caller hands over.

Light of stars in bands of wavelength: blackbodies and tabulated spectra, counted in photons.

Wavelengths are in metres, temperatures in kelvin, magnitudes are Johnson's V. Spectra are photon
spectra: photons per metre of wavelength, not energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.validate import FloatArray, NonNegative, Number, Positive

# What rounding to whole digital numbers adds: the variance of a number spread over one step.
_ROUNDING_VARIANCE = 1.0 / 12.0


@dataclass(frozen=True)
class Detector:
    """The parameters of an image sensor.

    Attributes
    ----------
    quantum_efficiency : float
        eta, electrons per photon, above 0 and at most 1.
    gain : float
        K, the overall system gain, in DN per electron.
    dark_signal : float
        Mean charge of a pixel without light, in electrons per exposure; it has shot noise.
    read_noise : float
        Standard deviation of the readout, in electrons.
    full_well : float
        Charge at which a pixel is full, in electrons; infinite for none.
    offset : float
        Output without any charge, in DN; keeps the noise of dark pixels above zero.
    bits : int, optional
        Width of the digital output, which is then rounded to whole numbers and clipped; None for
        an output that is neither.
    """

    quantum_efficiency: float = 1.0
    gain: float = 1.0
    dark_signal: float = 0.0
    read_noise: float = 0.0
    full_well: float = np.inf
    offset: float = 0.0
    bits: int | None = None

    def __post_init__(self) -> None:
        if not 0 < self.quantum_efficiency <= 1:
            raise ValueError(
                f"quantum_efficiency: expected above 0 and at most 1, got "
                f"{self.quantum_efficiency}; pass a fraction, not a percentage"
            )
        validate.positive("gain", self.gain)
        if not self.full_well > 0:
            raise ValueError(f"full_well: expected above zero, got {self.full_well}")
        for name in ("dark_signal", "read_noise", "offset"):
            validate.non_negative(name, getattr(self, name))
        if self.bits is not None and not 1 <= self.bits <= 32:
            raise ValueError(f"bits: expected from 1 to 32, or None, got {self.bits}")

    def noise_electrons(self) -> float:
        """Return the noise of a dark pixel, in electrons: dark charge, readout and rounding."""
        rounding = 0.0 if self.bits is None else _ROUNDING_VARIANCE / self.gain**2
        return float(np.sqrt(self.dark_signal + self.read_noise**2 + rounding))


@validate.checked
def expose(
    photons: NonNegative, detector: Detector, generator: Generator
) -> FloatArray:
    """Return one exposure: digital numbers with shot noise, read noise, rounding, saturation.

    Parameters
    ----------
    photons : array_like
        Mean photons per pixel and exposure, of any shape.
    detector : Detector
    generator : numpy.random.Generator
        Draws the noise.

    Returns
    -------
    ndarray
        As `photons`, in DN. Without `bits` the numbers are not rounded and may fall below zero.

    Examples
    --------
    No light, no dark charge, no read noise: the offset.

    >>> expose(np.zeros(3), Detector(offset=7, bits=8), np.random.default_rng(1))
    array([7., 7., 7.])
    """
    # Light and dark charge are both Poisson, and so is their sum.
    mean = detector.quantum_efficiency * photons + detector.dark_signal
    charge = np.asarray(
        generator.poisson(mean), dtype=np.float64
    )  # an array, even of one pixel
    if np.isfinite(detector.full_well):
        np.minimum(charge, detector.full_well, out=charge)
    if detector.read_noise:
        noise = generator.standard_normal(charge.shape)
        noise *= detector.read_noise
        charge += noise
    charge *= detector.gain
    charge += detector.offset
    if detector.bits is not None:
        np.rint(charge, out=charge)
        np.clip(charge, 0.0, 2.0**detector.bits - 1.0, out=charge)
    return charge


@validate.checked
def electrons(output: Number, detector: Detector) -> FloatArray:
    """Return the light's charge that an output stands for: the linear model turned round.

    Parameters
    ----------
    output : array_like, in DN
    detector : Detector

    Returns
    -------
    ndarray
        (output - offset) / K - dark signal, in electrons; noise may push it below zero.

    Examples
    --------
    >>> float(electrons(60.0, Detector(gain=0.5, offset=10, dark_signal=20)))
    80.0
    """
    return np.asarray((output - detector.offset) / detector.gain - detector.dark_signal)


# Second radiation constant hc/k, in m K: exact since the SI of 2019.
_SECOND_RADIATION = 1.438776877e-2
# A star of V = 0 gives 3.631e-9 erg/(s cm^2 angstrom) at 550 nm (Bessell, Castelli and Plez 1998);
# one photon there is 3.6117e-19 J. In photons per second, square metre and metre of wavelength.
_V_WAVELENGTH = 550e-9
_ZERO_MAGNITUDE = 3.631e-2 / 3.6117e-19
_V_WIDTH = 10e-9  # over which a tabulated spectrum is averaged there
_NODES = 40


@validate.checked
def blackbody_band(
    magnitude: Number, temperature: Positive, low: float, high: float
) -> FloatArray:
    """Photons of a blackbody star in a band, above the atmosphere.

    The magnitude fixes the spectrum at 550 nm. That is V but for a few hundredths, because the band
    V is narrow compared with the features of a blackbody.

    Parameters
    ----------
    magnitude, temperature : array_like, shape (...)
        V magnitude; kelvin.
    low, high : float
        Edges of the band, in metres, the lower one first.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Examples
    --------
    Ten million photons a second on a square metre, for a star of magnitude 7.5 in 100 nm.

    >>> float(blackbody_band(7.5, 5800, 500e-9, 600e-9).round(-6))
    10000000.0
    """
    middle, half = _band(low, high)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    spectrum = _blackbody_photons(middle + half * nodes, temperature[..., None])
    return np.asarray(
        _ZERO_MAGNITUDE * 10 ** (-0.4 * magnitude) * half * (spectrum @ weights)
    )


@validate.checked
def tabulated_star(
    magnitude: Number,
    wavelength: ArrayLike,
    photons: ArrayLike,
    low: float,
    high: float,
) -> FloatArray:
    """Photons of a star in a band, from a tabulated spectrum that is scaled to a magnitude.

    As for a blackbody, the magnitude fixes the spectrum at 550 nm; here its mean over 10 nm, so
    that a narrow line does not count.

    Parameters
    ----------
    magnitude : array_like, shape (...)
        V magnitude.
    wavelength : array_like, shape (n,)
        Rising, in metres; the table must reach over the band and 550 nm, straight lines between
        its points.
    photons : array_like, shape (n,)
        Per metre of wavelength, in any unit.
    low, high : float
        Edges of the band, in metres, the lower one first.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Examples
    --------
    A flat spectrum of V = 0: a hundred million photons in a nanometre.

    >>> float(tabulated_star(0.0, [400e-9, 700e-9], [1.0, 1.0], 600e-9, 601e-9).round(-6))
    101000000.0
    """
    length = validate.positive("wavelength", wavelength, shape=(None,))
    table = validate.finite_array("photons", photons, shape=(len(length),))
    if length.ndim != 1 or (np.diff(length) <= 0).any():
        raise ValueError(
            "wavelength: expected one rising column, got another; sort the table"
        )
    _band(low, high)
    edges = _V_WAVELENGTH - _V_WIDTH / 2, _V_WAVELENGTH + _V_WIDTH / 2
    level = validate.positive(
        "photons", _tabulated_band(length, table, *edges) / _V_WIDTH
    )
    share = _tabulated_band(length, table, low, high) / level
    return np.asarray(_ZERO_MAGNITUDE * 10 ** (-0.4 * magnitude) * share)


def _band(low: float, high: float) -> tuple[float, float]:
    first, last = (
        float(validate.positive("low", low)),
        float(validate.positive("high", high)),
    )
    if not first < last:
        raise ValueError(
            f"band: expected a lower edge below the upper one, got {low} and {high}"
        )
    return (first + last) / 2, (last - first) / 2


def _blackbody_photons(wavelength: FloatArray, temperature: FloatArray) -> FloatArray:
    """Return the photon spectrum of a blackbody, in units of its value at 550 nm."""
    # The ratio of exponentials by their logarithm: a cool star's own ones overflow.
    here = _SECOND_RADIATION / (wavelength * temperature)
    there = _SECOND_RADIATION / (_V_WAVELENGTH * temperature)
    ratio = np.exp(there - here) * np.expm1(-there) / np.expm1(-here)
    return (_V_WAVELENGTH / wavelength) ** 4 * ratio


def _tabulated_band(
    wavelength: FloatArray, photons: FloatArray, low: float, high: float
) -> float:
    """Return the photons of a tabulated spectrum in a band: straight lines between."""
    if wavelength[0] > low or wavelength[-1] < high:
        raise ValueError(
            f"wavelength: expected a table from {low:g} to {high:g} m, got one from "
            f"{wavelength[0]:g} to {wavelength[-1]:g} m; extend it, or narrow the band"
        )
    inside = (wavelength > low) & (wavelength < high)
    at = np.concatenate([[low], wavelength[inside], [high]])
    return float(np.trapezoid(np.interp(at, wavelength, photons), at))
