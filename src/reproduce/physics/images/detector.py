"""An image sensor after the linear model of EMVA 1288: photons in, digital numbers out.

Light is in photons per pixel and exposure, charge in electrons, the output in digital numbers
(DN). Arrays are images or windows of any shape: every pixel is alike and independent, so shapes
pass through unchanged. Random numbers come from the generator that the caller hands over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from reproduce.physics.validate import (
    FloatArray,
    NonNegative,
    Number,
    checked,
    non_negative,
    positive,
)

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
        positive("gain", self.gain)
        if not self.full_well > 0:
            raise ValueError(f"full_well: expected above zero, got {self.full_well}")
        for name in ("dark_signal", "read_noise", "offset"):
            non_negative(name, getattr(self, name))
        if self.bits is not None and not 1 <= self.bits <= 32:
            raise ValueError(f"bits: expected from 1 to 32, or None, got {self.bits}")

    @checked
    def output_variance(self, photons: NonNegative) -> FloatArray:
        """Return the variance of the output below saturation: the photon transfer curve.

        Shot noise of light and dark charge, read noise and rounding, each independent.

        Parameters
        ----------
        photons : array_like
            Mean photons per pixel and exposure.

        Returns
        -------
        ndarray, in DN squared

        Examples
        --------
        >>> Detector(gain=0.5, read_noise=10).output_variance(100.0)
        array(50.)
        """
        charge = self.quantum_efficiency * photons + self.dark_signal
        rounding = 0.0 if self.bits is None else _ROUNDING_VARIANCE
        return np.asarray(self.gain**2 * (charge + self.read_noise**2) + rounding)

    def noise_electrons(self) -> float:
        """Return the noise of a dark pixel, in electrons: dark charge, readout and rounding."""
        return float(np.sqrt(self.output_variance(0.0)) / self.gain)


@checked
def expose(photons: NonNegative, detector: Detector, generator: Generator) -> FloatArray:
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
    if not isinstance(generator, Generator):
        raise TypeError(
            f"generator: expected a numpy.random.Generator, got {type(generator).__name__}; "
            "pass numpy.random.default_rng(your_seed)"
        )
    # Light and dark charge are both Poisson, and so is their sum.
    mean = detector.quantum_efficiency * photons + detector.dark_signal
    charge = np.asarray(generator.poisson(mean), dtype=np.float64)  # an array, even of one pixel
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


@checked
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
