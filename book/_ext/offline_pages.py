"""Sphinx extension: pages that need no network, load without an error, and are small.

The theme's script of icons has 1.5 MB on every page: unused icons are removed. MathJax is copied
from a package after the build, since every page loads all scripts that are below ``_static/``
before the build.
"""

import json
import re
import shutil
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

from after_build import SAFE, after_build

ICONS = "scripts/fontawesome.js"
# An icon in that script: its name, size, other names, code and drawing.
ICON = re.compile(
    r'(?:"([\w-]+)"|(\w+)):\[\d+,\d+,\[[^\]]*\],"[0-9a-f]+",(?:"[^"]*"|\[[^\]]*\])\],?'
)
NAMED = re.compile(r"\bfa-([a-z0-9-]+)")
# The coordinates of a drawing, and a number with more than one decimal.
COORDINATES = re.compile(r'(?<= )(d|x|y)="[^"]*"')
FINE = re.compile(r"-?\d+\.\d{2,}")
DRAWING = re.compile(r"<svg .*?</svg>", re.DOTALL)
# The full build: the smaller one loses a page's mathematics at \boldsymbol.
MATHJAX = "tex-svg-full.js"


def mathjax_source() -> Path:
    """Return the installed MathJax script."""
    package = "sphinx-mathjax-offline"
    return Path(
        str(distribution(package).locate_file(f"{package}/static/mathjax/{MATHJAX}"))
    )


def point_to_local_mathjax(app: Sphinx) -> None:
    """Make the pages load the copy below ``_static/``."""
    app.config.mathjax_path = f"mathjax/{MATHJAX}"


def copy_mathjax(app: Sphinx) -> None:
    """Copy the script next to the pages."""
    target = Path(app.outdir) / "_static" / "mathjax" / MATHJAX
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(mathjax_source(), target)


def write_scripts(app: Sphinx) -> None:
    """Write a script with the text of each table, which a page from a disk can save."""
    for path in (Path(app.outdir) / "tables").glob("*.[tjm]*"):
        text = json.dumps(path.read_text(encoding="utf-8"), ensure_ascii=False)
        path.with_name(f"{path.name}.js").write_text(f"rpFile({text});\n", "utf-8")


def only_icons(script: str, used: set[str]) -> str:
    """Return the script of icons with only the used icons.

    >>> only_icons('i={sun:[8,8,[],"f1","M1"],"a-b":[8,8,[1,"c"],"f2",["M","N"]]}', {"sun"})
    'i={sun:[8,8,[],"f1","M1"],}'
    """
    return ICON.sub(
        lambda icon: icon[0] if (icon[1] or icon[2]) in used else "", script
    )


def drop_icons(app: Sphinx) -> None:
    """Keep the icons that pages or other scripts of the theme use."""
    root = Path(app.outdir)
    scripts = root / "_static" / "scripts"
    naming = [*root.rglob("*.html"), *scripts.glob("*sphinx*theme.js")]
    used = {
        name
        for file in naming
        for name in NAMED.findall(file.read_text(encoding="utf-8"))
    }
    theme = "pydata-sphinx-theme"
    source = distribution(theme).locate_file(
        f"pydata_sphinx_theme/theme/pydata_sphinx_theme/static/{ICONS}"
    )
    script = Path(str(source)).read_text(encoding="utf-8")
    (root / "_static" / ICONS).write_text(only_icons(script, used), encoding="utf-8")


def coarser(drawing: str) -> str:
    """Return a drawing with coordinates rounded to 0.1 pt.

    >>> coarser('<svg id="a1.2345"><path d="M 1.23456 -0.00123 L 3.14 2"/></svg>')
    '<svg id="a1.2345"><path d="M 1.2 0 L 3.1 2"/></svg>'
    """
    return COORDINATES.sub(lambda found: FINE.sub(_rounded, found[0]), drawing)


def _rounded(number: re.Match[str]) -> str:
    """Return a number with one decimal at most, without trailing zeros."""
    return f"{float(number[0]):z.1f}".rstrip("0").rstrip(".")


def lighten(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Remove unused scripts from a page, and round its drawings.

    The theme declares thebe twice, which is an error on every page. The downloaded notebook has all
    digits.
    """
    body = context.get("body", "")
    needs_mathjax = 'class="math' in body
    if body:
        # docutils gives the entries of a bibliography an obsolete role.
        body = body.replace('role="doc-biblioentry"', 'role="listitem"')
        context["body"] = DRAWING.sub(lambda found: coarser(found[0]), body)
    for kind in ("script_files", "css_files"):
        context[kind] = [
            asset
            for asset in context.get(kind, [])
            if not is_thebe(asset)
            and (needs_mathjax or MATHJAX not in str(asset.filename))
        ]


def is_thebe(asset: Any) -> bool:
    """Return whether a script or a style sheet belongs to thebe."""
    body = getattr(asset, "attributes", {}).get("body") or ""
    return "thebe" in str(getattr(asset, "filename", "") or "") or "THEBE" in body


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers; `lighten` goes after the extension that adds thebe."""
    app.connect("builder-inited", point_to_local_mathjax)
    app.connect("html-page-context", lighten, priority=901)
    for write in (copy_mathjax, drop_icons, write_scripts):
        after_build(app, write)
    return SAFE
