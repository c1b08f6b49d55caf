"""Instruments that publish their data: the estimators of both papers on real measurements."""

# The modules of our own tables; no paper prints any of their numbers.
STUDIES = {
    "instruments/three-detectors": "colours",
    "instruments/models": "colours",
    "instruments/confusion": "colours",
    "instruments/lenses": "colours",
}

# The modules of our own drawings.
DRAWINGS = {
    "instruments/drawing-strips": "colours",
    "instruments/drawing-lenses": "colours",
}
