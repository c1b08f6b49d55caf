"""The path of the light: mirrors, cones and how they turn it."""

from reproduce.physics.light.cone import LightPath, Mirrors, light_path
from reproduce.physics.light.raytrace import (
    CORNER,
    cone_path,
    fold_mirror_tilt,
    mirror_train,
    reflection,
    turn_response,
    turned_train,
)
