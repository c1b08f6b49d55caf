"""Build hook: put ``data/`` into wheels as ``reproduce/_data``; wheel and sdist carry the commit.

An editable install must not get the copies: they would stand beside the checkout
and grow stale, so the inclusion cannot be a line of pyproject.toml.
"""

import runpy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


# Hatchling leaves the kind of its configuration open.
class DataHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the data folder to standard wheels, and says which commit was built."""

    folder: TemporaryDirectory[str]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Register the folder, unless this is an editable install."""
        self.folder = TemporaryDirectory()
        if version != "standard":
            return
        if wheel := self.target_name == "wheel":
            build_data["force_include"]["data"] = "reproduce/_data"
        package = Path(self.root) / "src" / "reproduce"
        if not (package / "_commit").exists():  # a wheel from an sdist has it already
            of_checkout = runpy.run_path(str(package / "version.py"))
            file = Path(self.folder.name) / "commit"
            file.write_text(of_checkout["commit"](Path(self.root)))
            place = "reproduce" if wheel else "src/reproduce"
            build_data["force_include"][str(file)] = f"{place}/_commit"

    def finalize(
        self, version: str, build_data: dict[str, Any], artifact_path: str
    ) -> None:
        """Remove what only the build needed."""
        self.folder.cleanup()
