"""Every printed number of two papers on optical pointing, recomputed and judged.

The papers are niu2024 (registration of a three-detector star sensor) and chen2023 (camera
misalignment seen by a star tracker). The public API::

    import reproduce as rp

    rp.contents()                        # both papers, item by item, with the score
    rp.table("niu2024/table-3")          # printed and computed; also one cell, KEY#CELL
    rp.table("niu2024/table-3").rerun({"niu2024/text-simulation#noise": "0.2 px"}, seed=7)
    rp.table("niu2024/table-3").rerun(angles="rectangle", translations="table-2")
    rp.figure("chen2023/fig-11a")        # draws itself
    rp.posterior("registration")         # sampled on first use
    rp.audit("chen2023")                 # consistency of the printed numbers, and the errata
    rp.register(source, target)          # your stars
    rp.register("red.fits", "green.fits")    # or images: rp.stars, then rp.match, in one
    rp.misalignment("spots.csv", platform=rp.Platform(...))  # your laser spots
    rp.check()                           # all verdicts against the frozen ones
    rp.cite("chen2023/table-5")          # or one cell of it; rp.verify(citation)

Names load on first use, so that ``import reproduce`` is cheap.
"""

import warnings
from importlib import import_module
from typing import Any

from reproduce.version import __version__ as __version__

# Module that defines each name of the public API.
_MODULES = {
    "Platform": "physics.attitude",
    "audit": "views.consistency",
    "check": "views.contents",
    "cite": "views.citations",
    "contents": "views.contents",
    "figure": "views.figure",
    "match": "views.pictures",
    "misalignment": "views.measurements",
    "posterior": "views.posteriors",
    "register": "views.register",
    "stars": "views.pictures",
    "table": "views.table",
    "verify": "views.verify",
}
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Load a name of the public API."""
    if name == "contradictions":
        warnings.warn(
            "rp.contradictions is deprecated. Use rp.audit.",
            DeprecationWarning,
            stacklevel=2,
        )
        name = "audit"
    if name not in _MODULES:
        raise AttributeError(
            f"module {__name__!r} has no attribute {name!r}; it has {__all__}"
        )
    found = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the names of the public API."""
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
