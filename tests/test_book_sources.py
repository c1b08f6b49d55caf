"""The book's sources: every item shown once, and no number typed into a sentence."""

import re
from pathlib import Path

import pytest
import yaml

from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import library
from reproduce.views.figures import drawable

BOOK = Path(__file__).parent.parent / "book"
PAGES = sorted(p for p in BOOK.rglob("*.md") if "_build" not in p.parts)
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


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.relative_to(BOOK).as_posix())
def test_no_number_is_typed_into_a_sentence(path):
    typed = [m.group() for m in TYPED.finditer(prose(path.read_text(encoding="utf-8")))]
    assert typed == [], "take the number from the ledger: pages.glue and {glue:text}"


@pytest.mark.parametrize(
    "sentence", ["It is 0.0726 now.", "about 4 px", "44.6″", "12 arcsec off", "99 % of all", "5mm"]
)
def test_typed_numbers_are_seen(sentence):
    assert TYPED.search(prose(sentence))


@pytest.mark.parametrize(
    "sentence",
    [
        "See Table 3 and equation (17).",
        "$x = 0.5$ px",
        "{glue:text}`a-printed` off",
        "`0.5 px`",
        "four of 8 cells",
        "```python\nx = 0.5\n```",
        "$$\nx = 0.5\n$$ (niu2024-1)",
        "Version [2](x-2.0.html) of 2024",
    ],
)
def test_numbers_outside_sentences_pass(sentence):
    assert not TYPED.search(prose(sentence))


def calls(function):
    """Return the first arguments of all calls of a pages function, over the whole book."""
    pattern = re.compile(rf"pages\.{function}\(\s*\"([^\"]+)\"")
    return [key for path in PAGES for key in pattern.findall(path.read_text(encoding="utf-8"))]


def test_every_item_is_shown_exactly_once():
    shown = calls("table") + [key for key in calls("figure") if key not in library()]
    assert sorted(shown) == sorted(catalogue())


def test_every_drawing_is_shown_exactly_once():
    assert sorted(calls("figure")) == sorted(drawable())


def test_no_number_is_typed_into_an_alternative_text():
    call = re.compile(r"pages\.figure\(\s*\"[^\"]+\",(.*?)\n?\)\n", re.DOTALL)
    for path in PAGES:
        for text in call.findall(path.read_text(encoding="utf-8")):
            assert not re.search(r"\d", text), f"{path.name}: {text}"


def test_every_physics_module_is_documented():
    documented = {
        name
        for path in (BOOK / "api").glob("*.md")
        for name in re.findall(r"automodule:: (\S+)", path.read_text(encoding="utf-8"))
    }
    folder = BOOK.parent / "src" / "reproduce" / "physics"
    modules = {f"reproduce.physics.{path.stem}" for path in folder.glob("[!_]*.py")}
    assert modules <= documented


def test_every_page_is_in_the_table_of_contents():
    """A page outside it is skipped without a word."""
    text = (BOOK / "_toc.yml").read_text(encoding="utf-8")
    listed = set(re.findall(r"(?:file|root): (\S+)", text))
    assert listed == {p.relative_to(BOOK).with_suffix("").as_posix() for p in PAGES}
    assert yaml.safe_load(text)["format"] == "jb-book"


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.relative_to(BOOK).as_posix())
def test_pages_with_code_are_notebooks(path):
    """Without this line of front matter a page is silently not executed."""
    text = path.read_text(encoding="utf-8")
    if "{code-cell}" in text:
        assert text.startswith("---\nfile_format: mystnb\n")
