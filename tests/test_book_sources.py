"""The book's sources: every item shown once, and no number typed into a sentence."""

import re
from pathlib import Path

import pytest
import yaml

from reproduce.papers.catalogue import catalogue, drawings, studies
from reproduce.papers.declare import item_text
from reproduce.printed.cells import library
from reproduce.views.figure import drawable

BOOK = Path(__file__).parent.parent / "book"
PAGES = sorted(p for p in BOOK.rglob("*.md") if not {"_build", "_extra"} & set(p.parts))
UNITS = (
    "px|pixels?|mm|µm|um|nm|cm|km|m|metres?|arcsec(?:onds?)?|deg(?:rees?)?|°|″|rad|mrad|µrad|"
    "Hz|ms|s|min|minutes?|seconds?|%|percent|per cent"
)
TYPED = re.compile(rf"\d+[.,]\d+|\d+\s?(?:{UNITS})(?![\w-])")


def prose(text):
    """Return a page without front matter, code, mathematics, roles, links and comments."""
    text = re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.DOTALL)
    text = re.sub(
        r"^(`{3,}|:{3,})\{?(code|code-cell|eval-rst|math|bibliography)[\s\S]*?^\1\s*$",
        "",
        text,
        flags=re.MULTILINE,
    )
    text = re.sub(r"^```\w*\n[\s\S]*?^```\s*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"\$\$[\s\S]*?\$\$(?: ?\([\w-]+\))?", "", text)
    text = re.sub(r"(?<!\\)\$[^$\n]+\$", "", text)
    text = re.sub(r"\{[\w:+-]+\}`[^`]*`", "", text)
    text = re.sub(r"`[^`\n]*`", "", text)
    text = re.sub(r"\]\([^)\s]*\)", "]", text)
    text = re.sub(r"<https?://[^>]*>", "", text)
    return re.sub(r"<!--[\s\S]*?-->|^%.*$", "", text, flags=re.MULTILINE)


def test_no_number_is_typed_into_a_sentence():
    """A number of a sentence is taken from the ledger, with a role."""
    for path in PAGES:
        text = prose(path.read_text(encoding="utf-8"))
        assert TYPED.findall(text) == [], path


def test_what_agrees_in_substance_stands_beside_what_agrees_weakly():
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        found = (re.findall(rf"\{{fact}}`(\S+) {k}`", text) for k in ("strong", "weak"))
        assert set(next(found)) == set(next(found)), path


def test_typed_numbers_are_seen_in_sentences_only():
    typed = "It is 0.0726 now.|about 4 px|44.6″|12 arcsec off|99 % of all|5mm"
    for sentence in typed.split("|"):
        assert TYPED.search(prose(sentence)), sentence
    for text in (
        "See Table 3 and equation (17).",
        "$x = 0.5$ px",
        "{printed}`niu2024/table-3#scale.red` off",
        "`0.5 px`",
        "four of 8 cells",
        "```python\nx = 0.5\n```",
        "$$\nx = 0.5\n$$ (niu2024-1)",
        "Version [2](x-2.0.html) of 2024",
    ):
        assert not TYPED.search(prose(text)), text


def calls(function):
    """Return the keys that the book's cells show with a function: first arguments of its calls."""
    pattern = re.compile(rf"^rp\.{function}\(\s*\"([^\"]+)\"\)$", re.MULTILINE)
    return [
        key
        for path in PAGES
        for key in pattern.findall(path.read_text(encoding="utf-8"))
    ]


def test_every_item_and_every_study_is_shown_exactly_once():
    own = [*library(), *drawings()]
    shown = calls("table") + [key for key in calls("figure") if key not in own]
    assert sorted(shown) == sorted([*catalogue(), *studies()])


def test_no_page_hides_its_code_or_calls_a_module_that_exists_for_the_book():
    """What is seen can be copied and run: the front door, and the library's own functions.

    The first page shows its picture first, and the two lines of code folded below it.
    """
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        if path == BOOK / "index.md":
            assert (
                text.count(":tags:")
                == text.count(":tags: [hide-input, code-below]\n")
                == 1
            )
            continue
        assert not re.search(
            r"^:tags: \[.*?(remove-|hide-input|hide-cell)", text, re.M
        ), path.name
        assert not re.search(r"^(from|import) reproduce\.views", text, re.M), path.name


def test_every_drawing_is_shown_exactly_once():
    assert sorted(calls("figure")) == sorted([*drawable(), *drawings()])


NUMBER_WORDS = (
    "two|three|four|five|six|seven|eight|nine|ten|twenty|thirty|forty|fifty|sixty|seventy|eighty|"
    "ninety|hundred|thousand|half|tenth|hundredth|billionth"
)
MEASURES = (
    "seconds? of arc|arc seconds?|micrometres?|milli\\w+|pixels?|per cent|degrees"
)
SPELLED = re.compile(
    rf"\b({NUMBER_WORDS})s?\b[\w ]{{0,9}}\b({MEASURES})\b|\b(factor of|hundred|thousand)\b"
)


# A table, a figure or an equation of a paper by its number.
NAMED = re.compile(r"\b(?:Table|Figure|equation) \(?\d+[a-d]?\)?")


def alternatives():
    """Return every alternative text with its caption: key, text with its blanks."""
    for key in (*drawable(), *drawings()):
        text = item_text(key).figure
        yield key, f"{text.alternative} {text.caption}"


BLANK = re.compile(r"\{([^{}]*)\}")


def test_every_blank_of_an_alternative_text_can_be_filled():
    """A blank names a cell or an item and what of it, or a fact of the drawing: one word."""
    blanks = [
        (page, blank) for page, text in alternatives() for blank in BLANK.findall(text)
    ]
    assert any("#" in blank for _, blank in blanks)
    for page, blank in blanks:
        name, _, what = blank.partition(" ")
        if what:
            item, _, cell = name.partition("#")
            cells = {"", *(cell.name for cell in library()[item].cells)}
            assert cell in cells, f"{page}: {blank}"
        else:
            assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name), f"{page}: {blank}"


def test_no_number_is_typed_into_an_alternative_text():
    texts = list(alternatives())
    assert len(texts) > len(drawable())
    for page, text in ((page, BLANK.sub("", text)) for page, text in texts):
        assert not re.search(r"\d", NAMED.sub("", text)), f"{page}: {text}"
        assert not SPELLED.search(text), f"{page}: {SPELLED.search(text)}"


def test_alternative_texts_say_what_is_drawn():
    """Whoever cannot see a figure gets sentences, not a title."""
    for key in (*drawable(), *drawings()):
        assert len(BLANK.sub("", item_text(key).figure.alternative).split()) >= 15, key
        assert item_text(key).figure.caption, key


def test_every_physics_module_is_documented():
    documented = {
        name
        for path in (BOOK / "api").glob("*.md")
        for name in re.findall(r"automodule:: (\S+)", path.read_text(encoding="utf-8"))
    }
    folder = BOOK.parent / "src" / "reproduce" / "physics"
    modules = {
        ".".join(["reproduce.physics", *path.relative_to(folder).with_suffix("").parts])
        for path in folder.rglob("[!_]*.py")
    }
    assert len(modules) > 10
    assert modules <= documented


def test_every_page_is_in_the_table_of_contents():
    """A page outside it is skipped without a word."""
    text = (BOOK / "_toc.yml").read_text(encoding="utf-8")
    listed = set(re.findall(r"(?:file|root): (\S+)", text))
    assert listed == {p.relative_to(BOOK).with_suffix("").as_posix() for p in PAGES}
    assert yaml.safe_load(text)["format"] == "jb-book"


def test_pages_with_code_are_notebooks():
    """Without this front matter a page is silently not executed."""
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        notebook = text.startswith("---\nfile_format: mystnb\n")
        assert notebook or "{code-cell}" not in text, path


@pytest.mark.parametrize("paper", ["niu2024", "chen2023"])
def test_a_chapter_has_one_name(paper):
    """As page and test, as the module that makes its numbers, and as its group of quoted ones."""
    # The paper as a whole, a reader's own stars, and what we ask the authors.
    other = {"index", "context", "own", "letter"}
    pages = {path.stem for path in (BOOK / paper).glob("*.md")} - other
    made = [
        one
        for key, item in catalogue().items()
        if paper in key
        for one in item.computations
    ]
    tests = {
        path.stem for path in (BOOK.parent / "tests/papers" / paper).glob("test_*.py")
    }
    assert {one.function.__module__.rpartition(".")[2] for one in made} <= pages
    assert {f"test_{name}" for name in pages} == tests
    groups = {
        key.partition("/text-")[2]
        for key in library()
        if key.startswith(f"{paper}/text-")
    }
    # What Section IV-A quotes of the hardware is read by several chapters and computed by none.
    assert sorted(groups - pages - {"context", "hardware"}) == []
