"""Focal lengths and laser spacing from the printed spots, Table II and Table V of chen2023.

The spots give the spacing times one focal length over the other; the reference angles of the stage
test give the camera's focal length; the specifications stand in the priors. The spots' deviations
from a square are a scatter with a size of its own. Spots in px, lengths in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference.censored import log_interval
from reproduce.inference.model import Model, Parameter
from reproduce.inference.priors import LogNormal, Uniform
from reproduce.inference.stage_table import (
    ARCSEC,
    ReferenceAngles,
    focal_parameter,
    in_radians,
    scatter_parameter,
)
from reproduce.physics.validate import FloatArray


@dataclass(frozen=True, eq=False)
class GeometryLikelihood:
    """Parameters: focal length of camera and tracker, spacing, roll, centre x and y, log10 of the
    placement (px), log10 of the reference scatter (arcsec).

    Parameters
    ----------
    spots : ndarray, shape (4, 2)
        Printed spots, in px.
    corners : ndarray, shape (4, 2)
        The lasers as designed, in units of half the diagonal, in the order of the spots.
    half_spot : float
        Half the last printed digit of a spot, in px.
    pixel_pitch : float
        In metres.
    reference : ReferenceAngles
        The stage test.
    design : tuple of float
        Focal length of camera and tracker, spacing (diagonal): as designed, in metres.
    """

    spots: FloatArray
    corners: FloatArray
    half_spot: float
    pixel_pitch: float
    reference: ReferenceAngles
    design: tuple[float, float, float]

    def predicted(self, parameters: FloatArray) -> FloatArray:
        """Spots of a perfect square, shape (n, 4, 2), in px."""
        camera, tracker, spacing, roll = parameters[:, :4].T
        size = spacing / 2 * tracker / camera / self.pixel_pitch
        cosine, sine = size * np.cos(roll), size * np.sin(roll)
        x, y = self.corners.T
        turned = np.stack([cosine[:, None] * x - sine[:, None] * y,
                           sine[:, None] * x + cosine[:, None] * y], axis=-1)  # fmt: skip
        return np.asarray(turned + parameters[:, None, 4:6])

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        off = self.spots - self.predicted(parameters)
        placement = 10.0 ** parameters[:, 6, None, None]
        low, high = (off - self.half_spot) / placement, (off + self.half_spot) / placement
        total = log_interval(low, high).sum(axis=(-2, -1))
        focal = parameters[:, 0]
        angles = self.reference.predicted(focal)
        scatter = in_radians(parameters[:, 7])
        densities = self.reference.log_density(self.reference.angles, angles, focal, scatter)
        both = self.reference.over_zero(densities)
        return np.asarray(total + np.logaddexp(both[:, 0], both[:, 1]) - np.log(2))

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Spots and reference angles as they would be printed."""
        spots = self.predicted(parameters[None])[0]
        spots = spots + 10.0 ** parameters[6] * generator.normal(size=spots.shape)
        unit = 2 * self.half_spot
        scatter, which = float(in_radians(parameters[7])), int(generator.integers(2))
        _, angles = self.reference.draw(parameters[0], scatter, which, generator)
        return np.round(spots / unit) * unit, angles

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same design with other numbers."""
        return replace(self, spots=data[0], reference=replace(self.reference, angles=data[1]))

    def start(self) -> tuple[FloatArray, FloatArray]:
        """A square laid over the spots, and the focal length of the stage test."""
        _, focal, left = self.reference.fitted()
        left = max(left, self.reference.half_angle / 2)
        centre = self.spots.mean(axis=0)
        corners = self.corners[:, 0] + 1j * self.corners[:, 1]
        spots = (self.spots - centre) @ np.array([1, 1j])
        factor = (spots @ corners.conj()) / (corners @ corners.conj()).real
        placement = np.sqrt(np.square(np.abs(spots - factor * corners)).sum() / 4)
        placement = max(float(placement), self.half_spot)
        _, tracker, spacing = self.design
        # Share what the design misses between the two lengths it cannot tell apart.
        share = np.sqrt(np.abs(factor) * 2 * focal * self.pixel_pitch / (tracker * spacing))
        values = [focal, tracker * share, spacing * share, np.angle(factor), *centre]
        focal_error = focal * left / np.abs(self.reference.angles).max() / 2
        size = float(np.abs(factor))
        errors = [focal_error, 0.005 * tracker, 0.005 * spacing, placement / size / 2,
                  placement / 2, placement / 2, 0.1, 0.1]  # fmt: skip
        logs = [np.log10(placement), np.log10(left * ARCSEC)]
        return np.array([*values, *logs]), np.array(errors)

    def checks(self, data: tuple[FloatArray, FloatArray] | None = None) -> dict[str, float]:
        """Diagonals of the pattern and their difference, in px."""
        spots = self.spots if data is None else data[0]
        width, height = np.ptp(spots, axis=0)
        return {
            "diagonal, mean (px)": float((width + height) / 2),
            "diagonals, wider than high (px)": float(width - height),
        }


def geometry_model(likelihood: GeometryLikelihood, pixels: float) -> Model:
    """Focal lengths and laser spacing, jointly.

    Parameters
    ----------
    likelihood : GeometryLikelihood
        With the printed numbers.
    pixels : float
        Size of the detector, in px.

    Returns
    -------
    Model
        Eight parameters, in metres, radians and px.
    """
    camera, tracker, spacing = likelihood.design
    field = Uniform(0.0, pixels, "anywhere on the detector")
    return Model(
        "geometry",
        "Focal lengths and laser spacing, from the spots and the stage test",
        (
            focal_parameter(camera),
            Parameter("tracker-focal-length", "f_s", "mm", LogNormal(tracker, 0.02,
                "a star tracker's specification holds to a per cent or two"), 1e3),
            Parameter("spacing", "d", "mm", LogNormal(spacing, 0.02,
                "lasers set by hand: a few tenths of a millimetre in the diagonal"), 1e3),
            Parameter("roll", r"\rho", "arcmin", Uniform(-0.3, 0.3,
                "the pattern is named by its corners: less than half the way to the next"),
                3437.746770784939),
            Parameter("centre-x", "x_c", "px", field),
            Parameter("centre-y", "y_c", "px", field),
            Parameter("log-placement", r"\log_{10}\epsilon", "log10 px", Uniform(-3.0, 0.7,
                "from the last printed digit to a tenth of the pattern, no scale preferred")),
            scatter_parameter(),
        ),
        likelihood,
        {"focal-length": camera, "tracker-focal-length": tracker, "spacing": spacing},
    )  # fmt: skip
