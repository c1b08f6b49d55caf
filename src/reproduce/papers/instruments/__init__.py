"""Instruments that publish their data: the estimators of both papers on real measurements."""

# The modules of our own tables; no paper prints any of their numbers.
STUDIES = {
    "instruments/three-detectors": "colours",
    "instruments/models": "colours",
    "instruments/lenses": "colours",
    "instruments/lights": "chandra",
    "instruments/laser-metrology": "chandra",
    "instruments/averaging": "chandra",
    "instruments/strategies": "chandra",
}

# The modules of our own drawings.
DRAWINGS = {
    "instruments/drawing-strips": "colours",
    "instruments/drawing-lenses": "colours",
    "instruments/drawing-lights": "chandra",
    "instruments/drawing-strategies": "chandra",
}
