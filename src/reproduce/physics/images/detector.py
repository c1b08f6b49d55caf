"""Image sensor by the linear model of EMVA 1288, and photons of stars in bands of wavelength.

Flux is in photons per pixel and exposure, charge in electrons, the output in digital numbers (DN).
Arrays are images or windows of any shape, because all pixels are equal and independent.

Stars are blackbodies or have tabulated spectra. Wavelengths are in metres, temperatures in kelvin,
magnitudes are Johnson's V. Spectra are photon spectra: photons per metre of wavelength, not energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.random import Generator

from reproduce.physics.validate import (
    Amount,
    Count,
    FloatArray,
    NonNegative,
    Number,
    Size,
    Weights,
    checked,
    checked_fields,
    positive,
    valid,
)

_Wavelengths = Annotated[Any, ("n",), positive]
# Variance of the rounding error of whole digital numbers, in DN^2.
_ROUNDING_VARIANCE = 1.0 / 12.0


@checked_fields
@dataclass(frozen=True)
class Detector:
    """Parameters of an image sensor.

    Attributes
    ----------
    quantum_efficiency : float
        Electrons per photon, eta, above 0 and at most 1.
    gain : float
        Overall system gain K, in DN per electron.
    dark_signal : float
        Mean charge of a pixel without light, in electrons per exposure. It has shot noise.
    read_noise : float
        Standard deviation of the readout, in electrons.
    full_well : float, optional
        Largest charge of a pixel, in electrons. Default: no limit.
    offset : float
        Output without charge, in DN, zero or more.
    bits : int, optional
        Number of bits of the output, which is rounded to whole numbers and clipped. Default: no
        rounding and clipping.
    """

    quantum_efficiency: Size = 1.0
    gain: Size = 1.0
    dark_signal: Amount = 0.0
    read_noise: Amount = 0.0
    full_well: Size = None
    offset: Amount = 0.0
    bits: Count = None

    def __post_init__(self) -> None:
        efficiency = self.quantum_efficiency
        valid(
            "quantum_efficiency",
            efficiency,
            efficiency <= 1,
            "a fraction, not a percentage",
        )
        if self.bits is not None:
            valid("bits", self.bits, 1 <= self.bits <= 32, "1 to 32")

    def noise_electrons(self) -> float:
        """Return the noise of a dark pixel from charge, readout and rounding, in electrons."""
        rounding = 0.0 if self.bits is None else _ROUNDING_VARIANCE / self.gain**2
        return float(np.sqrt(self.dark_signal + self.read_noise**2 + rounding))


@checked
def expose(
    photons: NonNegative, detector: Detector, generator: Generator
) -> FloatArray:
    """Return one exposure: digital numbers with shot noise, read noise, rounding, saturation.

    Parameters
    ----------
    photons : array_like, shape (...)
        Mean photons per pixel and exposure.
    detector : Detector
        Parameters of the sensor.
    generator : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    ndarray, shape (...)
        Output, in DN. Without `bits` it is not rounded and may be negative.

    Examples
    --------
    The output without light, dark charge and read noise is the offset.

    >>> expose(np.zeros(3), Detector(offset=7, bits=8), np.random.default_rng(1))
    array([7., 7., 7.])
    """
    # The sum of two Poisson numbers is a Poisson number.
    mean = detector.quantum_efficiency * photons + detector.dark_signal
    charge = np.asarray(generator.poisson(mean), dtype=np.float64)
    np.clip(charge, 0.0, detector.full_well, out=charge)
    if detector.read_noise:
        charge += detector.read_noise * generator.standard_normal(charge.shape)
    output = charge * detector.gain + detector.offset
    if detector.bits is not None:
        output = np.clip(np.rint(output), 0.0, 2.0**detector.bits - 1.0)
    return output


@checked
def electrons(output: Number, detector: Detector) -> FloatArray:
    """Return the charge of the flux from an output, the inverse of the linear model.

    Parameters
    ----------
    output : array_like, shape (...)
        Output, in DN.
    detector : Detector
        Parameters of the sensor.

    Returns
    -------
    ndarray, shape (...)
        (output - offset) / K - dark signal, in electrons. It may be negative because of noise.

    Examples
    --------
    >>> float(electrons(60.0, Detector(gain=0.5, offset=10, dark_signal=20)))
    80.0
    """
    return (output - detector.offset) / detector.gain - detector.dark_signal


# Second radiation constant hc/k, in m K: exact since the SI of 2019.
_SECOND_RADIATION = 1.438776877e-2
# A star of V = 0 gives 3.631e-9 erg/(s cm^2 angstrom) at 550 nm (Bessell, Castelli and Plez 1998);
# one photon there is 3.6117e-19 J. In photons per second, square metre and metre of wavelength.
_V_WAVELENGTH = 550e-9
_ZERO_MAGNITUDE = 3.631e-2 / 3.6117e-19
# Width of the average of a tabulated spectrum there, in m, and nodes of the quadrature in a band.
_V_WIDTH, _NODES = 10e-9, 40


@checked
def blackbody_band(
    magnitude: Number, temperature: Size, low: Size, high: Size
) -> FloatArray:
    """Return the photons of a blackbody star in a band, above the atmosphere.

    The magnitude is that of the spectrum at 550 nm. It differs from V by a few hundredths, because
    the band V is narrow compared with the features of a blackbody.

    Parameters
    ----------
    magnitude : array_like, shape (...)
        V magnitude.
    temperature : float
        Temperature, in kelvin.
    low, high : float
        Lower and upper edge of the band, in metres.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Examples
    --------
    A star of magnitude 7.5 in a band of 100 nm.

    >>> float(blackbody_band(7.5, 5800, 500e-9, 600e-9).round(-6))
    10000000.0
    """
    from scipy.integrate import fixed_quad  # it is slow

    _check_band(low, high)
    width, _ = fixed_quad(_blackbody_photons, low, high, (temperature,), _NODES)
    return _ZERO_MAGNITUDE * 10 ** (-0.4 * magnitude) * width


@checked
def tabulated_star(
    magnitude: Number,
    wavelength: _Wavelengths,
    photons: Weights,
    low: Size,
    high: Size,
) -> FloatArray:
    """Return the photons of a star in a band, from a tabulated spectrum scaled to a magnitude.

    The magnitude is that of the spectrum at 550 nm, averaged over 10 nm because of narrow lines.

    Parameters
    ----------
    magnitude : array_like, shape (...)
        V magnitude.
    wavelength : array_like, shape (n,)
        Increasing wavelengths, in metres, which cover the band and 550 nm. The spectrum is linear
        between them.
    photons : array_like, shape (n,)
        Photons per metre of wavelength, in any unit.
    low, high : float
        Lower and upper edge of the band, in metres.

    Returns
    -------
    ndarray, shape (...)
        Photons per second and square metre.

    Examples
    --------
    A flat spectrum of V = 0 in a band of 1 nm.

    >>> float(tabulated_star(0.0, [400e-9, 700e-9], [1.0, 1.0], 600e-9, 601e-9).round(-6))
    101000000.0
    """
    from scipy.interpolate import make_interp_spline  # it is slow

    steps = np.diff(wavelength)
    increasing = (steps > 0) & (wavelength.ndim == 1)
    valid("wavelength", steps, increasing, "one increasing column")
    _check_band(low, high)
    edges = _V_WAVELENGTH - _V_WIDTH / 2, _V_WAVELENGTH + _V_WIDTH / 2
    ends, least, most = wavelength[[0, -1]], min(low, *edges), max(high, *edges)
    covered = np.array([ends[0] <= least, ends[1] >= most])
    valid("wavelength", ends, covered, f"a table from {least:g} to {most:g} m")
    spectrum = make_interp_spline(wavelength, photons, 1)
    level = positive("photons", spectrum.integrate(*edges) / _V_WIDTH)
    width = spectrum.integrate(low, high) / level
    return _ZERO_MAGNITUDE * 10 ** (-0.4 * magnitude) * width


def _check_band(low: float, high: float) -> None:
    valid("low", low, low < high, "an edge below the upper edge")


def _blackbody_photons(wavelength: FloatArray, temperature: float) -> FloatArray:
    """Return the photon spectrum of a blackbody, in units of its value at 550 nm."""
    # The exponentials of a cool star would overflow.
    exponent = _SECOND_RADIATION / (wavelength * temperature)
    reference = _SECOND_RADIATION / (_V_WAVELENGTH * temperature)
    ratio = np.exp(reference - exponent) * np.expm1(-reference) / np.expm1(-exponent)
    return (_V_WAVELENGTH / wavelength) ** 4 * ratio
