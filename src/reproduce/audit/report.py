"""The whole audit of a paper in one call, its equations run, and the register of errata.

Equations are cross-examined with themselves: each is run as extracted, on printed numbers. A matrix
that should be a rotation, an identity, a dimension, an iteration that should converge, a chain of
frames that should close. Where our text of it fails, the right form runs beside it.
"""

from __future__ import annotations

import fnmatch
import functools
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from reproduce.audit import examine
from reproduce.audit.relation import Finder, Relation, Sheet, declarations, declared
from reproduce.physics import attitude, ground, light, optics, registration
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.registration import constraint, constraint_printed
from reproduce.physics.validate import FloatArray
from reproduce.printed.cells import library
from reproduce.printed.number import si_factor

# Far above the noise of double precision, far below any digit of print.
_ZERO = 1e-9
STEPS = 5
# What the form as extracted gives, what that of the library gives, and what it should be.
_Values = tuple[float, float, float]


@dataclass(frozen=True)
class Demonstration:
    """An equation run as printed: what it was asked, what it gives, and what it should give.

    `right` is what the form that the library uses gives, `meaning` what the numbers are, and
    `supposition` what the run supposes that the paper does not say; empty where it supposes
    nothing.
    """

    name: str
    printed: float
    right: float
    wanted: float
    place: str
    asked: str
    meaning: str
    supposition: str = ""

    @property
    def holds(self) -> bool:
        """Whether the printed form does what it must."""
        return abs(self.printed - self.wanted) <= _ZERO * max(1.0, abs(self.wanted))


def _distortion_ratio(cells: Sheet) -> _Values:
    k = cells["niu2024/table-2#scale.red"].si
    ours, theirs = (
        cells[f"niu2024/table-1#radial-distortion.{c}"].si for c in ("green", "red")
    )
    right = float(optics.distortion_ratio(k, ours, theirs))
    # The second line of (7) sets y'_g where the first line sets x'_b: one factor k is lost.
    printed = k**2 * ours / theirs
    return printed, right, right


def _turned_back(cells: Sheet) -> _Values:
    angle = cells["niu2024/table-2#rotation.red"].si
    start = np.array([[3.0, 4.0]])
    cosine, sine = np.cos(angle), np.sin(angle)
    back = (
        optics.turned_onto_detector(start, angle)
        @ np.array([[cosine, -sine], [sine, cosine]]).T
    )
    left = float(np.abs(back - start).max())
    return left, left, 0.0


def _rotary(cells: Sheet) -> _Values:
    turn = cells["niu2024/text-simulation#range-x-high"].si
    printed, right = (
        float(np.linalg.det(form(0.0, turn)))
        for form in (optics.rotary_matrix_printed, optics.rotary_matrix)
    )
    return printed, right, 1.0


def _constraint(cells: Sheet) -> _Values:
    turn = cells["niu2024/table-2#rotation.red"].si
    return float(constraint_printed(turn)), float(constraint(turn)), 0.0


def _iteration(cells: Sheet) -> _Values:
    rows = ("scale", "rotation", "translation-x", "translation-y")
    truth = np.array([cells[f"niu2024/table-2#{row}.red"].si for row in rows])
    size = np.array([cells[f"niu2024/text-optics#pixels-{a}"].si for a in "xy"])
    source = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * (size - 1)
    middle = optics.detector_centre(size)
    target = registration.Registration("similarity", truth, middle).apply(source)
    errors = []
    for step in (
        registration.gauss_newton_step_printed,
        registration.gauss_newton_step,
    ):
        found = np.array([1.0, 0.0, 0.0, 0.0])
        for _ in range(STEPS):
            found = step(found, source, target, middle)
        errors.append(float(np.linalg.norm((found - truth)[2:])))
    return errors[0], errors[1], 0.0


def _laser_geometry(cells: Sheet) -> tuple[FloatArray, float]:
    half = cells["chen2023/text-hardware#laser-diagonal"].si / 2
    places = np.array([[0.0, -half], [-half, 0.0], [half, 0.0], [0.0, half]])
    return places, cells["chen2023/table-2#telescope-focal-length.value"].si


def _unit_vectors(cells: Sheet) -> _Values:
    length = float(
        np.linalg.norm(attitude.emitted_directions(*_laser_geometry(cells)), axis=-1)[0]
    )
    return length, length, 1.0


def _chain(cells: Sheet) -> _Values:
    """Close the chain (4), (6), (7): the misalignment put in must come out."""
    camera = attitude.emitted_directions(*_laser_geometry(cells))
    zero = rotation_from_vector(np.array([0.3, -1.2, 0.5]))
    turned = rotation_from_vector(np.array([1e-5, -2e-5, 3e-5]))
    moved = attitude.moved_laser_transform(zero, turned)
    seen = camera @ moved.T  # w = T v, one row for each laser
    left = float(np.abs(camera - seen @ (turned @ zero.T).T).max())
    return left, left, 0.0


def _retroreflector(cells: Sheet) -> _Values:
    """Turn the reflector of the satellite, read as a corner cube, about three axes."""
    beam, turn = np.array([0.0, 0.0, -1.0]), si_factor("arcsec")
    straight = light.mirror_train(light.CORNER) @ beam
    turns = [rotation_from_vector(turn * axis) for axis in np.eye(3)]
    returned = [light.mirror_train(light.CORNER @ turned.T) @ beam for turned in turns]
    moved = max(float(np.linalg.norm(one - straight)) / turn for one in returned)
    return moved, moved, 0.0


def _roll_leak(cells: Sheet) -> _Values:
    """Roll the camera about its boresight, and take the error of (5) in the two orders."""
    t = "chen2023/table-2#tracker-"
    spots = np.array(
        [
            [cells[f"chen2023/text-platform#spot-{i}-{a}"].si for a in "xy"]
            for i in "1234"
        ]
    )
    middle = optics.detector_centre([cells[f"{t}pixels-{a}.value"].si for a in "xy"])
    scale = cells[f"{t}pixel-size.value"].si / cells[f"{t}focal-length.value"].si
    across, along = (spots.mean(axis=0) - middle) * scale
    reference = rotation_from_vector(np.array([-along, across, 0.0]))
    rolled = reference @ rotation_from_vector(
        np.array([0.0, 0.0, 60 * si_factor("arcsec")])
    )
    errors = [
        float(np.hypot(*attitude.misalignment_angles(form(rolled, reference))[:2]))
        / si_factor("arcsec")
        for form in (attitude.transform_error_printed, attitude.misalignment_between)
    ]
    return errors[0], errors[1], 0.0


def _stage_angle(cells: Sheet) -> _Values:
    travel = cells["chen2023/text-effectiveness#maximum-travel"].si
    focal = cells["chen2023/text-effectiveness#focal-length"].si
    arcsec = si_factor("arcsec")
    printed, right = (
        float(form(travel, focal)) / arcsec
        for form in (attitude.stage_angle_printed, attitude.stage_angle)
    )
    return printed, right, -float(np.arctan(travel / focal)) / arcsec


def _stage_signs(cells: Sheet) -> _Values:
    """Move the lasers along Y and let (5) and (7) measure which way the camera seems to turn."""
    places, focal = _laser_geometry(cells)
    shift = cells["chen2023/text-effectiveness#step"].si
    before, after = (
        attitude.emitted_directions(places + np.array([0.0, moved]), focal)
        for moved in (0.0, shift)
    )
    found = attitude.misalignment(before, after, np.eye(3))
    angles = (
        attitude.stage_angle(shift, focal),
        attitude.stage_angles([0.0, shift], focal)[0],
        attitude.misalignment_angles(found)[0],
    )
    printed, right, wanted = (float(np.sign(float(angle))) for angle in angles)
    return printed, right, wanted


def _misalignment_side(cells: Sheet) -> _Values:
    """Set the inverse of the matrix of (8) in the place of R_U, and compare the lines of sight."""
    turn = cells["chen2023/text-effectiveness#simulated-angle"].si
    boresights = cells["chen2023/text-satellite#boresight-angle"].si
    installed = rotation_from_vector(np.array([boresights, 0.0, 0.0]))
    gaps = []
    for axis in np.eye(2, 3):
        moved = rotation_from_vector(turn * axis)
        corrected = installed @ moved.T  # (8), inverted
        forms = moved.T, attitude.misalignment_in_tracker(moved, installed)
        gaps.append(
            [np.linalg.norm((form @ installed - corrected)[:, 2]) for form in forms]
        )
    printed, right = (float(gap) for gap in np.max(gaps, axis=0) / si_factor("arcsec"))
    return printed, right, 0.0


def _line_of_sight(cells: Sheet) -> _Values:
    """Compare the bracket of (1) with the direction (2) of one point of the focal plane."""
    places, focal = _laser_geometry(cells)
    bracket = ground.image_vectors(places[:1], focal)[0]
    emitted = attitude.emitted_directions(places[:1], focal)[0]
    cosine = float(bracket @ emitted / np.linalg.norm(bracket))
    return (
        cosine,
        -cosine,
        1.0,
    )  # with a negative scaling factor the bracket changes its sign


def _mirrored_pattern(cells: Sheet) -> _Values:
    """Follow a direction of (2) to the one of (3), by a corner cube and the dichroic mirror."""
    tilt = cells["chen2023/text-satellite#dihedral-angle"].si
    fold = light.reflection([0.0, np.sin(tilt), np.cos(tilt)])
    # A received direction points back along the light.
    satellite = -fold @ light.mirror_train(light.CORNER)
    handed = satellite @ np.diag([1.0, -1.0, 1.0])  # the lasers of a mirrored pattern
    return float(np.linalg.det(satellite)), float(np.linalg.det(handed)), 1.0


_RUNS: dict[str, Callable[[Sheet], _Values]] = {
    "distortion-ratio": _distortion_ratio,
    "turned-back": _turned_back,
    "rotary-matrix": _rotary,
    "unit-circle": _constraint,
    "iteration": _iteration,
    "unit-vectors": _unit_vectors,
    "chain": _chain,
    "misalignment-side": _misalignment_side,
    "stage-angle": _stage_angle,
    "stage-signs": _stage_signs,
    "retroreflector": _retroreflector,
    "roll-leak": _roll_leak,
    "line-of-sight": _line_of_sight,
    "mirrored-pattern": _mirrored_pattern,
}


@dataclass(frozen=True)
class Audit:
    """What the relations say of a paper, and its equations run as printed.

    There is a finding for each relation, those that rest on a supposition of ours included.
    `groups` has the names of contradictions that share cells or unknowns.
    """

    name: str
    cells: Sheet
    findings: tuple[examine.Examined, ...]
    conflicts: tuple[examine.Conflict, ...]
    groups: tuple[tuple[str, ...], ...]
    unknowns: dict[str, examine.Agreement]
    equations: tuple[Demonstration, ...]

    @property
    def examined(self) -> tuple[str, ...]:
        """The cells held against another one by some relation, in the order of the sheet."""
        found = {
            a
            for f in self.findings
            if f.relation.compares
            for a in f.relation.addresses
        }
        return tuple(address for address in self.cells if address in found)

    @property
    def bounded(self) -> tuple[str, ...]:
        """The cells of which relations tell no more than a sign, a bound or a last digit."""
        found = {a for finding in self.findings for a in finding.relation.addresses}
        return tuple(a for a in self.cells if a in found and a not in self.examined)

    @property
    def read(self) -> tuple[examine.Examined, ...]:
        """The findings on what the paper says, without those that rest on a supposition of ours."""
        return tuple(f for f in self.findings if not f.relation.supposition)

    @property
    def supposed(self) -> tuple[examine.Examined, ...]:
        """The findings that rest on a supposition of ours."""
        return tuple(f for f in self.findings if f.relation.supposition)

    @property
    def failing(self) -> tuple[Demonstration, ...]:
        """The equations that fail as extracted, without those that rest on a supposition."""
        return tuple(e for e in self.equations if not (e.holds or e.supposition))

    def tally(
        self, *, restating: bool | None = None
    ) -> dict[examine.RelationOutcome, int]:
        """Count the relations without suppositions by outcome, every outcome present.

        All of them, or only those that do, or do not, restate a computed number.
        """
        found = [f for f in self.read if restating in {None, bool(f.relation.restates)}]
        return {o: sum(f.outcome == o for f in found) for o in examine.OUTCOMES}


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    tables = (table for key, table in library().items() if key.startswith(f"{paper}/"))
    cells = {
        cell.address: cell for table in tables for cell in table.cells if cell.is_number
    }
    content = declarations(paper)
    joint = {"relations": {"joint": content.get("joint", [])}}
    every = (declared(one, cells, f"{paper}/") for one in (content, joint))
    return audit(paper, cells, *every)


def audit(
    name: str,
    cells: Sheet,
    relations: Sequence[Relation],
    joint: Sequence[Relation] = (),
) -> Audit:
    """Audit some cells by relations between them, and by declared combinations of relations."""
    read = [relation for relation in relations if not relation.supposition]
    texts = declarations(name).get("equations", {})
    return Audit(
        name=name,
        cells=cells,
        findings=tuple(examine.examine(cells, relations)),
        conflicts=tuple(examine.conflicts(cells, read, joint)),
        groups=tuple(
            tuple(r.name for r in group) for group in examine.groups(cells, read)
        ),
        unknowns=examine.agreements(cells, relations),
        equations=tuple(
            Demonstration(n, *_RUNS[n](cells), **t) for n, t in texts.items()
        ),
    )


# "not supported as printed" if a statement of the paper contradicts the numbers that it refers to.
_Conclusion = Literal["stands", "moves", "not supported as printed", "open"]


class Erratum(BaseModel):
    """One entry of the register.

    The numbers of its evidence are not written in it: they come from the relations and equations
    that it names. Where words stand against words, `evidence` says which. `reading` tells which
    of two independent readings of the paper found it, as for a relation, and `again` whether the
    third one did too, which knew no list. An entry that holds only if we suppose something that
    the paper does not say names it as its `supposition`, and is counted apart. `extraction` marks
    what rests on a formula, a digit or a heading of our text, which a machine read. `reply` is what
    the authors of the paper say to it, with their name and the day; empty until they do.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    id: str = Field(description="its name and anchor")
    paper: str
    place: str = Field(description="where in the paper it stands")
    printed: str = Field(description="what is printed there, in short")
    problem: str = Field(
        description="what does not fit, under the most charitable reading"
    )
    library: str = Field(description="what the library does about it")
    conclusion: _Conclusion = Field(description="whether the paper's conclusion stands")
    because: str = Field(description="why it does")
    status: Literal["open", "one reading of several", "reported", "confirmed"]
    reading: Finder = Field(
        description="which of two independent readings of the paper found it"
    )
    again: bool = Field(
        default=False, description="whether a third reading did, without a list"
    )
    extraction: bool = Field(
        default=False, description="our text, read by a machine, may be wrong"
    )
    supposition: str = Field(
        default="", description="what it supposes that the paper leaves open"
    )
    evidence: str = Field(default="", description="words that stand against words")
    reply: str = Field(default="", description="what the authors replied")
    relations: list[str] = Field(
        default=[], description="relations of the audit that show it"
    )
    equations: list[str] = Field(
        default=[], description="equations that show it, as extracted"
    )

    def findings(self, audit: Audit) -> list[examine.Examined]:
        """Return the findings of the relations that the entry names."""
        return [
            finding
            for finding in audit.findings
            if any(
                fnmatch.fnmatchcase(finding.relation.name, one)
                for one in self.relations
            )
        ]

    def demonstrations(self, audit: Audit) -> list[Demonstration]:
        """Return the equations, run as printed, that the entry names."""
        return [shown for shown in audit.equations if shown.name in self.equations]


def register(text: str) -> list[Erratum]:
    """Read the register, in the order of the file."""
    return [Erratum.model_validate(entry) for entry in tomllib.loads(text)["erratum"]]
