"""Writers of an extension: they run after all pages are written, if the build had no error."""

from collections.abc import Callable

from sphinx.application import Sphinx

# What the extensions of the book return: they read and write pages in parallel.
SAFE = {"parallel_read_safe": True, "parallel_write_safe": True}


def after_build(
    app: Sphinx, write: Callable[[Sphinx], None], priority: int = 500
) -> None:
    """Call a function after a build of the pages without an error."""

    def finish(app: Sphinx, error: Exception | None) -> None:
        if error is None and app.builder.format == "html":
            write(app)

    app.connect("build-finished", finish, priority=priority)
