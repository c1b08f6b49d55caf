"""The path of the light: mirrors, cones and how they turn it."""

from reproduce.physics.light.raytrace import (
    CORNER,
    LightPath,
    Mirrors,
    cone_path,
    fold_mirror_tilt,
    light_path,
    mirror_train,
    reflection,
    turn_response,
    turned_train,
)
