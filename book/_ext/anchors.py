"""Sphinx extension: links to a table, a cell or an erratum find the page that holds it.

What a cell of a notebook shows, such as the wall of all printed numbers, links to ``#anchor``. On a
page that has no such anchor the link is turned into one to the page that has it. ``#tables/x.csv``
is a file below the root of the site. `goto.html#anchor` leads to the page of an anchor, and where a
page has become a part of another its old address leads there.
"""

import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

HELD = re.compile(r'\bid="([^"]+)"')
LINK = re.compile(r'\bhref="#([^"]+)"')
GOTO = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>To a printed number</title>
<p>It stands on a page of <a href="index.html">the book</a>.</p>
<script>
  const places = PLACES, name = location.hash.slice(1), page = places[name];
  if (Object.hasOwn(places, name)) location.replace(`${page}.html${location.hash}`);
</script></html>
"""
# Pages that are sections now.
MOVED = dict.fromkeys(
    (f"posteriors/diagnostics-{paper}" for paper in ("niu2024", "chen2023")),
    "posteriors/diagnostics",
)
LED = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Moved</title>
<meta http-equiv="refresh" content="0; url={0}"><p>Now at <a href="{0}">{0}</a>.</p></html>
"""


def collect(app: Sphinx, doctree: nodes.document) -> None:
    """Note which anchors the outputs of a page hold."""
    page = app.env.docname
    drop(app, app.env, page)
    for output in doctree.findall(nodes.raw):
        for name in HELD.findall(output.astext()):
            known(app.env)[name] = page


def known(env: BuildEnvironment) -> dict[str, str]:
    """Return the page of each anchor."""
    return env.domaindata.setdefault("output_anchors", {})


def pages(env: BuildEnvironment) -> dict[str, str]:
    """Return the page of each anchor, equations among them."""
    equations = env.get_domain("math").data["objects"]  # label to page and number
    return {
        f"equation-{label}": page for label, (page, _) in equations.items()
    } | known(env)


def drop(app: Sphinx, env: BuildEnvironment, page: str) -> None:
    """Forget the anchors of a page that is read again or gone."""
    for name in [name for name, holder in known(env).items() if holder == page]:
        del known(env)[name]


def merge(
    app: Sphinx, env: BuildEnvironment, pages: set[str], other: BuildEnvironment
) -> None:
    """Take over what a parallel reader found."""
    known(env).update(
        {name: page for name, page in known(other).items() if page in pages}
    )


def lead(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Turn links to anchors of other pages into links to these pages."""
    body = context.get("body", "")
    here, held = set(HELD.findall(body)), pages(app.env)

    def turned(link: re.Match[str]) -> str:
        name = link.group(1)
        if "/" in name:
            return f'href="{"../" * page.count("/")}{name}"'
        holder = held.get(name)
        if name in here or holder in {None, page}:
            return link.group(0)
        return f'href="{app.builder.get_relative_uri(page, holder)}#{name}"'

    if body:
        # docutils gives the entries of a bibliography a role that is no longer in use.
        context["body"] = LINK.sub(turned, body).replace(
            'role="doc-biblioentry"', 'role="listitem"'
        )


def write(app: Sphinx, error: Exception | None) -> None:
    """Write the pages that lead on."""
    if error is not None or app.builder.format != "html":
        return
    root = Path(app.outdir)
    places = json.dumps(known(app.env), ensure_ascii=False)
    (root / "goto.html").write_text(GOTO.replace("PLACES", places), encoding="utf-8")
    for old, new in MOVED.items():
        if new in app.env.found_docs:
            folder, _, name = old.rpartition("/")
            target = f"{new.removeprefix(f'{folder}/')}.html#{name}"
            (root / f"{old}.html").write_text(LED.format(target), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("doctree-read", collect)
    app.connect("env-purge-doc", drop)
    app.connect("env-merge-info", merge)
    app.connect("html-page-context", lead)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
