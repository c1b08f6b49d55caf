"""Print the built book as one PDF, and link it from the first page: ``make pdf``.

The articles of all pages are joined to one document with internal links, and Chromium prints it.
The end of ``book/_static/ledger.css`` contains the style of the paper. Wide tables are rotated or
shrunk here. With the same browser and fonts, equal pages give an equal file.
"""

from __future__ import annotations

import posixpath
import re
import shutil
import sys
from collections.abc import Iterator
from io import BytesIO
from typing import Any

from playwright.sync_api import Page, sync_playwright
from pypdf import PdfReader, PdfWriter
from pypdf.generic import NameObject, TextStringObject

from build_book import ROOT
from reproduce.version import ADDRESS, RELEASED
from reproduce.views.export import DEVELOPERS

HTML = ROOT / "book" / "_build" / "html"
PDF = HTML / "reproduce-book.pdf"
JOINED = HTML.parent / "joined.html"
DAY = f"D:{RELEASED.replace('-', '')}000000Z"  # not the time of printing
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
MISSING = (
    "No Chromium was found: install it (Debian: apt install chromium; elsewhere: "
    ".venv/bin/python -m playwright install chromium)."
)

LINK = f'<li><p><a class="reference external" href="{PDF.name}">Print it (PDF)</a></p></li>\n'
LINKS = re.compile(r'(class="rp-links.*?)(?=</ul>)', re.DOTALL)
# The menu of every page is the table of contents: captions of parts, and pages.
MENU = re.compile(r'<p aria-level="2" class="caption".*?(?=</div>\s*</nav>)', re.DOTALL)
ENTRY = re.compile(r'class="caption-text">(.*?)</span>|href="([^"#]+)"')
STATIC = re.compile(r'"(\.\./)*_static')
ARTICLE = re.compile(r"<article[^>]*>(.*?)(?:<script[^>]*>.*?)?</article>", re.DOTALL)
TITLE = re.compile(r"<h[12]>(.*?)<a ", re.DOTALL)
ASSET = re.compile(
    r'<link rel="stylesheet"[^>]*>|<link [^>]*rel="stylesheet" />'
    r"|<script>window\.MathJax.*?</script>|<script[^>]*/mathjax/[^>]*></script>"
)
TAG = re.compile(r"<[a-zA-Z][^>]*>")
PLACE = re.compile(r'(\s(?:id|for|(?:xlink:)?href)="|url\(#)([^")]*)("|\))')
HEADING = re.compile(r"(?<=<)(/?)h([1-5])\b")

# Each page has sheets in portrait and landscape format, with its title at the top.
SHEETS = """@page p{0} {{ @top-right {{ content: "{1}" }} }} .p{0} {{ page: p{0} }}
@page t{0} {{ size: A4 landscape; @top-right {{ content: "{1}" }} }}
.p{0} .rp-turned {{ page: t{0} }}
"""
JOIN = """<!DOCTYPE html><html lang="en" data-theme="light"><head><meta charset="utf-8">
<title>{}</title>{}<style>{}</style></head><body class="rp-joined bd-content">{}</body></html>"""
# A table wider than the text is rotated. A table wider than the rotated sheet is shrunk, and its
# words are broken. Links to hidden elements are removed.
FIT = """() => {
  const tables = [...document.querySelectorAll("article table")];
  for (const [width, kind] of [["17.6cm", "rp-turned"], ["26.3cm", "rp-tight"]]) {
    document.body.style.width = width;
    const edge = document.body.getBoundingClientRect().right + 1;
    const wide = tables.filter((table) => table.getBoundingClientRect().right > edge);
    for (const table of wide) table.classList.add("rp-turned", kind);
  }
  document.body.style.width = "";
  for (const table of tables) table.classList.toggle("rp-short", table.offsetHeight < 500);
  for (const link of document.querySelectorAll('a[href^="#"]')) {
    const place = document.getElementById(link.getAttribute("href").slice(1));
    if (place && !place.checkVisibility()) link.removeAttribute("href");
  }
}"""
NUMBER = """(sheets) => {
  for (const link of document.querySelectorAll("nav a"))
    link.dataset.page = 1 + sheets["/" + link.hash.slice(1)];
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
    """

    def place(found: re.Match[str]) -> str:
        before, value, after = found.groups()
        if "href" not in before:
            return before + name(page, value) + after
        path, _, mark = value.partition("#")
        target = (
            posixpath.normpath(posixpath.join(posixpath.dirname(page), path))
            if path
            else page
        )
        if target in pages:
            value = f"#{name(target, mark)}"
        elif ":" not in path:  # a file next to the pages
            value = ADDRESS and f"{ADDRESS}/{target}"
        return before + value + after if value else ""

    return TAG.sub(lambda tag: PLACE.sub(place, tag[0]), html)


def joined() -> str:
    """Return the one document: the first page, the contents, and the pages that these name."""
    first = (HTML / "index.html").read_text(encoding="utf-8")
    menu = MENU.findall(first)[0].replace('role="heading"', "")
    entries = ENTRY.findall(menu)
    pages = ["index.html", *(page for _, page in entries if page)]
    contents = f"<nav><h1>Contents</h1>{moved(menu, 'index.html', pages)}</nav>"
    assets, sheets, body, part = dict[str, None](), list[str](), list[str](), ""
    for caption, page in [("", "index.html"), *entries]:
        if caption:
            part = f"<h1>{caption}</h1>"
            continue
        text = (HTML / page).read_text(encoding="utf-8").replace(LINK, "")
        assets |= dict.fromkeys(ASSET.findall(STATIC.sub('"html/_static', text)))
        (article,) = ARTICLE.findall(text)
        sheets.append(
            SHEETS.format(len(body), TITLE.findall(article)[0].replace('"', "”"))
        )
        deeper = HEADING.sub(lambda found: f"{found[1]}h{int(found[2]) + 1}", article)
        body.append(
            f'<article class="bd-article p{len(body)}" id="{name(page)}">'
            f"{part}{moved(deeper, page, pages)}</article>"
        )
        part = ""
    head = TITLE.findall(body[0])[0], "".join(assets), "".join(sheets)
    return JOIN.format(*head, "\n".join([body[0], contents, *body[1:]]))


def set_joined(page: Page) -> None:
    """Load the joined document with the layout for paper."""
    page.emulate_media(media="print")
    page.goto(JOINED.as_uri())
    page.evaluate("() => MathJax.startup.promise")
    page.evaluate(FIT)


def printed(page: Page) -> PdfWriter:
    """Return the joined document as a PDF, with the page numbers of a first print in its contents.

    Chromium duplicates some titles of the outline, and loses spaces at line breaks of a title.
    """

    def once() -> BytesIO:
        return BytesIO(page.pdf(prefer_css_page_size=True, outline=True, tagged=True))

    first = PdfReader(once())
    places = first.named_destinations.items()
    page.evaluate(
        NUMBER, {at: first.get_destination_page_number(place) for at, place in places}
    )
    pdf = PdfWriter(clone_from=once())
    for entry, title in zip(flat(pdf.outline), page.evaluate(TITLES), strict=True):
        entry.node[NameObject("/Title")] = TextStringObject(title)
    pdf.add_metadata({"/Author": DEVELOPERS, "/CreationDate": DAY, "/ModDate": DAY})
    return pdf


def flat(outline: Any) -> Iterator[Any]:
    """Yield the entries of an outline, in order."""
    for entry in outline:
        yield from flat(entry) if isinstance(entry, list) else [entry]


def main() -> None:
    """Write the PDF, and link it from the first page."""
    JOINED.write_text(joined(), encoding="utf-8")
    with sync_playwright() as playwright:
        known = (*BROWSERS, playwright.chromium.executable_path)
        path = next(filter(None, map(shutil.which, known)), None) or sys.exit(MISSING)
        browser = playwright.chromium.launch(executable_path=path)
        page = browser.new_context(offline=True).new_page()
        set_joined(page)
        printed(page).write(PDF)
        browser.close()
    index = HTML / "index.html"
    text = index.read_text(encoding="utf-8").replace(LINK, "")
    index.write_text(
        LINKS.sub(lambda links: links[1] + LINK, text, count=1), encoding="utf-8"
    )
    print(f"The book as a PDF: {PDF}")


if __name__ == "__main__":
    main()
