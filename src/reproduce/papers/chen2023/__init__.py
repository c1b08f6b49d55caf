"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""


def _made(*modules: tuple[str, str]) -> dict[str, str]:
    """Return each key with its module, in order."""
    return {
        f"chen2023/{key}": module for module, keys in modules for key in keys.split()
    }


# The module that computes and draws each item, in the order of the paper. Empty if the item is
# only quoted, or drawn by hand in data/schematics/.
ITEMS = _made(
    ("", "text-context"),
    ("", "fig-1a fig-1b"),
    ("platform_twin", "fig-1c fig-1d"),
    ("satellite", "table-1"),
    ("positioning", "text-positioning"),
    ("", "fig-2a fig-2b fig-3a fig-3b fig-3c"),
    ("satellite", "text-satellite"),
    ("", "fig-4 fig-5 fig-6a fig-6b text-hardware"),
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

# The modules of the supplementary tables.
STUDIES = _made(
    ("satellite", "retro-reflectors dichroic heat"),
    ("positioning", "budget"),
    ("attitude", "orders"),
    ("effectiveness", "focal-lengths differences"),
    ("decisions", "frames"),
)

# The modules of the supplementary drawings.
DRAWINGS = _made(
    ("", "drawing-misalignment drawing-wahba drawing-roll"),
    ("resolution", "drawing-terms"),
    ("decisions", "drawing-frames"),
)
