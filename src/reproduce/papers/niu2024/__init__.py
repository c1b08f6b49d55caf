"""Niu, Wei and Li, Sensors 24, 259 (2024): registering the images of a 3CMOS star sensor."""

from reproduce.papers.declare import Item
from reproduce.papers.niu2024 import (
    angles,
    camera,
    experiment,
    figures_method,
    figures_setup,
    laboratory,
    model,
    simulation,
)

ITEMS = (
    Item("niu2024/text-context"),
    Item("niu2024/fig-1", (), figures_method.draw_workflow),
    Item("niu2024/text-approximations", (model.scale_near_one, model.parameter_count)),
    Item("niu2024/fig-2", (), figures_method.draw_planes),
    Item("niu2024/fig-3", (), figures_setup.draw_calibration),
    Item(
        "niu2024/text-optics",
        (camera.field_of_view, camera.centre_wavelength, camera.centre_wavelengths),
    ),
    Item("niu2024/table-1"),
    Item("niu2024/table-2", (model.true_scale, model.true_translation)),
    Item("niu2024/text-simulation", (simulation.registration_rmse,)),
    Item("niu2024/fig-4", (), angles.draw),
    Item("niu2024/table-3", (simulation.calibrated_parameters, simulation.calibrated_translations)),
    Item(
        "niu2024/text-registration",
        (experiment.pointing_errors, laboratory.rmse_before, laboratory.rmse_after),
    ),
    Item("niu2024/fig-5", (), figures_setup.draw_acquisition),
    Item("niu2024/table-4", (experiment.scale_factors, experiment.fitted_parameters)),
)
