"""Sphinx extension: read and write the pages on every core, which Jupyter Book has no option for.

Of the extensions that Jupyter Book loads two do not say whether they allow it; they change the book
only after all pages are read, so they do. The written pages are the same either way.
"""

import os

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

UNDECLARED = ("sphinx_jupyterbook_latex", "sphinx_multitoc_numbering")


def use(app: Sphinx) -> None:
    """Allow as many processes as there are cores for this one."""
    for name in UNDECLARED:
        app.extensions[name].parallel_read_safe = True
    available = getattr(os, "sched_getaffinity", None)
    app.parallel = len(available(0)) if available else os.cpu_count() or 1


def drop_unused(app: Sphinx, env: BuildEnvironment) -> None:
    """Leave out modules of which no page shows anything, as reading page by page does."""
    modules = getattr(env, "_viewcode_modules", {})
    for name in [name for name, entry in modules.items() if entry and not entry[2]]:
        del modules[name]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("builder-inited", use)
    app.connect("env-updated", drop_unused)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
