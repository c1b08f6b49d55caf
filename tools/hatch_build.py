"""Build hooks: ``data/`` as ``reproduce/_data`` in wheels, commit and address in wheel and sdist.

An editable install uses the data of the checkout, so the files cannot be named in pyproject.toml.
"""

import runpy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface


def settings(root: str) -> dict[str, Any]:
    """Return the names of version.py."""
    return runpy.run_path(str(Path(root) / "src" / "reproduce" / "version.py"))


class AddressHook(MetadataHookInterface):
    """Adds the addresses of the published book; none before the publication."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the addresses of the project."""
        address = settings(self.root)["ADDRESS"]
        pages = {
            "Homepage": "",
            "Documentation": "/run.html",
            "Changelog": "/changes.html",
        }
        metadata["urls"] = (
            {name: address + page for name, page in pages.items()} if address else {}
        )


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
            file = Path(self.folder.name) / "commit"
            file.write_text(
                settings(self.root)["build_record"](Path(self.root)), encoding="utf-8"
            )
            place = "reproduce" if wheel else "src/reproduce"
            build_data["force_include"][str(file)] = f"{place}/_commit"

    def finalize(
        self, version: str, build_data: dict[str, Any], artifact_path: str
    ) -> None:
        """Remove the temporary folder of the build."""
        self.folder.cleanup()
