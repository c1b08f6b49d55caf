"""Niu, Wei and Li, Sensors 24, 259 (2024): registering the images of a 3CMOS star sensor."""

from reproduce.papers.declare import Item
from reproduce.papers.niu2024 import angles, camera, experiment, model, simulation

ITEMS = (
    Item("niu2024/text-context"),
    Item("niu2024/text-approximations", (model.scale_near_one, model.parameter_count)),
    Item("niu2024/text-optics", (camera.field_of_view, camera.centre_wavelengths)),
    Item("niu2024/table-1"),
    Item("niu2024/table-2", (model.true_scale, model.true_translation)),
    Item("niu2024/text-simulation", (simulation.registration_rmse,)),
    Item("niu2024/fig-4", (), angles.draw),
    Item("niu2024/table-3", (simulation.calibrated_parameters,)),
    Item("niu2024/text-registration", (experiment.pointing_errors, experiment.laboratory_rmse)),
    Item("niu2024/table-4", (experiment.scale_factors, experiment.fitted_parameters)),
)
