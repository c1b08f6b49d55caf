"""Niu, Wei and Li, Sensors 24, 259 (2024): registering the images of a 3CMOS star sensor."""

# The module that computes and draws each item, in the order of the paper. Empty if the item is
# only quoted, or drawn by hand in data/schematics/.
ITEMS = {
    "niu2024/text-context": "",
    "niu2024/fig-1": "",
    "niu2024/text-approximations": "approximations",
    "niu2024/fig-2": "",
    "niu2024/fig-3": "",
    "niu2024/text-optics": "optics",
    "niu2024/table-1": "",
    "niu2024/table-2": "registration",
    "niu2024/text-simulation": "simulation",
    "niu2024/fig-4": "simulation",
    "niu2024/table-3": "simulation",
    "niu2024/text-experiment": "experiment",
    "niu2024/fig-5": "",
    "niu2024/table-4": "experiment",
}

# The modules of supplementary tables.
STUDIES = {
    "niu2024/approximations": "approximations",
    "niu2024/scale-errors": "experiment",
    "niu2024/printed-scales": "published",
    "niu2024/fusion": "images",
    "niu2024/stars": "decisions",
}

# The modules of supplementary drawings.
DRAWINGS = {
    "niu2024/drawing-table-3": "simulation",
    "niu2024/drawing-laboratory": "experiment",
    "niu2024/drawing-scale-bias": "",
    "niu2024/drawing-lever": "",
    "niu2024/drawing-student": "",
    "niu2024/drawing-channels": "",
    "niu2024/drawing-fusion-star": "images",
    "niu2024/drawing-fusion-errors": "images",
    "niu2024/drawing-stars": "decisions",
    "niu2024/drawing-printed-scales": "published",
}
