"""Report words that readers outside the project do not understand: part of ``make check``.

`tools/language.toml` contains the patterns. Pages, and docstrings and strings of the package, must
have no finding. All texts together may have `MAX_RATE` findings per 10,000 words.
``python tools/check_language.py --commit FILE`` checks the subject of a commit.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
RULES = tomllib.loads(Path(__file__).with_name("language.toml").read_text("utf-8"))[
    "rule"
]
MAX_RATE = 15.0
STRICT = {"page", "string"}
PATHS = """README.md CONTRIBUTING.md CHANGELOG.md book data/captions data/README.md data/errata.toml
data/letters.toml data/verdicts.toml src tools tests benchmarks""".split()
SKIPPED = {"_build", "_extra", "__pycache__"}
# Tables of texts; other TOML files contain numbers and settings.
CAPTIONS = re.compile(r"captions/|errata|letters|verdicts")
SETTING = re.compile(r"^(?:cells|relations|id|equations|found_by|formula)\b.*$", re.M)
FRONT_MATTER = re.compile(r"\A---\n.*?\n---\n", re.S)
CODE = re.compile(
    r"^```(?!\{(?:note|admonition|div)).*?^```$|^\$\$.*?^\$\$.*?$", re.S | re.M
)
PROMPT = re.compile(r"^(?:>>>|\.\.\.).*$", re.M)
INLINE = re.compile(r"\{[\w:]+\}`[^`]*`|`[^`\n]*`|\$[^$\n]*\$|https?://\S+|<[^>\n]*>")


class Text(NamedTuple):
    """A text of a file with its kind and its first line."""

    path: Path
    line: int
    kind: str
    text: str


class Finding(NamedTuple):
    """A match of a rule: place, words and suggestion."""

    place: str
    words: str
    use: str
    kind: str


def masked(pattern: re.Pattern[str], text: str) -> str:
    """Replace matches by marks, and keep the line breaks."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", "\x01", match[0]), text)


def texts_of_python(path: Path, source: str) -> Iterator[Text]:
    """Yield the strings of a module, which include its docstrings, and its comments."""
    kind = "string" if "src" in path.parts else "other string"
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and len(str(node.value).split()) > 2:
            text = masked(PROMPT, inspect.cleandoc(str(node.value)))
            yield Text(path, node.lineno, kind, text)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield Text(path, token.start[0], "comment", token.string.lstrip("#! "))


def texts(paths: Iterable[Path]) -> Iterator[Text]:
    """Yield the texts of files and of all files below folders."""
    for start in paths:
        for path in [start] if start.is_file() else sorted(start.rglob("*.*")):
            if SKIPPED & set(path.parts) or path.suffix not in {".md", ".py", ".toml"}:
                continue
            text = path.read_text(encoding="utf-8")
            if path.suffix == ".py":
                yield from texts_of_python(path, text)
            elif path.suffix == ".md":
                kind = "changelog" if path.name == "CHANGELOG.md" else "page"
                yield Text(path, 1, kind, masked(CODE, masked(FRONT_MATTER, text)))
            elif CAPTIONS.search(path.as_posix()):
                yield Text(path, 1, "caption", SETTING.sub("", text))


def findings(text: Text) -> Iterator[Finding]:
    """Yield the matches of the rules in a text."""
    words = masked(INLINE, text.text)
    general = [] if text.kind == "commit" else [text.kind]
    for rule in RULES:
        if text.kind in rule.get("kinds", general):
            for match in re.finditer(rule["find"], words, re.M):
                line = text.line + words.count("\n", 0, match.start())
                found = " ".join(match[0].split())
                yield Finding(f"{text.path}:{line}", found, rule["use"], text.kind)


def check_commit(message: Path) -> int:
    """Print the findings in the subject of a commit, and return the exit code."""
    subject = message.read_text(encoding="utf-8").partition("\n")[0]
    found = list(findings(Text(message, 1, "commit", subject)))
    for finding in found:
        print(f"{subject!r}: {finding.use}")
    return int(bool(found))


def main(paths: list[Path]) -> int:
    """Print the findings of the texts, and return the exit code."""
    every = list(texts(paths or [ROOT / name for name in PATHS]))
    found = [finding for text in every for finding in findings(text)]
    for finding in found:
        print(f"{finding.place}: {finding.words} -> {finding.use}")
    words = sum(len(re.findall(r"[^\W\d_]+", text.text)) for text in every)
    rate = 1e4 * len(found) / max(words, 1)
    strict = sum(finding.kind in STRICT for finding in found)
    print(
        f"{len(found)} findings, {rate:.1f} per 10,000 words; {strict} in strict texts"
    )
    return int(strict > 0 or rate > MAX_RATE)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--commit"]:
        sys.exit(check_commit(Path(sys.argv[2])))
    sys.exit(main([Path(name) for name in sys.argv[1:]]))
