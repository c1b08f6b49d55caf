"""Simulated star positions in several channels, with centroid noise, over many replicates.

Rotation angles have shape (..., n, 2), in radians: x is the rotary table's middle frame, y its
external frame. Image points have shape (..., n, 2), in px, x before y, with the centre of the first
pixel at (0, 0); channels stand on the axis before them, replicates in front.

Every replicate draws from a stream of its own, the child of a seed sequence with the replicate's
number. A result therefore depends neither on how replicates are grouped into batches, nor on how
many there are: `first` is the number of the first replicate, where a long run is done in parts.
The seed sequence is not changed; use it for nothing else.

The rotary table that turns the sensor in front of a single-star simulator.

`external` is the angle of the external frame (phi_1), `middle` that of the middle frame (phi_2),
both in radians and broadcast against each other. Matrices have shape (..., 3, 3) and take a vector
of the table's frame to the sensor's frame; directions have shape (..., 3), z along the boresight.
A positive middle angle moves the star towards negative x, a positive external angle towards
positive y.

A step and a range of angles do not fix their arrangement: `arrangements_with` enumerates the
plausible ones (lattice, offset, window) so that a count can select among them, and nothing else
does. Rows are sorted by y, then x. Every lattice is a fine rectangular grid of spacings (a, b),
either whole or chequered. Chequered, it keeps the nodes whose indices have an even sum, which gives
the quincunx and hexagonal lattices; its points then stand 2a apart along a row, and rows stand b
apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.optics.camera import Camera, image_points
from reproduce.physics.validate import FloatArray, Number, Size

_WORD = 2**32
_EDGE = 1e-9
_LARGEST_SIDE = 2000


def channel_centroids(
    cameras: Sequence[Camera], rotations: ArrayLike, angles: ArrayLike
) -> FloatArray:
    """Where every channel images the simulator's star, without noise.

    Parameters
    ----------
    cameras : sequence of Camera
        One per channel.
    rotations : array_like, shape (channels,)
        Angle of each detector against the reference, in radians; zero for the reference.
    angles : array_like, shape (..., n, 2)
        Rotation angles of the table, in radians.

    Returns
    -------
    ndarray, shape (..., channels, n, 2)
        Centroids, in px, channels in the order of `cameras`.

    Raises
    ------
    ValueError
        If there is no camera, the counts differ, or an angle turns the star behind the sensor.

    Examples
    --------
    >>> camera = Camera(20e-3, (50, 60), 0, 10e-6)
    >>> channel_centroids([camera], [0.0], [[0.0, np.pi / 4]]).round(6)
    array([[[  50., 2060.]]])
    """
    turns = validate.finite_array("rotations", rotations, shape=(None,))
    if turns.shape != (len(cameras),):
        raise ValueError(
            f"expected one rotation per camera, got {len(cameras)} cameras and rotations of shape "
            f"{turns.shape}; give zero for the reference channel"
        )
    middle, external = np.moveaxis(
        validate.finite_array("angles", angles, shape=(None, 2)), -1, 0
    )
    directions = starlight(external, middle)
    channels = zip(cameras, turns, strict=True)
    return np.stack(
        [image_points(directions, *channel) for channel in channels], axis=-3
    )


def noisy_centroids(
    centroids: ArrayLike,
    sigma: ArrayLike,
    seeds: SeedSequence,
    replicates: int,
    *,
    repeats: int = 1,
    first: int = 0,
) -> FloatArray:
    """Replicates of measured centroids: the true ones plus Gaussian noise, averaged over repeats.

    Other arguments and errors are those of `spawned_streams`.

    Parameters
    ----------
    centroids : array_like, shape (channels, n, 2) or (replicates, channels, n, 2)
        True positions, in px; the same for all replicates, or their own for each.
    sigma : array_like, shape () or (channels,)
        Standard deviation of one coordinate of one draw, in px; zero for a channel without noise.
    repeats : int
        How many draws are averaged into each replicate.

    Returns
    -------
    ndarray, shape (replicates, channels, n, 2), in px

    Examples
    --------
    >>> noisy_centroids([[[7, 9]]], 0.0, SeedSequence(1), 2).shape
    (2, 1, 1, 2)
    """
    centroids = validate.finite_array("centroids", centroids, shape=(None, None, 2))
    sigma = validate.non_negative("sigma", sigma)
    repeats = validate.whole_number("repeats", repeats)
    count = validate.whole_number("replicates", replicates)
    validate.common_batch(centroids=centroids.shape[:-3], replicates=(count,))
    shape = centroids.shape[-3:]
    if sigma.shape not in ((), shape[:1]):
        raise ValueError(
            f"sigma: expected one number or one per channel ({shape[0]}), got shape "
            f"{sigma.shape}; give one, or as many as there are channels"
        )
    noise = np.empty((count, *shape))
    for row, stream in zip(
        noise, spawned_streams(seeds, replicates, first), strict=True
    ):
        stream.standard_normal(out=row)
        # Averaged in the draw: ten repeats of many replicates would not fit in memory.
        if repeats > 1:
            further = stream.standard_normal((repeats - 1, *shape))
            row[:] = np.concatenate([row[None], further]).mean(axis=0)
    return centroids + sigma[..., None, None] * noise


def spawned_normals(
    seeds: SeedSequence, replicates: int, shape: tuple[int, ...], *, first: int = 0
) -> FloatArray:
    """Standard normal numbers, every replicate from its own stream.

    Arguments and errors are those of `spawned_streams`, and the shape of one replicate.

    Returns
    -------
    ndarray, shape (replicates, *shape)
        Row r is the same for whatever `replicates` and `first` it was drawn with.

    Examples
    --------
    >>> all_at_once = spawned_normals(SeedSequence(1), 3, (2,))
    >>> bool((all_at_once[2:] == spawned_normals(SeedSequence(1), 1, (2,), first=2)).all())
    True
    """
    shape = tuple(validate.whole_number("shape", side) for side in shape)
    normals = np.empty((validate.whole_number("replicates", replicates), *shape))
    for row, stream in zip(
        normals, spawned_streams(seeds, replicates, first), strict=True
    ):
        stream.standard_normal(out=row)
    return normals


def spawned_angles(
    seeds: SeedSequence,
    replicates: int,
    count: int,
    half_range: ArrayLike,
    *,
    first: int = 0,
) -> FloatArray:
    """Rotation angles at random, uniform over a rectangle, every replicate from its own stream.

    Other arguments and errors are those of `spawned_streams`.

    Parameters
    ----------
    count : int
        How many angles each.
    half_range : array_like, shape (2,)
        Half the range in x and in y, in radians; zero or more.

    Returns
    -------
    ndarray, shape (replicates, count, 2), in radians, x before y

    Examples
    --------
    >>> angles = spawned_angles(SeedSequence(1), 5, 52, (0.2, 0.1))
    >>> angles.shape, bool((abs(angles) <= (0.2, 0.1)).all())
    ((5, 52, 2), True)
    """
    half = validate.non_negative("half_range", half_range, shape=(2,))
    if half.shape != (2,):
        raise ValueError(
            f"half_range: expected shape (2,), got {half.shape}; one x and one y"
        )
    sizes = {"replicates": replicates, "count": count}
    uniform = np.empty((*(validate.whole_number(*one) for one in sizes.items()), 2))
    for row, stream in zip(
        uniform, spawned_streams(seeds, replicates, first), strict=True
    ):
        stream.random(out=row)
    return -half + 2 * half * uniform


def spawned_streams(
    seeds: SeedSequence, replicates: int, first: int = 0
) -> Iterator[Generator]:
    """Generators, one for each replicate, for draws that are not normal.

    Parameters
    ----------
    seeds : numpy.random.SeedSequence
        One that is used for nothing else; it is not changed.
    replicates : int
    first : int
        Number of the first replicate, where a long run is done in parts.

    Returns
    -------
    iterator of numpy.random.Generator
        The stream of a replicate is the same in whatever part of the run it is asked for.

    Examples
    --------
    >>> len(list(spawned_streams(SeedSequence(1), 3)))
    3
    """
    if not isinstance(seeds, SeedSequence):
        raise TypeError(
            f"seeds: expected a numpy.random.SeedSequence, got {type(seeds).__name__}; "
            "pass SeedSequence(your_number)"
        )
    first = validate.whole_number("first", first, least=0)
    last = first + validate.whole_number("replicates", replicates)
    numbers = np.arange(first, last, dtype=np.int64)
    states = _child_states(seeds, numbers)
    # NumPy documents any ISeedSequence; its annotations name one of them.
    return (Generator(PCG64(_Seeded(state))) for state in states)  # type: ignore[arg-type]


class _Seeded(ISeedSequence):
    """What `SeedSequence.generate_state` would return for PCG64, known already."""

    def __init__(self, words: NDArray[np.uint64]) -> None:
        self.words = words

    def generate_state(
        self, n_words: int, dtype: object = np.uint32
    ) -> NDArray[np.uint64]:
        """Return the four words that PCG64 asks for."""
        return self.words


def _child_states(
    seeds: SeedSequence, numbers: NDArray[np.int64]
) -> NDArray[np.uint64]:
    """Return the states of the children of a seed sequence with the given numbers, shape (n, 4).

    As NumPy makes them (O'Neill's hash, which NumPy promises not to change), for all children at
    once: they differ in the last word of their spawn key only, and one by one this takes longer
    than the draws themselves.
    """
    if numbers[-1] >= _WORD:
        raise ValueError(
            f"first: expected replicates below 2**32, got {numbers[-1]}; start lower"
        )
    # What a child mixes before its own number: its parent's pool. spawn() would count up there.
    pool = SeedSequence(seeds.entropy, spawn_key=seeds.spawn_key).pool
    before = max(len(pool), _words(seeds.entropy)) + _words(seeds.spawn_key)
    constant = 0x43B0D7E5 * pow(0x931E8875, before * len(pool), _WORD) % _WORD
    mixed = []
    for word in pool.tolist():
        value = numbers.astype(np.uint32) ^ np.uint32(constant)
        constant = constant * 0x931E8875 % _WORD
        value = np.uint32(0xCA01F9DD * word % _WORD) - np.uint32(
            0x4973F715
        ) * _scrambled(value * np.uint32(constant))
        mixed.append(_scrambled(value))
    constant, states = 0x8B51F9DD, np.empty((len(numbers), 8), dtype="<u4")
    for place in range(8):
        value = mixed[place % len(pool)] ^ np.uint32(constant)
        constant = constant * 0x58F38DED % _WORD
        states[:, place] = _scrambled(value * np.uint32(constant))
    return states.view("<u8").astype(np.uint64)


def _scrambled(value: NDArray[np.uint32]) -> NDArray[np.uint32]:
    return value ^ (value >> np.uint32(16))


def _words(entropy: Any) -> int:
    """Return how many words of 32 bits a whole number, or several, fill in a seed sequence."""
    if isinstance(entropy, int | np.integer):
        return max(1, -(-int(entropy).bit_length() // 32))
    return sum(map(_words, entropy))


@validate.checked
def rotary_matrix(external: Number, middle: Number) -> FloatArray:
    """The rotation of the table: the external frame's about x after the middle frame's about y.

    Implements: niu2024 (20).

    The sign of sin(middle) in the bottom row is positive here, which makes the middle frame's
    matrix a rotation; as extracted it is negative, see `rotary_matrix_printed`.

    Parameters
    ----------
    external, middle : array_like, shape (...)
        Angles of the two frames, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Proper rotations: transpose is inverse, determinant +1.

    Examples
    --------
    >>> rotary_matrix(0.0, np.pi / 2).round(12) + 0.0
    array([[ 0.,  0., -1.],
           [ 0.,  1.,  0.],
           [ 1.,  0.,  0.]])
    """
    return _rotary(external, middle, np.sin(middle))


@validate.checked
def rotary_matrix_printed(external: Number, middle: Number) -> FloatArray:
    """The matrix with the sign of its bottom-left element as extracted from the print.

    Printed form of niu2024 (20).

    It is not a rotation: its determinant is cos(2 * middle), and its first column is not
    orthogonal to its third. Its third column is the right one, so starlight that starts along z
    comes out the same; any other starting vector does not. Arguments are those of `rotary_matrix`.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> matrix = rotary_matrix_printed(0.0, np.pi / 2)
    >>> float(np.linalg.det(matrix).round(12))
    -1.0
    """
    return _rotary(external, middle, -np.sin(middle))


@validate.checked
def starlight(external: Number, middle: Number) -> FloatArray:
    """The direction of the simulator's star in the sensor's frame.

    Implements: niu2024 (19).

    Arguments are those of `rotary_matrix`; angles of shape (n,) give directions (n, 3), as
    `image_points` takes them.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors (-sin m, sin e cos m, cos e cos m): the third column of `rotary_matrix`,
        because the star starts along z.

    Examples
    --------
    >>> starlight(np.pi / 2, 0.0).round(12) + 0.0
    array([0., 1., 0.])
    """
    external, middle = np.broadcast_arrays(external, middle)
    # Written out instead of multiplied: many thousand angles are turned into starlight at once.
    return np.stack(
        [
            -np.sin(middle),
            np.sin(external) * np.cos(middle),
            np.cos(external) * np.cos(middle),
        ],
        axis=-1,
    )


def _rotary(
    external: FloatArray, middle: FloatArray, bottom_left: FloatArray
) -> FloatArray:
    """Return [[1, 0, 0], [0, ce, se], [0, -se, ce]] @ [[cm, 0, -sm], [0, 1, 0], [left, 0, cm]]."""
    external, middle, left = np.broadcast_arrays(external, middle, bottom_left)
    sine, cosine, zero = np.sin(external), np.cos(external), np.zeros_like(left)
    rows = (
        (np.cos(middle), zero, -np.sin(middle)),
        (sine * left, cosine, sine * np.cos(middle)),
        (cosine * left, -sine, cosine * np.cos(middle)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@dataclass(frozen=True)
class _Lattice:
    """A pattern without bounds: what its step measures, spacings of the fine grid (rad), nodes."""

    name: str
    spacing_x: float
    spacing_y: float
    chequered: bool


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A finite set of rotation angles and how it came about.

    Attributes
    ----------
    lattice, offset, window : str
        The choices that made it.
    angles : ndarray, shape (n, 2), in radians, x before y
    """

    lattice: str
    offset: str
    window: str
    angles: FloatArray

    @property
    def name(self) -> str:
        """The three choices in one line."""
        return f"{self.lattice}; {self.offset}; {self.window}"


def _lattices(half_x: float, half_y: float, step: float) -> list[_Lattice]:
    """Every lattice by what the step can mean, and those stretched to fill the range."""
    root2, root3 = np.sqrt(2.0), np.sqrt(3.0)
    fixed = [
        _Lattice("square, step between neighbours", step, step, False),
        _Lattice("quincunx, step between rows", step, step, True),
        _Lattice("quincunx, step between neighbours", step / root2, step / root2, True),
        _Lattice("quincunx, step along a row", step / 2, step / 2, True),
        _Lattice("hexagonal, rows along x", step / 2, step * root3 / 2, True),
        _Lattice("hexagonal, rows along y", step * root3 / 2, step / 2, True),
    ]
    a, b = (2 * half / max(1, round(2 * half / step)) for half in (half_x, half_y))
    return [
        *fixed,
        _Lattice("square, stretched to the edges", a, b, False),
        _Lattice(
            "quincunx, stretched to the edges, spacings nearest the step", a, b, True
        ),
        *(
            _Lattice(
                f"quincunx, stretched to the edges in {m} by {n} spacings", dx, dy, True
            )
            for m, n, dx, dy in _stretched_to_mean(half_x, half_y, step)
        ),
    ]


@validate.checked
def arrangements_with(
    count: int, half_x: Size, half_y: Size, step: Size
) -> list[Arrangement]:
    """Every arrangement of the family that has exactly so many angles.

    The family is lattices by offsets by windows. Offsets: a point at the middle of the range; half
    a spacing away from it along the rows, across them, or both; a point at the lower left corner.
    Windows: the rectangle with and without its border, the ellipse that touches its sides, the
    circle of the smaller half range, that of the larger one cut by the rectangle, the diamond
    through the middles of its sides. (The circle through the corners cuts nothing off.)

    Parameters
    ----------
    count : int
    half_x, half_y, step : float
        Half the range in x and in y, and the step of the angles, in radians, above zero.

    Returns
    -------
    list of Arrangement
        All different; empty if none fits.

    Raises
    ------
    ValueError
        If the step is too small for the range.

    Examples
    --------
    >>> [found.name for found in arrangements_with(9, 1.0, 1.0, 1.0)][0]
    'square, step between neighbours; centred; rectangle'
    """
    if max(half_x, half_y) > _LARGEST_SIDE * step:
        raise ValueError(
            f"step: expected at least 1/{_LARGEST_SIDE} of the half range, got {step:g} for "
            f"{max(half_x, half_y):g}; are all three in radians?"
        )
    validate.whole_number("count", count)
    every = _arrangements(half_x, half_y, step)
    return [found for found in every if len(found.angles) == count]


def _arrangements(half_x: float, half_y: float, step: float) -> Iterator[Arrangement]:
    """Every arrangement of the family but empty ones and those equal to an earlier one."""
    seen: set[bytes] = set()
    for lattice in _lattices(half_x, half_y, step):
        for offset, origin in _offsets(lattice, half_x, half_y).items():
            nodes = _nodes(lattice, origin, half_x, half_y)
            for window, inside in _windows(nodes, half_x, half_y).items():
                angles = nodes[inside]
                key = np.rint(angles / (_EDGE * step)).astype(np.int64).tobytes()
                if len(angles) and key not in seen:
                    seen.add(key)
                    yield Arrangement(lattice.name, offset, window, angles)


def _stretched_to_mean(
    half_x: float, half_y: float, step: float
) -> Iterator[tuple[int, int, float, float]]:
    """Divisions of both ranges whose two spacings average to the step, within a factor of two."""
    largest = round(3 * half_x / step) + 1
    for m in range(1, largest + 1):
        a = 2 * half_x / m
        b = 2 * step - a
        if not step * (2 / 3 - _EDGE) <= a <= step * (4 / 3 + _EDGE):
            continue
        n = 2 * half_y / b
        if n >= 1 - _EDGE and abs(n - round(n)) < _EDGE * n:
            yield m, round(n), a, 2 * half_y / round(n)


def _offsets(
    lattice: _Lattice, half_x: float, half_y: float
) -> dict[str, tuple[float, float]]:
    along = lattice.spacing_x * (1.0 if lattice.chequered else 0.5)
    across = lattice.spacing_y / 2
    return {
        "centred": (0.0, 0.0),
        "half a spacing along x": (along, 0.0),
        "half a row spacing along y": (0.0, across),
        "half a spacing along both": (along, across),
        "from the lower left corner": (-half_x, -half_y),
    }


def _nodes(
    lattice: _Lattice, origin: tuple[float, float], half_x: float, half_y: float
) -> FloatArray:
    """All points of the lattice within the closed rectangle, sorted by y, then x."""
    reach_x = int(2 * half_x / lattice.spacing_x) + 2
    reach_y = int(2 * half_y / lattice.spacing_y) + 2
    i, j = np.meshgrid(
        np.arange(-reach_x, reach_x + 1), np.arange(-reach_y, reach_y + 1)
    )
    kept = (i + j) % (2 if lattice.chequered else 1) == 0
    x = origin[0] + lattice.spacing_x * i[kept]
    y = origin[1] + lattice.spacing_y * j[kept]
    inside = (np.abs(x) <= half_x * (1 + _EDGE)) & (np.abs(y) <= half_y * (1 + _EDGE))
    return np.stack([x[inside], y[inside]], axis=-1)


def _windows(
    nodes: FloatArray, half_x: float, half_y: float
) -> dict[str, NDArray[np.bool_]]:
    """Which nodes of the rectangle each window holds."""
    x, y = nodes.T
    small, large = min(half_x, half_y), max(half_x, half_y)
    return {
        "rectangle": np.ones(len(nodes), dtype=bool),
        "rectangle without its border": np.abs(nodes / [half_x, half_y]).max(axis=1)
        < 1 - _EDGE,
        "inscribed ellipse": (x / half_x) ** 2 + (y / half_y) ** 2 <= 1 + _EDGE,
        "circle of the smaller half range": np.hypot(x, y) <= small * (1 + _EDGE),
        "circle of the larger half range": np.hypot(x, y) <= large * (1 + _EDGE),
        "diamond": np.abs(x) / half_x + np.abs(y) / half_y <= 1 + _EDGE,
    }
