"""Print the built book as PDF, and link the files from two pages: ``make pdf``.

The articles of the pages are joined to one document with internal links, and Chromium prints it.
The book contains a title page and all chapters, and a second file the lists of numbers, relations,
errata and functions. Each chapter is also a separate file, cut from the book. The end of
``book/_static/ledger.css`` contains the style of the paper. Wide tables are rotated or shrunk here.
With the same browser and fonts, equal pages give an equal file.
"""

from __future__ import annotations

import posixpath
import re
import shutil
import sys
from collections.abc import Iterator
from io import BytesIO
from typing import Any

from jinja2 import Template
from playwright.sync_api import Page, sync_playwright
from pypdf import PdfReader, PdfWriter
from pypdf.generic import NameObject, TextStringObject

from build_book import ROOT
from reproduce.version import ADDRESS, RELEASED, __version__
from reproduce.views.citations import DEVELOPERS

HTML = ROOT / "book" / "_build" / "html"
PDF, LISTS = HTML / "reproduce-book.pdf", HTML / "reproduce-lists.pdf"
JOINED = HTML.parent / "joined.html"
DAY = f"D:{RELEASED.replace('-', '')}000000Z"  # not the time of printing
ABOUT = {"/Author": DEVELOPERS, "/CreationDate": DAY, "/ModDate": DAY}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
MISSING = (
    "No Chromium was found: install it (Debian: apt install chromium; elsewhere: "
    ".venv/bin/python -m playwright install chromium)."
)

LINK = (
    f'<li><p><a class="reference external" href="{PDF.name}">Read as PDF</a></p></li>\n'
)
LINKS = re.compile(r'(class="rp-links.*?)(?=</ul>)', re.DOTALL)
FILES = re.compile(r'(class="rp-pdfs[^>]*>).*?(?=</div>)', re.DOTALL)
# The pages of the second file.
LISTED = re.compile(r"cells|audit/(relations|errata)|api/")
# The menu of every page is the table of contents: captions of parts, and pages.
MENU = re.compile(r'<p aria-level="2" class="caption".*?(?=</div>\s*</nav>)', re.DOTALL)
ENTRY = re.compile(r'class="caption-text">(.*?)</span>|href="([^"#]+)"')
STATIC = re.compile(r'"(\.\./)*_static')
ARTICLE = re.compile(r"<article[^>]*>(.*?)(?:<script[^>]*>.*?)?</article>", re.DOTALL)
TITLE = re.compile(r"<h[12]>(.*?)<a ", re.DOTALL)
# The abstract: the first paragraph of the first page, and the paragraph with all counts.
ABSTRACT = re.compile(
    r'(<p>.*?</p>)(?:.*id="index:all-printed-numbers".*?(<p>.*?</p>))?', re.DOTALL
)
ASSET = re.compile(
    r'<link rel="stylesheet"[^>]*>|<link [^>]*rel="stylesheet" />'
    r"|<script>window\.MathJax.*?</script>|<script[^>]*/mathjax/[^>]*></script>"
)
TAG = re.compile(r"<[a-zA-Z][^>]*>")
PLACE = re.compile(
    r'(\s(?:id|for|src|(?:xlink:)?href)=["\']|url\(#)([^"\')]*)(["\']|\))'
)
HEADING = re.compile(r"(?<=<)(/?)h([1-5])\b")

# Each part has sheets in portrait and landscape format, with its title at the top.
JOINED_PAGES = Template(
    """<!DOCTYPE html><html lang="en" data-theme="light"><head><meta charset="utf-8">
<title>{{ title }}</title>{{ assets }}<style>{% for caption, pages in parts %}
{% set top = '{ @top-right { content: "' ~ caption ~ '" } }' %}
@page p{{ loop.index }} {{ top }} .p{{ loop.index }} { page: p{{ loop.index }} }
@page t{{ loop.index }} { size: A4 landscape } @page t{{ loop.index }} {{ top }}
.p{{ loop.index }} .rp-turned { page: t{{ loop.index }} }{% endfor %}</style></head>
<body class="rp-joined bd-content"><header class="rp-title"><p>{{ title }}</p>
<p>{{ authors }}</p><p>Version {{ version }}, {{ day }}</p>
{% if abstract %}<p><strong>Abstract</strong></p>{{ abstract }}{% endif %}</header>
<nav><h1>Contents</h1>{% for caption, pages in parts %}<p class="caption">{{ caption }}</p>
<ul>{% for page in pages %}<li><a href="#{{ page.name }}">{{ page.title }}</a></li>{% endfor %}
</ul>{% endfor %}</nav>{% for caption, pages in parts %}{% set part = loop.index %}
{% for page in pages %}
<article class="bd-article p{{ part }}{% if loop.first %} rp-start{% endif %}"
id="{{ page.name }}">{% if loop.first %}<h1>{{ caption }}</h1>{% endif %}{{ page.text }}</article>
{% endfor %}{% endfor %}</body></html>"""
)
# A table a little wider than the text is shrunk, and its words are broken. A wider table is
# rotated, and shrunk if the rotated sheet is too narrow. Links to hidden elements are removed.
FIT = """() => {
  const tables = [...document.querySelectorAll("article table")];
  for (const [width, kind] of [["17.6cm", "rp-turned"], ["26.3cm", "rp-tight"]]) {
    document.body.style.width = width;
    const edge = document.body.getBoundingClientRect().right + 1;
    const wide = tables.filter((table) => table.getBoundingClientRect().right > edge);
    for (const table of wide) {
      const shrinks = kind === "rp-turned" && table.getBoundingClientRect().right < 1.1 * edge;
      table.classList.add(...(shrinks ? ["rp-tight"] : ["rp-turned", kind]));
    }
  }
  document.body.style.width = "17.6cm";
  for (const block of document.querySelectorAll("article :is(table, .cell_input)"))
    block.classList.toggle("rp-short", block.offsetHeight < 250);
  document.body.style.width = "";
  for (const link of document.querySelectorAll('a[href^="#"]')) {
    const place = document.getElementById(link.getAttribute("href").slice(1));
    if (place && !place.checkVisibility()) link.removeAttribute("href");
  }
}"""
NUMBER = """(sheets) => {
  for (const link of document.querySelectorAll("nav a"))
    link.dataset.page = 1 + sheets[link.hash.slice(1)];
}"""
TITLES = """() => [...document.querySelectorAll("h1, h2, h3, h4, h5, h6")]
  .filter((title) => title.checkVisibility()).map((title) => title.innerText.trim())"""


def name(page: str, fragment: str = "") -> str:
    """Return the name of a page, or of an anchor on it, in the joined document.

    >>> name("index.html"), name("audit/errata.html", "entry")
    ('index', 'audit/errata:entry')
    """
    return page.removesuffix(".html") + (fragment and f":{fragment}")


def moved(html: str, page: str, pages: list[str]) -> str:
    """Return the HTML of a page with the names and links of the joined document.

    >>> moved('<a id="x" href="../find.html#y">', "audit/errata.html", ["find.html"])
    '<a id="audit/errata:x" href="#find:y">'
    >>> moved('<img src="../_images/x.png">', "audit/errata.html", [])
    '<img src="html/_images/x.png">'
    """

    def place(found: re.Match[str]) -> str:
        before, value, after = found.groups()
        if "href" not in before and "src" not in before:
            return before + name(page, value) + after
        path, _, mark = value.partition("#")
        target = (
            posixpath.normpath(posixpath.join(posixpath.dirname(page), path))
            if path
            else page
        )
        if "src" in before and ":" not in path:
            value = f"html/{target}"
        elif target in pages:
            value = f"#{name(target, mark)}"
        elif ":" not in path:  # a file next to the pages
            value = ADDRESS and f"{ADDRESS}/{target}"
        return before + value + after if value else ""

    return TAG.sub(lambda tag: PLACE.sub(place, tag[0]), html)


def parts(*, listed: bool = False) -> list[tuple[str, list[str]]]:
    """Return the parts of the book, or of the lists, with their pages in order."""
    first = (HTML / "index.html").read_text(encoding="utf-8")
    found = [("Overview", ["index.html"])]
    for caption, page in ENTRY.findall(MENU.findall(first)[0]):
        if caption:
            found.append((caption, []))
        elif bool(LISTED.match(page)) is listed:
            found[-1][1].append(page)
    return [one for one in found[listed:] if one[1]]


def joined(*, listed: bool = False) -> str:
    """Return the document of the book, or of the lists: title, contents and pages."""
    chapters = parts(listed=listed)
    pages = [page for _, names in chapters for page in names]
    assets, shown = dict[str, None](), {}
    for page in pages:
        text = (HTML / page).read_text(encoding="utf-8").replace(LINK, "")
        # A second print does not contain the links that the first one wrote.
        text = FILES.sub(r"\1", text)
        assets |= dict.fromkeys(ASSET.findall(STATIC.sub('"html/_static', text)))
        (article,) = ARTICLE.findall(text)
        deeper = HEADING.sub(lambda found: f"{found[1]}h{int(found[2]) + 1}", article)
        shown[page] = {
            "name": name(page),
            "title": TITLE.findall(article)[0],
            "text": moved(deeper, page, pages),
        }
    first = shown[pages[0]]
    document: str = JOINED_PAGES.render(
        title="Pointing, reproduced: lists" if listed else first["title"],
        authors=DEVELOPERS,
        version=__version__,
        day=RELEASED,
        abstract="" if listed else "".join(ABSTRACT.findall(first["text"])[0]),
        assets="".join(assets),
        parts=[
            (caption, [shown[page] for page in names]) for caption, names in chapters
        ],
    )
    return document


def set_joined(page: Page) -> None:
    """Load the joined document with the layout for paper."""
    page.emulate_media(media="print")
    page.goto(JOINED.as_uri())
    page.evaluate("() => MathJax.startup.promise")
    page.evaluate(FIT)


def printed(page: Page) -> PdfWriter:
    """Return the joined document as a PDF, with the page numbers of a first print in its contents.

    The first print needs no tags, which take half of the time. Chromium duplicates some titles of
    the outline, and loses spaces at line breaks of a title.
    """
    first = page.pdf(prefer_css_page_size=True)
    page.evaluate(NUMBER, places(PdfReader(BytesIO(first))))
    whole = page.pdf(prefer_css_page_size=True, outline=True, tagged=True)
    pdf = PdfWriter(clone_from=BytesIO(whole))
    for entry, title in zip(flat(pdf.outline), page.evaluate(TITLES), strict=True):
        entry.node[NameObject("/Title")] = TextStringObject(title)
    pdf.add_metadata(ABOUT)
    return pdf


def flat(outline: Any) -> Iterator[Any]:
    """Yield the entries of an outline, in order."""
    for entry in outline:
        yield from flat(entry) if isinstance(entry, list) else [entry]


def places(pdf: PdfReader | PdfWriter) -> dict[str, Any]:
    """Return the sheet of each place, counted from zero."""
    named = pdf.named_destinations.items()
    return {at[1:]: pdf.get_destination_page_number(place) for at, place in named}


def cut(pdf: PdfWriter) -> Iterator[tuple[str, str]]:
    """Write each chapter with a folder as a file, and yield the files with their titles."""
    at, chapters = places(pdf), parts()
    starts = [at[name(pages[0])] for _, pages in chapters]
    for (caption, pages), start, end in zip(
        chapters, starts, [*starts[1:], len(pdf.pages)], strict=True
    ):
        folder, _, page = pages[0].partition("/")
        if page:
            chapter, file = PdfWriter(), f"reproduce-{folder}.pdf"
            chapter.append(PDF, pages=(start, end), import_outline=False)
            chapter.add_metadata({"/Title": caption, **ABOUT})
            chapter.write(HTML / file)
            yield file, caption


def main() -> None:
    """Write the files, and link them from the first page and from the page of the data."""
    with sync_playwright() as playwright:
        known = (*BROWSERS, playwright.chromium.executable_path)
        path = next(filter(None, map(shutil.which, known)), None) or sys.exit(MISSING)
        browser = playwright.chromium.launch(executable_path=path)
        page = browser.new_context(offline=True).new_page()
        for file in (LISTS, PDF):
            JOINED.write_text(joined(listed=file == LISTS), encoding="utf-8")
            set_joined(page)
            pdf = printed(page)
            pdf.write(file)
        browser.close()
    files = [
        (PDF.name, "the book"),
        *cut(pdf),
        (LISTS.name, "numbers, errata, functions"),
    ]
    links = ", ".join(f'<a href="{file}">{text}</a>' for file, text in files)
    for start, pattern, link in (
        ("index.html", LINKS, LINK),
        ("data.html", FILES, f"<p>PDF: {links}.</p>"),
    ):
        text = (HTML / start).read_text(encoding="utf-8").replace(LINK, "")
        linked = pattern.sub(rf"\g<1>{link}", text, count=1)
        (HTML / start).write_text(linked, encoding="utf-8")
    print(f"The book as a PDF: {PDF}")


if __name__ == "__main__":
    main()
