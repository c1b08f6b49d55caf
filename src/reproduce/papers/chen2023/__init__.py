"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""


def _made(*modules: tuple[str, str]) -> dict[str, str]:
    """Return each key with its module, in order."""
    return {
        f"chen2023/{key}": module for module, keys in modules for key in keys.split()
    }


# The module that makes and draws each item, in order of print; none for one that is only quoted.
ITEMS = _made(
    ("", "text-context"),
    ("positioning", "fig-1a"),
    ("satellite", "fig-1b"),
    ("platform_twin", "fig-1c fig-1d"),
    ("satellite", "table-1"),
    ("positioning", "text-positioning"),
    ("satellite", "fig-2a fig-2b fig-3a fig-3b fig-3c"),
    ("satellite", "text-satellite"),
    ("attitude", "fig-4 fig-5"),
    ("platform_twin", "fig-6a fig-6b"),
    ("", "text-hardware"),
    ("platform", "table-2"),
    ("effectiveness", "text-effectiveness"),
    ("platform", "text-platform"),
    ("platform_twin", "fig-7"),
    ("", "table-3"),
    ("accuracy", "text-accuracy"),
    ("platform_twin", "fig-8 fig-9"),
    ("accuracy", "table-4"),
    ("effectiveness", "table-5"),
    ("platform_twin", "fig-10a fig-10b fig-10c"),
    ("resolution", "text-resolution fig-11a fig-11b"),
)

# The modules of our own tables beside the paper's.
STUDIES = _made(
    ("satellite", "retro-reflectors dichroic heat"),
    ("positioning", "budget strategies"),
    ("attitude", "orders"),
    ("effectiveness", "focal-lengths differences"),
    ("decisions", "frames drift"),
)

# The modules of our own drawings.
DRAWINGS = _made(
    ("attitude", "drawing-misalignment"),
    ("decisions", "drawing-frames"),
)
