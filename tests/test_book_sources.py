"""The sources of the book: every item shown once, and no number typed into a sentence."""

import re

from places import ROOT
from sphinx_external_toc.parsing import parse_toc_yaml

from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computations, item_text
from reproduce.printed.cells import PAPERS, library
from reproduce.views._verdicts import facts_of
from reproduce.views.figure import drawable

BOOK = ROOT / "book"
PATHS = [p for p in BOOK.rglob("*.md") if not {"_build", "_extra"} & set(p.parts)]
PAGES = {
    path.relative_to(BOOK).with_suffix("").as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(PATHS)
}
UNITS = (
    "px|pixels?|mm|µm|um|nm|cm|km|m|metres?|arcsec(?:onds?)?|deg(?:rees?)?|°|″|rad|mrad|µrad|"
    "Hz|ms|s|min|minutes?|seconds?|%|percent|per cent"
)
TYPED = re.compile(rf"\d+[.,]\d+|\d+\s?(?:{UNITS})(?![\w-])")
COUNTS = (
    "two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|thirty|forty|fifty|"
    "sixty|seventy|eighty|ninety"
)
FRACTIONS = (
    "half|thirds?|quarters?|fifths?|sixths?|eighths?|tenths?|twentieths?|fiftieths?"
)
MEASURES = (
    "seconds? of arc|arc ?seconds?|micrometres?|milli\\w+|pixels|per ?cent|degrees"
)
# A number in words, such as "one experiment in a hundred", "a twentieth of the value", "ten times
# slower", "three of ten". Small counts, and multiples of a standard deviation, are words.
SPELLED = re.compile(
    r"\b(?:hundred|thousand|million|billion)s?\b|\ba (?:hundred|thousand|m?b?illion)th\b"
    rf"|\b(?:{COUNTS}) (?:{FRACTIONS})\b|\ba (?:{FRACTIONS})\b(?=\.| of| (?:as|larger|smaller))"
    rf"|\b(?:{COUNTS}) (?:times (?:as|\w+er)|(?:of|in|out of) (?:{COUNTS}))\b"
    rf"|\bone \w+ in (?:{COUNTS})\b(?! \w)|\bmore than a tenth\b|\bfactor of (?:{COUNTS})\b"
    rf"|\b(?:{COUNTS})s?\b[\w ]{{0,9}}\b(?:{MEASURES})\b",
    re.IGNORECASE,
)
HIDDEN = (
    r"\A---\n.*?\n---\n",
    r"(?m)^(`{3,}|:{3,})\{?(code|code-cell|eval-rst|math|bibliography)[\s\S]*?^\1\s*$",
    r"(?m)^```\w*\n[\s\S]*?^```\s*$",
    r"\$\$[\s\S]*?\$\$(?: ?\([\w-]+\))?",
    r"(?<!\\)\$[^$\n]+\$",
    r"\{[\w:+-]+\}`[^`]*`",
    r"`[^`\n]*`",
    r"(?<=\])\([^)\s]*\)",
    r"<https?://[^>]*>",
    r"(?m)<!--[\s\S]*?-->|^%.*$",
)
TYPED_TEXTS = "It is 0.0726 now.|about 4 px|44.6″|12 arcsec off|99 % of all|5mm"
SPELLED_TEXTS = (
    "one experiment in a hundred|a twentieth of the value|about four hundred stars"
    "|three of ten stars|ten times slower|four times as many|some five pixels"
    "|more than a tenth. Then|hundreds of kelvins|by a factor of two|one star in twenty"
)
ALLOWED_TEXTS = (
    "See Table 3 and equation (17).",
    "$x = 0.5$ px",
    "{printed}`niu2024/table-3#scale.red` off",
    "`0.5 px`",
    "four of 8 cells",
    "```python\nx = 0.5\n```",
    "$$\nx = 0.5\n$$ (niu2024-1)",
    "Version [2](x-2.0.html) of 2024",
    "Three standard deviations of the two papers in three colours. A third angle.",
    "{fact}`constant#central` of the draws",
)
# A table, a figure or an equation of a paper by its number.
NUMBERED = re.compile(r"\b(?:Table|Figure|equation) \(?\d+[a-d]?\)?")
BLANK = re.compile(r"\{([^{}]*)\}")


def prose(text):
    """Return a page without front matter, code, mathematics, roles, links and comments."""
    for pattern in HIDDEN:
        text = re.sub(pattern, "", text, flags=re.DOTALL if "---" in pattern else 0)
    return text


def test_no_number_is_typed_or_spelled_out_in_a_sentence():
    """A number of a sentence is a fact, named constants included."""
    for page, text in PAGES.items():
        words = " ".join(prose(text).split())
        assert TYPED.findall(words) == [], page
        spelled = [match[0] for match in SPELLED.finditer(words)]
        assert spelled == [], page
    for pattern, texts in ((TYPED, TYPED_TEXTS), (SPELLED, SPELLED_TEXTS)):
        assert all(pattern.search(prose(text)) for text in texts.split("|"))
        assert not any(pattern.search(prose(text)) for text in ALLOWED_TEXTS)


def calls(function):
    """Return the keys that the cells of the book show with a function of the package.

    The first page may repeat a figure of a chapter.
    """
    pattern = re.compile(rf"^rp\.{function}\(\s*\"([^\"]+)\"\)$", re.MULTILINE)
    shown = [key for page in sorted(PAGES) for key in pattern.findall(PAGES[page])]
    first = [key for key in pattern.findall(PAGES["index"]) if shown.count(key) == 2]
    return [key for key in shown if key not in first] + first


def test_every_item_table_and_drawing_is_shown_exactly_once():
    figures = calls("figure")
    assert sorted(figures) == sorted(drawable())
    others = [key for key in figures if key not in {*library(), *catalogue("drawings")}]
    assert sorted(calls("table") + others) == sorted(
        [*catalogue(), *catalogue("studies")]
    )
    for (
        page,
        text,
    ) in PAGES.items():  # strong agreement is counted next to weak agreement
        counts = [
            set(re.findall(rf"{{fact}}`(\S+) {k}`", text)) for k in ("strong", "weak")
        ]
        assert counts[0] == counts[1], page


def test_pages_call_the_public_api_in_visible_cells():
    """A folded cell shows its picture or table first, and its code below."""
    for page, text in PAGES.items():
        # Without this front matter a page is not executed.
        notebook = text.startswith("---\nfile_format: mystnb\n")
        assert notebook or "{code-cell}" not in text, page
        tags = re.findall(
            r"^:tags: \[(.*(?:remove-|hide-input|hide-cell).*)", text, re.M
        )
        assert all(tag.startswith("hide-input, code-below") for tag in tags), page
        assert not re.search(r"^(from|import) reproduce\.views", text, re.M), page


def test_alternative_texts_are_sentences_with_facts():
    """A blank names a cell or an item and its property, or a fact of the drawing."""
    for key in drawable():
        figure = item_text(key)
        assert len(BLANK.sub("", figure.alternative).split()) >= 15, key
        assert figure.caption, key
        text = f"{figure.alternative} {figure.caption}"
        words = NUMBERED.sub("", BLANK.sub("", text))
        assert not re.search(r"\d", words), key
        assert not SPELLED.search(words), key
        for name, _, what in (blank.partition(" ") for blank in BLANK.findall(text)):
            assert not what or facts_of(name), (key, name)


def test_every_page_is_in_the_contents_and_every_module_of_physics_documented():
    assert set(parse_toc_yaml(BOOK / "_toc.yml")) == set(PAGES)
    api = "".join(text for page, text in PAGES.items() if page.startswith("api/"))
    folder = BOOK.parent / "src" / "reproduce" / "physics"
    modules = {
        ".".join(["reproduce.physics", *path.relative_to(folder).with_suffix("").parts])
        for path in folder.rglob("[!_]*.py")
    }
    assert len(modules) > 10
    assert modules <= set(re.findall(r"automodule:: (\S+)", api))


def test_a_chapter_has_one_name():
    """As page, as module of its numbers, as group of quoted numbers, and as test.

    The second entries test chapters without an own test.
    """
    for paper in PAPERS:
        pages = {path.stem for path in (BOOK / paper).glob("*.md")}
        # The whole paper, a user's stars, and the questions to the authors.
        chapters = pages - {"index", "context", "own", "letter"}
        keys = [key for key in catalogue() if key.startswith(paper)]
        functions = [one.function for key in keys for one in computations(key)]
        modules = {one.__module__.rpartition(".")[2] for one in functions}
        folder = BOOK.parent / "tests/papers" / paper
        tests = {path.stem.removeprefix("test_") for path in folder.glob("test_*.py")}
        assert modules | tests <= chapters
        groups = {k.partition("/text-")[2] for k in library() if k.startswith(paper)}
        # Several chapters use the numbers of the hardware, and none computes them.
        assert groups <= chapters | {"context", "hardware", ""}
