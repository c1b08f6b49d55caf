"""The sources of the book in version 2 of Jupyter Book."""

import html
import json
import re
import shutil
import subprocess

import pytest
import yaml

import build_book

pytestmark = pytest.mark.browser
BOOK = build_book.ROOT / "book"
ROLE = re.compile(r"\{(fact|printed|computed|verdict)\}`([^`]+)`")
NUMBER = re.compile(r'<span class="rp-fact">(.*?)</span>')
UNKNOWN = re.compile(r"unknown (?:directive|role): [\w:-]+")
# Directives of Sphinx and of the extensions, which the plugin does not have.
MISSING = {f"unknown directive: {name}" for name in ("eval-rst", "moved", "questions")}


def test_every_page_has_its_numbers_in_version_2(tmp_path):
    """Version 2 builds all sources, and the sentences contain the facts in order."""
    if not shutil.which("npm"):
        pytest.skip("no npm on the PATH: version 2 of Jupyter Book is not tested")
    built = shutil.ignore_patterns("html", ".jupyter_cache", "jupyter_execute")
    shutil.copytree(BOOK, tmp_path, ignore=built, dirs_exist_ok=True)
    version2 = build_book.ROOT / "tools" / "version2"
    shutil.copytree(version2, tmp_path, dirs_exist_ok=True)
    subprocess.run(["npm", "ci", "--silent"], cwd=tmp_path, check=True, timeout=300)
    run = subprocess.run(
        [tmp_path / "node_modules" / ".bin" / "myst", "build", "--html"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr
    assert set(UNKNOWN.findall(run.stdout + run.stderr)) == MISSING

    facts = json.loads((BOOK / "_build" / "facts.json").read_text(encoding="utf-8"))
    toc = yaml.safe_load((BOOK / "_toc.yml").read_text(encoding="utf-8"))
    chapters = [c for part in toc["parts"] for c in part["chapters"]]
    names = [toc["root"], *re.findall(r"'file': '([^']+)'", str(chapters))]
    for name in names:
        source = (BOOK / f"{name}.md").read_text(encoding="utf-8")
        expected = [
            facts[text if role == "fact" else f"{text} {role}"]
            for role, text in ROLE.findall(source)
        ]
        folder = re.sub(r"(^|/)index$", "", name)
        page = tmp_path / "_build" / "html" / folder / "index.html"
        shown = NUMBER.findall(page.read_text(encoding="utf-8"))
        assert [html.unescape(number) for number in shown] == expected, name
