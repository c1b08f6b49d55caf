"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""
