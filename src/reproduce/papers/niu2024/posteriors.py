"""Posteriors of niu2024: registration of the simulated channels, and the noise of Table 3.

The centroids of the paper are not published. The registrations therefore take one simulation of
the same instrument, with the printed settings and a seed of our own. Their test points are
directions at random, uniform over the printed range, as for the printed RMSE.

A user's stars are one per line, in px: the place in the channel (``x``, ``y``) and in the reference
channel (``x_reference``, ``y_reference``); for both channels at once ``x_red`` to ``y_green``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.random import PCG64, Generator

from reproduce.inference import Consequence, LogUniform, Model, Normal, Prior, Published, Uniform
from reproduce.inference.models import (
    CentroidNoiseLikelihood,
    GaussianRegistration,
    JointRegistration,
    MixtureRegistration,
    NewStars,
    PointwiseRegistration,
    StarModel,
    Together,
    centroid_noise_model,
    distortion_model,
    free_priors,
    joint_model,
    mixture_model,
    noise_growth,
    registration_model,
    rmse_at,
    with_priors,
)
from reproduce.papers.declare_posterior import (
    OWN_DATA,
    Aside,
    Declaration,
    File,
    Pivot,
    data_stream,
    published_cells,
    simulated,
)
from reproduce.papers.niu2024 import simulation
from reproduce.papers.niu2024.simulation import (
    IMAGING,
    NOISE,
    REGISTERED,
    RESULTS,
    ROWS,
    SETTINGS,
)
from reproduce.physics.optics import (
    angle_from_pixels,
    noisy_centroids,
    scale_factor,
    spawned_angles,
)
from reproduce.physics.registration import (
    checked_pivot,
    diagnose,
    fit_registration,
    rounded,
    similarity_between,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.points import STARS, Table, TableFileError
from reproduce.units import ARCSEC_PER_RADIAN

# Share of stars that are matched wrongly on purpose.
_FALSE = 0.3
# How well a laboratory may know a principal point, in px.
_PRINCIPAL_POINT = 2.0
_TEST_POINTS = f"{SETTINGS}#test-points"
READS = (*simulation.READS, "niu2024/text-optics#pixel-pitch-*", _TEST_POINTS)
ESTIMATES = ("scale", "rotation", "shift-x", "shift-y")
_COMPARED = (RESULTS, f"{SETTINGS}#rmse-after-*")
# Columns of the joint model that one channel's model takes: its transform, and the noise.
_JOINT_COLUMNS = ((0, 1, 2, 3, 8), (4, 5, 6, 7, 8))

_SIMULATED = (
    "The stars are our own simulation with the imaging parameters of Table 1. The paper seems to "
    "have simulated with the translations of Table 2, which do not follow from them: that, and no "
    "noise, is why its shifts lie far outside."
)

Registration = GaussianRegistration | PointwiseRegistration
_JOINT_FILE = ("x_red", "y_red", "x_blue", "y_blue", "x_green", "y_green")
# Of the field: how far a distortion may move a star beforehand, or so many times the residuals, but
# never so far that it cannot be undone.
_SHARE, _RESIDUALS, _MOST = 1e-3, 10.0, 0.03
# Fewer stars do not tell a wrong match from noise.
_FEW = 10


def centroids(given: Given) -> FloatArray:
    """Simulated centroids of green, red and blue, shape (3, n, 2), in px."""
    noise = given[NOISE]
    return np.asarray(noisy_centroids(true_centroids(given), noise, data_stream(given, 1), 1)[0])


def true_centroids(given: Given) -> FloatArray:
    """Noise-free centroids of green, red and blue, shape (3, n, 2), in px."""
    return simulation.imaged(given, simulation.literal(given).angles)


def truth(given: Given, channels: tuple[str, ...]) -> dict[str, float]:
    """The transforms that the simulation stands for, its distortions left aside, and its noise.

    One channel alone has the noise of both its images in `noise`; two have that of one image.
    """
    cameras = dict(zip(simulation.CHANNELS, simulation.cameras(given), strict=True))
    turns = dict(zip(simulation.CHANNELS, simulation.rotations(given), strict=True))
    found, noise = {}, given[NOISE]
    for channel in channels:
        prefix = f"{channel}-" if len(channels) > 1 else ""
        similarity = similarity_between(cameras[channel], turns[channel], cameras["green"])
        pairs = zip(ESTIMATES, similarity.parameters.tolist(), strict=True)
        found.update({prefix + name: value for name, value in pairs})
    both = 1.0 if len(channels) > 1 else float(np.hypot(1, found["scale"]))
    return {**found, "noise": noise * both}


def _registration(given: Given) -> Model:
    """The red channel laid over green."""
    green, red, _ = centroids(given)
    return _with_new_stars(given, registration_model(red, green, pivot(given, "red")))


def pivot(given: Given, channel: str) -> FloatArray:
    """Principal point of a channel, shape (2,), in px."""
    return given.array(f"{IMAGING}#principal-point-?.{channel}")


def registration_of(model: Model) -> Registration:
    """Return the likelihood of a model that registers one channel; TypeError for any other."""
    likelihood = model.likelihood
    if not isinstance(likelihood, Registration):
        raise TypeError(f"model: expected a registration, got {type(likelihood).__name__}")
    return likelihood


def _with_new_stars(given: Given, model: Model) -> Model:
    likelihood = registration_of(model)
    return replace(model, derived=_new_stars(given, likelihood, "red"))


def _joint(given: Given) -> Model:
    """Both channels laid over green at once."""
    green, red, blue = centroids(given)
    pivots = (pivot(given, "red"), pivot(given, "blue"))
    likelihood = JointRegistration((red, blue), green, pivots)
    consequences = Together(
        tuple(
            _new_stars(given, likelihood.single(i), channel, _JOINT_COLUMNS[i], f"{channel} ")
            for i, channel in enumerate(REGISTERED)
        )
    )
    return joint_model((red, blue), green, pivots, consequences)


def _distortion(given: Given) -> Model:
    """The red channel with both distortions free."""
    return _with_new_stars(given, distortion_model(_registration(given)))


def _mixture(given: Given) -> Model:
    """The red channel, three stars of ten matched with the wrong green one."""
    green, red, _ = centroids(given)
    order = Generator(PCG64(data_stream(given, 4))).permutation(len(red))
    false = order[: round(_FALSE * len(red))]
    green[false] = green[np.roll(false, 1)]
    matched = registration_model(red, green, pivot(given, "red"))
    return _with_new_stars(given, mixture_model(matched))


def _mixture_truth(given: Given) -> dict[str, float]:
    """The truth of the red channel, and how many stars are matched wrongly."""
    return {**truth(given, ("red",)), "false-share": _FALSE}


def centroid_noise(given: Given) -> Model:
    """The noise that the errors of Table 3 tell of."""
    true = true_centroids(given)
    response = _response(true)
    cells = [f"{row}.{channel}" for channel in ("red", "blue") for row in ROWS]
    # The truth is Table 2; its scale, rounded in print, is taken from the focal lengths.
    green = given[f"{IMAGING}#focal-length.green"]
    expected = np.array(
        [
            float(scale_factor(green, given[f"{IMAGING}#focal-length.{cell[6:]}"]))
            if cell.startswith("scale")
            else given[f"{simulation.TRUTH}#{cell}"]
            for cell in cells
        ]
    )
    addresses = [f"{RESULTS}#{cell}" for cell in cells]
    printed = np.array([given[address] for address in addresses])
    half = [given.half_unit(address) for address in addresses]
    likelihood = CentroidNoiseLikelihood(expected, response @ response.T, printed, np.array(half))
    model = centroid_noise_model(likelihood, given[NOISE])
    return replace(model, derived=NoiseAlone(pixel_angle(given)))


def _response(true: FloatArray, step: float = 1e-3) -> FloatArray:
    """Response of the calibrated parameters of both channels to every coordinate, (8, 6 n)."""
    coordinates = true.size
    moved = true + step * np.eye(coordinates).reshape(coordinates, *true.shape)
    batch = np.concatenate([true[None], moved])
    # The zero position gives the pivot, as in the calibration of section 3.2.
    zero = int(np.argmin(np.hypot(*(true[0] - true[0].mean(axis=0)).T)))
    found = np.concatenate(
        [fit_registration(batch[:, i], batch[:, 0], batch[:, i, zero]).parameters for i in (1, 2)],
        axis=-1,
    )
    return np.asarray((found[1:] - found[0]).T / step)


def _test_points(given: Given) -> FloatArray:
    """Measured test points in green, red and blue, shape (3, points, 2), in px."""
    count, half_ranges = given.count(_TEST_POINTS), simulation.half_ranges(given)
    directions = spawned_angles(data_stream(given, 3, 0), 1, count, half_ranges)[0]
    true = simulation.imaged(given, directions)
    return np.asarray(noisy_centroids(true, given[NOISE], data_stream(given, 3, 1), 1)[0])


def _new_stars(
    given: Given,
    likelihood: Registration,
    channel: str,
    columns: tuple[int, ...] = (),
    prefix: str = "",
) -> NewStars:
    """Return the consequences of one channel's registration at the test points.

    The transform in use is the least-squares one; where stars may be false, of those that agree.
    """
    true = likelihood.agreeing if isinstance(likelihood, MixtureRegistration) else slice(None)
    fit = fit_registration(likelihood.source[true], likelihood.target[true], likelihood.pivot)
    source = _source(given, channel)
    registered = fit.transform.apply(source)
    stars = likelihood.elsewhere(source)
    return NewStars(stars, registered, pixel_angle(given), columns, prefix)


def pixel_angle(given: Given) -> float:
    """Return the angle that a pixel of the green channel spans, in arcsec."""
    pitch = given["niu2024/text-optics#pixel-pitch-x"]
    focal_length = given[f"{IMAGING}#focal-length.green"]
    return float(angle_from_pixels(1.0, pitch, focal_length)) * ARCSEC_PER_RADIAN


@dataclass(frozen=True)
class NoiseAlone:
    """What centroid noise leaves of a star of which a channel is laid over green without error.

    Parameters
    ----------
    arcsec_per_px : float
        Of the green channel.
    """

    arcsec_per_px: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Root mean square distance of the two images: two noisy axes of two noisy stars."""
        rmse = 2 * parameters[:, 0]
        angle = rmse * self.arcsec_per_px
        return {
            "registered star, RMSE": Consequence(rmse, "px", "both axes, the transform exact"),
            "registered star, pointing error": Consequence(angle, "arcsec", "the same as an angle"),
        }


def _one_channel(given: Given, model: Model, channel: str) -> Published:
    """Return what the paper prints of one channel, calibrated by least squares."""
    likelihood = registration_of(model)
    stars = likelihood.elsewhere(_source(given, channel))

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        targets = simulated(model, parameters, generator)
        return _calibrated(likelihood, likelihood.source, targets, stars, parameters, generator)

    return published_cells(given, _addresses(channel), repeat, (*ESTIMATES, ""), note=_SIMULATED)


def _both_channels(given: Given, model: Model) -> Published:
    """Return what the paper prints of both channels; the arguments are those of `one_channel`."""
    likelihood = model.likelihood_of(JointRegistration)
    parts = [(likelihood.single(i), _JOINT_COLUMNS[i]) for i in (0, 1)]
    stars = [part.elsewhere(_source(given, channel))
             for (part, _), channel in zip(parts, REGISTERED, strict=True)]  # fmt: skip

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        drawn = [model.repeat(one, generator) for one in parameters]
        blue, green = (np.stack(column) for column in zip(*drawn, strict=True))
        sources = (likelihood.sources[0], blue)
        found = [
            _calibrated(part, source, green, new, parameters[:, columns], generator)
            for (part, columns), source, new in zip(parts, sources, stars, strict=True)
        ]
        return np.concatenate(found, axis=1)

    addresses = [address for channel in REGISTERED for address in _addresses(channel)]
    names = [f"{c}-{name}" if name else "" for c in REGISTERED
             for name in (*ESTIMATES, "")]  # fmt: skip
    return published_cells(given, addresses, repeat, names, note=_SIMULATED)


def _calibrated(
    likelihood: Registration,
    source: FloatArray,
    target: FloatArray,
    stars: StarModel,
    parameters: FloatArray,
    generator: Generator,
) -> FloatArray:
    """Least-squares parameters of many calibrations and their RMSE at test points, (n, 5)."""
    fit = fit_registration(source, target, likelihood.pivot)
    registered = fit.transform.apply(stars.source)
    return np.column_stack([fit.parameters, rmse_at(stars, registered, parameters, generator)])


def _source(given: Given, channel: str) -> FloatArray:
    points: FloatArray = _test_points(given)[simulation.CHANNELS.index(channel)]
    return points


def _addresses(channel: str) -> list[str]:
    cells = [f"{RESULTS}#{row}.{channel}" for row in ROWS]
    return [*cells, f"{SETTINGS}#rmse-after-{channel}"]


def _published_table(given: Given, model: Model) -> Published:
    """The printed parameters of both channels, which are this model's data."""
    addresses = [f"{RESULTS}#{row}.{channel}" for channel in ("red", "blue") for row in ROWS]

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        return simulated(model, parameters, generator)

    return published_cells(given, addresses, repeat, whole=model.log_likelihood, note=OWN_DATA)


def beside_the_registration(model: Model) -> dict[str, Aside]:
    """Whether the noise grows across the field, and what a principal point that is off does."""
    plain = model.likelihood_of(GaussianRegistration)
    scale, rotation = fit_registration(plain.source, plain.target, plain.pivot).parameters[:2]
    # A principal point off by d moves the shift by (w - 1) d.
    moved = abs(scale * np.exp(1j * rotation) - 1) * _PRINCIPAL_POINT
    return {
        "noise-growth": Aside(*noise_growth(plain.source, plain.target, plain.pivot), "1"),
        "principal-point": Aside(_PRINCIPAL_POINT, 0.0, "px"),
        "shift-by-principal-point": Aside(float(moved), 0.0, "px"),
    }


def _users_registration(table: Table, pivot: Pivot) -> Model:
    """Registration of one channel."""
    source, target = table.values[:, :2], table.values[:, 2:]
    centre = _pivots(table, pivot)[0]
    priors = _free(table, source, target, centre)
    return registration_model(source, target, centre, priors=priors)


def _users_mixture(table: Table, pivot: Pivot) -> Model:
    """The same with stars that may be matched wrongly."""
    if len(table.values) < _FEW:
        raise TableFileError(
            f"{table.path}: expected {_FEW} or more stars, got {len(table.values)}; fewer do not "
            "tell a wrong match from noise: take registration, or add some"
        )
    _refuse_rounded(table)
    return _turning(mixture_model(_users_registration(table, pivot)), table)


def _refuse_rounded(table: Table) -> None:
    """Refuse stars whose noise rounding hides: a density that may be as narrow has no bound."""
    if told := rounded(table.values):
        raise TableFileError(
            f"{table.path}: expected coordinates with more digits, got {told}: this model would "
            "take these for free of noise; take registration, or add digits"
        )


def _turning(model: Model, table: Table) -> Model:
    """Any rotation, about that of the stars that agree: wrong matches may turn least squares."""
    try:
        theta = float(model.likelihood.start()[0][1])
    except ValueError as error:  # stars in one place
        raise TableFileError(f"{table.path}: {error}") from error
    turn = Uniform(theta - np.pi, theta + np.pi, "any: the full turn, cut opposite to the fit of "
                   "those stars that agree")  # fmt: skip
    return replace(model, parameters=with_priors(model.parameters, {"rotation": turn}))


def _users_distortion(table: Table, pivot: Pivot) -> Model:
    """The same with both distortions free, up to some thousandths of the field."""
    base = _users_registration(table, pivot)
    residual = base.likelihood.start()[0][4]
    reach = min(max(_share(table), _RESIDUALS * residual), _MOST * _share(table) / _SHARE)
    prior = Normal(0.0, float(reach), "some thousandths of the field at its edge, or ten times the "
                   "residuals where these are larger")  # fmt: skip
    model = distortion_model(base)
    extra = tuple(replace(parameter, prior=prior) for parameter in model.parameters[5:])
    return replace(model, parameters=model.parameters[:5] + extra)


def _users_joint(table: Table, pivot: Pivot) -> Model:
    """Both channels at once."""
    red, blue, green = (table.values[:, i : i + 2] for i in (0, 2, 4))
    centres = _pivots(table, pivot)
    priors: dict[str, Prior] = {}
    for channel, source, centre in zip(REGISTERED, (red, blue), centres, strict=True):
        own = _free(table, source, green, centre)
        # Both channels share one noise, and its prior is that of the channel with more of it.
        widest = max((own.pop("noise"), priors.get("noise")), key=_high)
        priors |= {f"{channel}-{key}": prior for key, prior in own.items()}
        if widest is not None:
            priors["noise"] = widest
    model = joint_model((red, blue), green, (centres[0], centres[1]))
    return replace(model, parameters=with_priors(model.parameters, priors))


def _high(prior: Prior | None) -> float:
    return prior.high if isinstance(prior, LogUniform) else 0.0


def _pivots(table: Table, pivot: Pivot | FloatArray) -> list[FloatArray]:
    """The principal point of each channel: as given, or the mean of its stars."""
    channels = [table.values[:, i : i + 2] for i in range(0, len(table.columns) - 2, 2)]
    if pivot is None:
        return [points.mean(axis=0) for points in channels]
    try:
        return [checked_pivot(pivot, points) for points in channels]
    except ValueError as error:
        raise TableFileError(str(error)) from error


def _free(
    table: Table, source: FloatArray, target: FloatArray, pivot: FloatArray
) -> dict[str, Prior]:
    try:
        return free_priors(source, target, pivot)
    except ValueError as error:
        raise TableFileError(f"{table.path}: {error}") from error


def _remarks(table: Table, pivot: Pivot, model: str = "similarity") -> list[str]:
    """What a user should hear of the stars, in the words of `reproduce.register`."""
    found: dict[str, None] = {}
    for i, centre in enumerate(_pivots(table, pivot)):
        source = table.values[:, 2 * i : 2 * i + 2]
        stars = (source, table.values[:, -2:], centre, table.named)
        try:
            found |= dict.fromkeys(one.text for one in diagnose(*stars, model=model))
        except ValueError as error:
            raise TableFileError(f"{table.path}: {error}") from error
    return list(found)


def _unnamed(table: Table, pivot: Pivot) -> list[str]:
    """The same but for mismatches, which the mixture names itself."""
    return [text for text in _remarks(table, pivot) if "do not fit the others" not in text]


def _share(table: Table) -> float:
    return _SHARE * float(np.ptp(table.values[:, :2], axis=0).max())


_PLACES = "one star per line, in px: its place in the channel and in the reference channel"
_ALONE = File(STARS, _PLACES, _users_registration, _remarks, pivot=True)
_JOINT = File(
    _JOINT_FILE,
    "one star per line, in px: its places in the three channels",
    _users_joint,
    _remarks,
    pivot=True,
)


_red = partial(
    Declaration, paper="niu2024", given=READS, truth=partial(truth, channels=("red",)),
    published=partial(_one_channel, channel="red"), compared=_COMPARED,
)  # fmt: skip
POSTERIORS = (
    _red(
        "registration", "Registration of one channel: similarity and Gaussian noise",
        build=_registration, file=_ALONE,
        asides=beside_the_registration, walkers=240,
    ),
    Declaration(
        "registration-joint", "Registration of both channels: they share the green noise",
        "niu2024", READS, _joint, _JOINT, partial(truth, channels=REGISTERED),
        _both_channels, _COMPARED,
    ),
    Declaration(
        "registration-mixture", "Registration with wrong matches: a good/bad mixture", "niu2024",
        READS, _mixture, replace(_ALONE, read=_users_mixture, remarks=_unnamed), _mixture_truth,
        steps=350, walkers=96,
    ),
    _red(
        "registration-distortion", "Registration with both distortions free", build=_distortion,
        file=replace(_ALONE, read=_users_distortion),
    ),
    Declaration(
        "centroid-noise", "Effective centroid noise, from the errors of the calibrated parameters",
        "niu2024", (*READS, simulation.TRUTH, RESULTS), centroid_noise,
        "its likelihood is the response of one calibration, that of Table 3, to the noise of its "
        "own simulated angles; for centroids of your own take registration, which estimates their "
        "noise",
        published=_published_table, steps=200,
    ),
)  # fmt: skip
