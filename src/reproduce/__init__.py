"""Every printed number of two papers on optical pointing, recomputed and judged.

The papers are niu2024 (registration of a three-detector star sensor) and
chen2023 (camera misalignment seen by a star tracker). The subpackages are
verbs: `physics` derives, `printed` holds what the papers print, `papers`
declares which function makes which item, `judge` compares, `views` shows.

This module imports nothing, so that ``import reproduce`` stays cheap.
"""

__version__ = "0.1.0"
RELEASED = "2026-11-21"
