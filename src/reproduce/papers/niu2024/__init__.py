"""Niu, Wei and Li, Sensors 24, 259 (2024): registering the images of a 3CMOS star sensor."""

# The modules that make and draw each item, in order of print; none for one that is only quoted.
ITEMS = {
    "niu2024/text-context": "",
    "niu2024/fig-1": "figures_method",
    "niu2024/text-approximations": "model",
    "niu2024/fig-2": "figures_method",
    "niu2024/fig-3": "figures_setup",
    "niu2024/text-optics": "camera",
    "niu2024/table-1": "",
    "niu2024/table-2": "model",
    "niu2024/text-simulation": "simulation",
    "niu2024/fig-4": "angles",
    "niu2024/table-3": "simulation",
    "niu2024/text-experiment": "experiment laboratory",
    "niu2024/fig-5": "figures_setup",
    "niu2024/table-4": "experiment",
}

# The modules of our own tables beside the paper's.
STUDIES: dict[str, str] = {}
