"""Focal lengths and laser spacing from the printed spots, Table II and Table V of chen2023.

The spots give the spacing times one focal length over the other; the reference angles of the stage
test give the camera's focal length; the specifications stand in the priors. The spots' deviations
from a square are a scatter with a size of its own. Spots in px, lengths in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import expit

from reproduce.inference.censored import log_interval
from reproduce.inference.coordinates import from_scores, log_slope, scores, weighted
from reproduce.inference.model import Model, Parameter
from reproduce.inference.priors import LogNormal, Uniform
from reproduce.inference.reference_angles import (
    FOCAL_SPREAD,
    Printed,
    ReferenceAngles,
    focal_parameter,
    in_radians,
    log_same_hypothesis,
    scatter_parameter,
)
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCMIN_PER_RADIAN, ARCSEC_PER_RADIAN

# Priors: relative width of tracker focal length and spacing; ends of log10 of the placement in px.
SPREAD = 0.02
PLACEMENT = (-3.0, 0.7)


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

    def _spots(self, parameters: FloatArray) -> FloatArray:
        """Log probability of the printed spots, shape (n,)."""
        off = self.spots - self.predicted(parameters)
        placement = 10.0 ** parameters[:, 6, None, None]
        low, high = (off - self.half_spot) / placement, (off + self.half_spot) / placement
        return np.asarray(log_interval(low, high).sum(axis=(-2, -1)))

    def both(self, parameters: FloatArray) -> FloatArray:
        """Log probability of the reference angles under both hypotheses, shape (n, 2)."""
        unbiased, scatter = np.zeros((len(parameters), 2)), in_radians(parameters[:, 7])
        printed = Printed(self.reference.angles, unbiased, scatter)
        return self.reference.log_hypotheses(parameters[:, 0], (printed,))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        both = self.both(parameters)
        return np.asarray(
            self._spots(parameters) + np.logaddexp(both[:, 0], both[:, 1]) - np.log(2)
        )

    def log_same(self, parameters: FloatArray) -> FloatArray:
        """Log probability that a repeat prints all the same digits, shape (n,)."""
        return self._spots(parameters) + log_same_hypothesis(self.both(parameters))

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Spots and reference angles as they would be printed."""
        return self._drawn(parameters, generator, None)

    def repeat(self, parameters: FloatArray, generator: Generator) -> tuple[FloatArray, FloatArray]:
        """The same for a repeat: under the hypothesis that the present data tell of."""
        as_printed, crossed = self.both(parameters[None])[0]
        return self._drawn(parameters, generator, float(expit(crossed - as_printed)))

    def _drawn(
        self, parameters: FloatArray, generator: Generator, crossed: float | None
    ) -> tuple[FloatArray, FloatArray]:
        """Draw the data; `crossed` is the probability of the interchange, one half if None."""
        spots = self.predicted(parameters[None])[0]
        spots = spots + 10.0 ** parameters[6] * generator.normal(size=spots.shape)
        unit = 2 * self.half_spot
        scatter = float(in_radians(parameters[7]))
        which = int(generator.integers(2) if crossed is None else generator.random() < crossed)
        _, angles = self.reference.draw(parameters[0], scatter, which, generator)
        return np.round(spots / unit) * unit, angles

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same design with other numbers."""
        return replace(self, spots=data[0], reference=replace(self.reference, angles=data[1]))

    def start(self) -> tuple[FloatArray, FloatArray]:
        """A square laid over the spots, and the focal length of the stage test."""
        _, focal, left = self.reference.fitted()
        left = max(left, self.reference.half_angle / 2)
        factor, centre, placement = self.square()
        _, tracker, spacing = self.design
        # Share what the design misses between the two lengths it cannot tell apart.
        share = np.sqrt(np.abs(factor) * 2 * focal * self.pixel_pitch / (tracker * spacing))
        values = [focal, tracker * share, spacing * share, np.angle(factor), *centre]
        focal_error = focal * left / np.abs(self.reference.angles).max() / 2
        size = float(np.abs(factor))
        errors = [focal_error, 0.005 * tracker, 0.005 * spacing, placement / size / 2,
                  placement / 2, placement / 2, 0.1, 0.1]  # fmt: skip
        logs = [np.log10(placement), np.log10(left * ARCSEC_PER_RADIAN)]
        return np.array([*values, *logs]), np.array(errors)

    def square(self) -> tuple[complex, FloatArray, float]:
        """The square over the spots: size and roll in one, in px, its centre, what is left."""
        centre = self.spots.mean(axis=0)
        corners = self.corners @ np.array([1, 1j])
        spots = (self.spots - centre) @ np.array([1, 1j])
        factor = (spots @ corners.conj()) / (corners @ corners.conj()).real
        left = np.sqrt(np.square(np.abs(spots - factor * corners)).sum() / 4)
        return complex(factor), centre, max(float(left), self.half_spot)

    def coordinates(self) -> GeometryCoordinates:
        """Coordinates that take out what placement and scatter do to the others."""
        return GeometryCoordinates(self)

    def checks(self, data: tuple[FloatArray, FloatArray] | None = None) -> dict[str, float]:
        """Diagonals of the pattern and their difference, in px."""
        spots = self.spots if data is None else data[0]
        width, height = np.ptp(spots, axis=0)
        return {
            "diagonal, mean (px)": float((width + height) / 2),
            "diagonals, wider than high (px)": float(width - height),
        }


@dataclass(frozen=True, eq=False)
class GeometryCoordinates:
    """Given placement and scatter the others are nearly Gaussian, in logarithms of the lengths.

    In this order: camera focal length, product and ratio of tracker focal length and spacing, roll
    and centre, each standardised; normal scores of placement and scatter.

    Parameters
    ----------
    likelihood : GeometryLikelihood
        With its data.
    """

    likelihood: GeometryLikelihood

    @cached_property
    def _square(self) -> tuple[complex, FloatArray, float]:
        return self.likelihood.square()

    @cached_property
    def _focal(self) -> float:
        return float(np.log(self.likelihood.reference.fitted()[1]))

    def _camera(self, scatter: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and deviation of the log focal length of the camera."""
        error = self.likelihood.reference.focal_error(in_radians(scatter))
        design = float(np.log(self.likelihood.design[0]))
        return weighted(self._focal, error, design, FOCAL_SPREAD)

    def _product(self, camera: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and deviation of the log of tracker focal length times spacing."""
        _, tracker, spacing = self.likelihood.design
        pixels = 2 * abs(self._square[0]) * self.likelihood.pixel_pitch
        design = float(np.log(tracker * spacing))
        return weighted(np.log(pixels) + camera, error, design, np.sqrt(2) * SPREAD)

    def _errors(self, placement: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Errors of the centre, in px, and of size and roll."""
        centre = 10.0**placement / 2
        return centre, centre / abs(self._square[0])

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Coordinates of parameter vectors, shape (n, 8)."""
        camera, tracker, spacing = np.log(parameters[:, :3].T)
        roll, x, y, placement, scatter = parameters[:, 3:].T
        factor, (middle_x, middle_y), _ = self._square
        centre, turn = self._errors(placement)
        focal, focal_error = self._camera(scatter)
        product, product_error = self._product(camera, turn)
        _, design_tracker, design_spacing = self.likelihood.design
        ratio = tracker - spacing - np.log(design_tracker / design_spacing)
        return np.stack(
            [
                (camera - focal) / focal_error,
                (tracker + spacing - product) / product_error,
                ratio / (np.sqrt(2) * SPREAD),
                (roll - np.angle(factor)) / turn,
                (x - middle_x) / centre,
                (y - middle_y) / centre,
                scores(placement, PLACEMENT),
                scores(scatter, self.likelihood.reference.scatter),
            ],
            axis=-1,
        )

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Parameter vectors at coordinates, shape (n, 8)."""
        factor, (middle_x, middle_y), _ = self._square
        placement = from_scores(straight[:, 6], PLACEMENT)
        scatter = from_scores(straight[:, 7], self.likelihood.reference.scatter)
        centre, turn = self._errors(placement)
        focal, focal_error = self._camera(scatter)
        camera = focal + focal_error * straight[:, 0]
        product, product_error = self._product(camera, turn)
        both = product + product_error * straight[:, 1]
        _, tracker, spacing = self.likelihood.design
        ratio = np.log(tracker / spacing) + np.sqrt(2) * SPREAD * straight[:, 2]
        lengths = np.exp([camera, (both + ratio) / 2, (both - ratio) / 2])
        roll = np.angle(factor) + turn * straight[:, 3]
        x, y = middle_x + centre * straight[:, 4], middle_y + centre * straight[:, 5]
        return np.stack([*lengths, roll, x, y, placement, scatter], axis=-1)

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Log determinant, shape (n,)."""
        camera, placement, scatter = np.log(parameters[:, 0]), parameters[:, 6], parameters[:, 7]
        centre, turn = self._errors(placement)
        widths = self._camera(scatter)[1] * self._product(camera, turn)[1] * turn * centre**2
        lengths = np.log(parameters[:, :3]).sum(axis=1) + np.log(SPREAD / np.sqrt(2))
        ends = log_slope(placement, PLACEMENT)
        ends = ends + log_slope(scatter, self.likelihood.reference.scatter)
        return np.asarray(lengths + np.log(widths) + ends)


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
            Parameter("tracker-focal-length", "f_s", "mm", LogNormal(tracker, SPREAD,
                "a star tracker's specification holds to a per cent or two"), 1e3),
            Parameter("spacing", "d", "mm", LogNormal(spacing, SPREAD,
                "lasers set by hand: a few tenths of a millimetre in the diagonal"), 1e3),
            Parameter("roll", r"\rho", "arcmin", Uniform(-0.3, 0.3,
                "the pattern is named by its corners: less than half the way to the next"),
                ARCMIN_PER_RADIAN),
            Parameter("centre-x", "x_c", "px", field),
            Parameter("centre-y", "y_c", "px", field),
            Parameter("log-placement", r"\log_{10}\epsilon", "log10 px", Uniform(*PLACEMENT,
                "from the last printed digit to a tenth of the pattern, no scale preferred")),
            scatter_parameter(likelihood.reference.scatter),
        ),
        likelihood,
        {"focal-length": camera, "tracker-focal-length": tracker, "spacing": spacing},
    )  # fmt: skip
