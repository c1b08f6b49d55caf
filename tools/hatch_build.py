"""Build hook: put ``data/`` into wheels as ``reproduce/_data``.

An editable install must not get the copy: it would stand beside the checkout
and grow stale, so the inclusion cannot be a line of pyproject.toml.
"""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


# Hatchling leaves the kind of its configuration open.
class DataHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the data folder to standard wheels."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Register the folder, unless this is an editable install."""
        if version == "standard":
            build_data["force_include"]["data"] = "reproduce/_data"
