"""Posteriors of the printed tests of the bench, Table IV and Table V (chen2023, V-B and V-C).

Table IV: white noise and floor of the misalignment. Table V: the focal length of the telescope from
the monitored angles, if the order of the columns is unknown. One printed motion of Table V has a
typographical error, so motions are differences of the printed positions.
"""

from __future__ import annotations

from functools import partial

from reproduce.inference import LogUniform, Model, Parameter, Uniform
from reproduce.inference.models import AveragedNoise, StageAngles
from reproduce.papers.chen2023.accuracy import COUNTS, FRAMES
from reproduce.papers.chen2023.effectiveness import stage_motions
from reproduce.papers.chen2023.platform import SIGMAS, TELESCOPE
from reproduce.papers.posteriors import Declaration, book_plan
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

_WHITE = LogUniform(
    0.03 * RADIANS_PER_ARCSEC,
    3.0 * RADIANS_PER_ARCSEC,
    "no scale preferred about 1 % of a pixel",
)
_STATE = LogUniform(
    3e-3 * RADIANS_PER_ARCSEC,
    0.3 * RADIANS_PER_ARCSEC,
    "no scale preferred between the digits and a tenth of the smallest motion",
)


def averaging(inputs: Inputs, axis: str) -> Model:
    """Return the white noise and the floor of Table IV about an axis, one sigma."""
    column = f"chen2023/table-4#*.misalignment-{axis}"
    likelihood = AveragedNoise(
        inputs.array(column) / SIGMAS,
        inputs.half_unit(column.replace("*", "1")) / SIGMAS,
        tuple(inputs.array(COUNTS).astype(int).tolist()),
        inputs.count(FRAMES),
    )
    floor = Uniform(
        0.0,
        60 * likelihood.half_unit,
        "sixty halves of the last digit, a quarter of one image",
    )
    return Model(
        f"averaging-{axis}",
        (
            Parameter("white", "arcsec", _WHITE, ARCSEC_PER_RADIAN),
            Parameter("floor", "arcsec", floor, ARCSEC_PER_RADIAN, 0.0),
        ),
        likelihood,
    )


def _stage(inputs: Inputs) -> Model:
    """Return the focal length of the telescope and the noise of a state of Table V."""
    # A motion along one axis rotates the camera about the other axis.
    angles = inputs.pairs("chen2023/table-5#*.monitoring-?")
    motions = stage_motions(inputs)[1:]
    likelihood = StageAngles(angles.T[::-1], motions.T[::-1])
    nominal = inputs[TELESCOPE]
    length = Uniform(nominal / 2, nominal * 2, "half to double the nominal length")
    return Model(
        "stage",
        (
            Parameter("focal-length", "mm", length, 1e3),
            Parameter("noise", "arcsec", _STATE, ARCSEC_PER_RADIAN),
        ),
        likelihood,
        likelihood.interchanged,
    )


_NO_FILE = "its data are the printed numbers of the paper"

POSTERIORS = (
    *(
        Declaration(
            f"averaging-{axis}",
            f"White noise and floor about {axis.upper()} (Table IV, measured)",
            "chen2023",
            (
                COUNTS,
                f"chen2023/table-4#*.misalignment-{axis}",
                FRAMES,
            ),
            partial(averaging, axis=axis),
            _NO_FILE,
            summary={
                "white": f"White noise of one image about {axis.upper()}, one sigma"
            },
        )
        for axis in "xy"
    ),
    Declaration(
        "stage",
        "Focal length of the telescope (Table V, measured)",
        "chen2023",
        (
            "chen2023/table-5#*.monitoring-?",
            "chen2023/table-5#*.position-?",
            TELESCOPE,
        ),
        _stage,
        _NO_FILE,
        plan=book_plan(steps=600, walkers=96),
        summary={"focal-length": TELESCOPE},
    ),
)
