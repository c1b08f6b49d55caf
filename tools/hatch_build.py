"""Build hook: put ``data/`` into wheels as ``reproduce/_data``; wheel and sdist carry the commit.

An editable install uses the data of the checkout, so the files cannot be named in pyproject.toml.
"""

import runpy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


# The type of the configuration is not public in hatchling.
class DataHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the data folder and the commit to standard wheels."""

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
        """Remove the temporary folder of the build."""
        self.folder.cleanup()
