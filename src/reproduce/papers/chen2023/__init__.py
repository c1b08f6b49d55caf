"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""

# The modules that make and draw each item, in order of print; none for one that is only quoted.
ITEMS = {
    "chen2023/text-context": "",
    "chen2023/fig-1a": "figures.satellite",
    "chen2023/fig-1b": "figures.satellite",
    "chen2023/fig-1c": "figures.platform",
    "chen2023/fig-1d": "figures.platform",
    "chen2023/table-1": "satellite",
    "chen2023/text-positioning": "positioning",
    "chen2023/fig-2a": "figures.satellite",
    "chen2023/fig-2b": "figures.satellite",
    "chen2023/fig-3a": "figures.satellite",
    "chen2023/fig-3b": "figures.satellite",
    "chen2023/fig-3c": "figures.satellite",
    "chen2023/text-satellite": "satellite",
    "chen2023/fig-4": "figures.satellite",
    "chen2023/fig-5": "figures.satellite",
    "chen2023/fig-6a": "figures.platform",
    "chen2023/fig-6b": "figures.platform",
    "chen2023/text-hardware": "",
    "chen2023/table-2": "platform",
    "chen2023/text-effectiveness": "effectiveness",
    "chen2023/text-platform": "platform",
    "chen2023/fig-7": "figures.platform",
    "chen2023/table-3": "",
    "chen2023/text-accuracy": "accuracy",
    "chen2023/fig-8": "figures.platform",
    "chen2023/fig-9": "figures.platform",
    "chen2023/table-4": "accuracy",
    "chen2023/table-5": "effectiveness",
    "chen2023/fig-10a": "figures.platform",
    "chen2023/fig-10b": "figures.platform",
    "chen2023/fig-10c": "figures.platform",
    "chen2023/text-resolution": "resolution",
    "chen2023/fig-11a": "figures.resolution",
    "chen2023/fig-11b": "figures.resolution",
}

# The modules of our own tables beside the paper's.
STUDIES = {
    "chen2023/retro-reflectors": "satellite",
    "chen2023/dichroic": "satellite",
    "chen2023/heat": "satellite_terms",
    "chen2023/thermal": "satellite_terms",
    "chen2023/stray": "satellite_terms",
    "chen2023/budget": "positioning",
    "chen2023/strategies": "positioning",
    "chen2023/ages": "positioning",
    "chen2023/suffices": "positioning",
    "chen2023/floors": "accuracy",
    "chen2023/orders": "attitude",
    "chen2023/misfit": "platform_twin",
    "chen2023/believable": "platform_twin",
    "chen2023/sensors": "platform_twin",
    "chen2023/roll": "platform_twin",
    "chen2023/focal-lengths": "effectiveness",
    "chen2023/readings": "resolution",
    "chen2023/errors": "resolution",
    "chen2023/estimators": "resolution",
}

# The modules of our own drawings.
DRAWINGS = {
    "chen2023-instruments": "figures.attitude",
    "chen2023-misalignment": "figures.attitude",
    "chen2023-stage": "figures.attitude",
}
