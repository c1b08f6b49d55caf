"""Sphinx extension: pages that need no network and load without an error.

MathJax is copied beside the pages from a package. It is copied after the build,
and not kept under ``_static/``, because every script there is loaded by every
page, with mathematics or without.
"""

import shutil
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

# The full build: the smaller one loses a page's mathematics at \boldsymbol.
MATHJAX = "tex-svg-full.js"


def mathjax_source() -> Path:
    """Return the installed MathJax script."""
    package = "sphinx-mathjax-offline"
    return Path(str(distribution(package).locate_file(f"{package}/static/mathjax/{MATHJAX}")))


def point_to_local_mathjax(app: Sphinx) -> None:
    """Make the pages load the copy below ``_static/``."""
    app.config.mathjax_path = f"mathjax/{MATHJAX}"


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Put the script beside the pages."""
    if error is None and app.builder.format == "html":
        target = Path(app.outdir) / "_static" / "mathjax" / MATHJAX
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(mathjax_source(), target)


def drop_thebe(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Take out thebe, which the theme declares twice: an error on every page."""
    for kind in ("script_files", "css_files"):
        context[kind] = [asset for asset in context.get(kind, []) if not is_thebe(asset)]


def is_thebe(asset: Any) -> bool:
    """Tell whether a script or a style sheet belongs to thebe."""
    body = getattr(asset, "attributes", {}).get("body") or ""
    return "thebe" in str(getattr(asset, "filename", "") or "") or "THEBE" in body


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers; thebe goes after the extension that adds it."""
    app.connect("builder-inited", point_to_local_mathjax)
    app.connect("html-page-context", drop_thebe, priority=900)
    app.connect("build-finished", copy_mathjax)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
