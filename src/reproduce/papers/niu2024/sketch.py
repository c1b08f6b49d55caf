"""The three channels of niu2024, told apart wherever they are drawn: colour, line and marker."""

from __future__ import annotations

from reproduce.papers.sketch import Look

RED = Look("red", "#D55E00", "--", "s")
GREEN = Look("green", "#009E73", "-.", "o")
BLUE = Look("blue", "#0072B2", ":", "^")
LOOKS = {look.name: look for look in (RED, GREEN, BLUE)}
