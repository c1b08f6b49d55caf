"""Sphinx extension: a notebook with the same text as the page, for each page with code.

Jupyter Book stores the executed notebooks with the sources of their sentences. Here roles become
text: computed numbers, equation numbers and links to the other notebooks. The notebooks are written
to ``_build/notebooks`` and next to the sources of the pages, for the button of the theme.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

import nbformat
from docutils import nodes
from jupyter_cache import get_cache
from sphinx.application import Sphinx

from after_build import SAFE, after_build
from equation_numbers import printed_number
from fact_roles import FILE, facts, name_of
from reproduce.version import ADDRESS, __version__

FOLDER = "notebooks"
WHEEL = "reproduce_pointing-{}-py3-none-any.whl"
CACHE = ".jupyter_cache"
# The first cell of a notebook, which needs the package. It is not in an index of packages.
INSTALL = """\
# This notebook needs the package of the book. Without it, this cell installs its wheel{place}.
from importlib.util import find_spec

if find_spec("reproduce") is None:
    %pip install --quiet {wheel}"""
ROLE = re.compile(r"\{(?P<role>[a-z:]+)\}`(?P<text>[^`]+)`")
TITLED = re.compile(r"(?P<title>.+?)\s*<(?P<target>[^>]+)>")
# A target, the label of a formula, and a directive: colons or backticks, name, title and body.
TARGET = re.compile(r"^\([^()\n]+\)=\n", re.MULTILINE)
LABEL = re.compile(r"^\$\$ \((?P<label>[\w-]+)\)$", re.MULTILINE)
DIRECTIVE = re.compile(
    r"^(?P<fence>:::|```)\{(?P<kind>\w+)\} *(?P<title>.*)\n"
    r"(?::[\w-]+:.*\n)*(?P<body>(?:.*\n)*?)(?P=fence)$",
    re.MULTILINE,
)
ADMONITIONS = {"admonition": "", "note": "Note", "warning": "Warning"}
Spoken = Callable[[str, str], str]


def plain(text: str, spoken: Spoken, number: Callable[[str], str]) -> str:
    r"""Return the Markdown of a cell without roles, directives and targets of the book.

    >>> plain("We get {computed}`a`.", lambda role, text: f"{role} {text}", str)
    'We get computed a.'
    >>> plain("(label)=\n# Title", lambda role, text: text, str)
    '# Title'
    >>> print(plain("$$\nx = 1\n$$ (niu2024-17)", lambda role, text: text, lambda label: "17"))
    $$
    x = 1
    \tag{17}
    $$
    >>> print(plain(":::{admonition} Mind\n:class: x\nBeware.\n:::", lambda role, text: text, str))
    > **Mind**
    >
    > Beware.
    """
    text = DIRECTIVE.sub(_quoted, TARGET.sub("", text))
    text = LABEL.sub(lambda found: f"\\tag{{{number(found['label'])}}}\n$$", text)
    return ROLE.sub(lambda found: spoken(found["role"], found["text"]), text).strip(
        "\n"
    )


def _quoted(directive: re.Match[str]) -> str:
    """Return an admonition as a quotation with its title, or the text of a wrapper."""
    if directive["kind"] == "div":
        return directive["body"].removesuffix("\n")
    named = ADMONITIONS[directive["kind"]]
    title = directive["title"] or named
    lines = [f"**{title}**", "", *directive["body"].splitlines()]
    return "\n".join(f"> {line}".rstrip() for line in lines)


def spoken_in(app: Sphinx, page: str) -> Spoken:
    """Return the function that converts the roles of a page to text."""
    path = Path(app.srcdir) / FILE
    known = facts(path, path.stat().st_mtime)
    prefixes = app.config.equation_prefixes

    def spoken(role: str, text: str) -> str:
        titled = TITLED.fullmatch(text)
        title, target = (titled["title"], titled["target"]) if titled else ("", text)
        if role in ("printed", "computed", "verdict", "fact"):
            return known[name_of(role, text)]
        if role == "eq":
            return f"({printed_number(target, prefixes)})"
        if role == "doc":
            return _link(app, page, title, target)
        if role.startswith("cite"):
            return f"[{', '.join(key.strip() for key in text.split(','))}]"
        short = target.rpartition(".")[2] if target[:1] == "~" else target
        return title or f"`{short.lstrip('!')}`"

    return spoken


def _link(app: Sphinx, page: str, title: str, target: str) -> str:
    """Return a link to another notebook, or its title if the page has no code."""
    name = normpath(join("/", dirname(page), target)).lstrip("/")
    words = title or app.env.titles[name].astext()
    if not executed(app, name).is_file():
        return f"*{words}*"
    return f"[{words}]({'../' * page.count('/')}{name}.ipynb)"


def executed(app: Sphinx, page: str) -> Path:
    """Return the path of the executed notebook of a page."""
    return Path(app.outdir).parent / "jupyter_execute" / f"{page}.ipynb"


def is_notebook(app: Sphinx, page: str) -> bool:
    """Return whether a page has code."""
    if page not in app.env.found_docs:
        return False
    with Path(app.env.doc2path(page)).open(encoding="utf-8") as source:
        return source.read(30).startswith("---\nfile_format: mystnb\n")


def written(app: Sphinx, page: str) -> str:
    """Return the text of the notebook of a page."""
    text = executed(app, page).read_text(encoding="utf-8")
    notebook: Any = nbformat.reads(text, as_version=4)  # type: ignore[no-untyped-call]  # nbformat has no types
    # The outputs of the cells are in the cache of Jupyter Book.
    kept = get_cache(
        app.config.nb_execution_cache_path or Path(app.outdir).parent / CACHE
    )
    _, notebook = kept.merge_match_into_notebook(notebook)
    spoken, prefixes = spoken_in(app, page), app.config.equation_prefixes
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = plain(
                cell.source, spoken, lambda label: str(printed_number(label, prefixes))
            )
        elif "hide-input" in cell.metadata.get("tags", []):
            cell.metadata["jupyter"] = {"source_hidden": True}
    install: Any = nbformat.v4.new_code_cell(install_code())  # type: ignore[no-untyped-call]  # nbformat has no types
    notebook.cells = [install, *(one for one in notebook.cells if one.source.strip())]
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"  # those of MyST are random
    notebook.metadata = {"kernelspec": notebook.metadata["kernelspec"]}
    nbformat.validate(notebook)
    return json.dumps(notebook, ensure_ascii=False, indent=1) + "\n"


def install_code() -> str:
    """Return the code that installs the wheel of the book, if there is no package."""
    name = WHEEL.format(__version__)
    if ADDRESS:
        return INSTALL.format(place="", wheel=f"{ADDRESS}/downloads/{name}")
    place = ", which\n# the page 'Installation and reruns' contains and you save next to this file"
    return INSTALL.format(place=place, wheel=f"./{name}")


def offer(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Add the notebook to the download button of the theme."""
    if doctree is not None and is_notebook(app, page):
        context["ipynb_source"] = f"{page}.ipynb"


def write(app: Sphinx) -> None:
    """Write all notebooks, next to the sources of the pages and to a separate folder."""
    folder = Path(app.outdir).parent / FOLDER
    shutil.rmtree(folder, ignore_errors=True)
    for page in sorted(app.env.found_docs):
        if is_notebook(app, page):
            text = written(app, page)
            for root in (folder, Path(app.outdir) / "_sources"):
                path = root / f"{page}.ipynb"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers; the offer goes before the theme makes its buttons."""
    app.connect("html-page-context", offer, priority=400)
    after_build(app, write)
    return SAFE
