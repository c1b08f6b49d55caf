"""What was built of other files is dropped, and nothing else."""

from pathlib import Path

import pytest

from drop_stale_pages import State

PAGE = "# A title\n\nA sentence.\n\n(label)=\n## A heading\n"
NOTEBOOK, READ, _ = KINDS = (
    ".jupyter_cache/executed",
    ".doctrees/page",
    "html/index.html",
)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with one file of each kind, built once."""
    for name, text in {
        "src/module.py": "ANSWER = 42\n",
        "data/table.toml": 'value = "42"\n',
        "environment.txt": "numpy==2\n",
        "book/page.md": PAGE,
        "book/_static/style.css": "p {}\n",
        "book/_ext/role.py": "",
        "book/_config.yml": "",
        "book/_toc.yml": "",
        "book/instruments/page.md": PAGE,
        "tools/run.py": "",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    state = State(tmp_path)
    assert not state.drop_stale()
    for kind in KINDS:
        path = tmp_path / "book/_build" / kind
        path.parent.mkdir()
        path.write_text("made before")
    state.remember()
    return tmp_path


def kept(checkout: Path) -> tuple[str, ...]:
    """Begin a build and return what it still has."""
    assert not State(checkout).drop_stale()
    return tuple(kind for kind in KINDS if (checkout / "book/_build" / kind).exists())


def test_a_book_that_stands_is_not_built_again(checkout: Path) -> None:
    assert State(checkout).drop_stale()
    assert State(checkout).drop_stale()


@pytest.mark.parametrize(
    "name", ["src/module.py", "data/table.toml", "environment.txt"]
)
def test_another_number_drops_everything(checkout: Path, name: str) -> None:
    (checkout / name).write_text("changed")
    assert kept(checkout) == ()


def test_a_renamed_module_drops_everything(checkout: Path) -> None:
    (checkout / "src/module.py").rename(checkout / "src/other.py")
    assert kept(checkout) == ()


@pytest.mark.parametrize(
    "name", ["book/_ext/role.py", "book/_config.yml", "book/_toc.yml"]
)
def test_what_makes_the_pages_leaves_the_notebooks_alone(
    checkout: Path, name: str
) -> None:
    (checkout / name).write_text("changed")
    assert kept(checkout) == (NOTEBOOK,)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# A title", "# Another title"),
        ("(label)=", "(other)="),
        ("A sentence", "A {cite}`book`"),
    ],
)
def test_what_other_pages_show_writes_all_of_them(
    checkout: Path, old: str, new: str
) -> None:
    (checkout / "book/page.md").write_text(PAGE.replace(old, new))
    assert kept(checkout) == (NOTEBOOK, READ)


def test_a_new_page_or_style_writes_all_pages(checkout: Path) -> None:
    (checkout / "book/other.md").write_text("A sentence.\n")
    assert kept(checkout) == (NOTEBOOK, READ)
    State(checkout).remember()
    (checkout / "book/_static/style.css").write_text("changed")
    assert kept(checkout) == (NOTEBOOK, READ)


def test_a_sentence_is_its_own_pages_matter(checkout: Path) -> None:
    (checkout / "book/page.md").write_text(PAGE.replace("A sentence", "Another one"))
    assert kept(checkout) == KINDS


def test_a_page_with_numbers_of_sentences_drops_the_facts_alone(checkout: Path) -> None:
    facts = checkout / "book/_build/facts.json"
    facts.write_text("{}")
    (checkout / "book/page.md").write_text(PAGE.replace("A sentence", "Another one"))
    assert kept(checkout) == KINDS
    assert facts.is_file()
    State(checkout).remember()
    (checkout / "book/instruments/page.md").write_text(
        PAGE.replace("A sentence", "Another one")
    )
    assert kept(checkout) == KINDS
    assert not facts.exists()


def test_a_build_that_failed_is_begun_again(checkout: Path) -> None:
    (checkout / "book/page.md").write_text(PAGE.replace("A sentence", "Another one"))
    assert kept(checkout) == KINDS
    assert kept(checkout) == (NOTEBOOK,), (
        "what was read without a word is not warned of again"
    )


@pytest.mark.parametrize("content", ["", "{", '{"numbers": '])
def test_a_damaged_note_is_as_none(checkout: Path, content: str) -> None:
    (checkout / "book/_build/made-of.json").write_text(content)
    assert kept(checkout) == ()
    State(checkout).remember()


def test_a_note_that_cannot_be_written_leaves_the_old_one(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    note = checkout / "book/_build/made-of.json"
    before = note.read_text()
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space"):
        State(checkout).remember()
    assert note.read_text() == before
    assert State(checkout).drop_stale()


def test_what_python_compiles_and_the_build_makes_is_no_input(checkout: Path) -> None:
    for folder in ("src/__pycache__", "book/_extra"):
        (checkout / folder).mkdir()
        (checkout / folder / "made").write_text("made")
    assert State(checkout).drop_stale()
