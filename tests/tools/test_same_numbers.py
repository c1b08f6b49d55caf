"""Differences between two results, and the other arithmetic."""

import json

import pytest

import same_numbers
from same_numbers import arithmetic, differences, is_wrong, other_settings

DRAWING = '<b>one</b><svg><path id="p0123456789" d="M 1.5 {} L 3e-05 4"/></svg>'
INTERVAL = {
    "interval": [1.0, 2.0],
    **dict.fromkeys(("tolerance", "error", "share"), 1e-5),
}


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 1.0 + 5e-13),
        ({"a": [1, "x", None, True]}, {"a": [1, "x", None, True]}),
        (DRAWING.format("2.5"), DRAWING.format("2.500001")),
        (INTERVAL, {**INTERVAL, "tolerance": 1e-5 + 1e-15}),
        (INTERVAL, {**INTERVAL, "error": 1e-5 + 1e-15}),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace("p012", "p123")),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace('4"/>', '4\nz"/>')),
    ],
)
def test_rounding_is_no_difference(one, other):
    assert list(differences(one, other)) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 1.0 + 5e-12),
        (0.0, 1e-30),
        (INTERVAL, {**INTERVAL, "share": 1e-5 + 1e-15}),
        (
            {"interval": None, "tolerance": 1e-5},
            {"interval": None, "tolerance": 1e-5 + 1e-15},
        ),
        (1.0, 1),
        (True, False),
        ([1.0], [1.0, 2.0]),
        ({"a": 1.0}, {"b": 1.0}),
        ("1.25", "1.26"),
        ("one\ntwo", "one"),
        (DRAWING.format("2.5"), DRAWING.format("2.502")),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace("L", "M")),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace("one", "two")),
        (DRAWING.format("2.5"), DRAWING.format("2.5") * 2),
        ("<svg></svg>", "<svg></svg><svg></svg>"),
    ],
)
def test_every_other_difference_is_returned_with_its_place(one, other):
    assert next(differences({"here": one}, {"here": other})).startswith(" here")


@pytest.mark.parametrize(
    ("page", "moved", "wrong"),
    [
        ("posteriors/own.md", 0.01, False),
        ("posteriors/own.md", 0.1, True),
        ("data.md", 0.01, True),
    ],
)
def test_only_drawings_of_random_draws_may_move_visibly_little(page, moved, wrong):
    one, other = (f'<svg><path d="M {x:.3f} 2"/></svg>' for x in (1, 1 + moved))
    (found,) = differences({page: one}, {page: other})
    assert is_wrong(found) == wrong
    (found,) = differences({page: one}, {page: one.replace("M", "L")})
    assert is_wrong(found) == (page == "data.md")


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout whose only number depends on the instructions of NumPy."""
    root = tmp_path / "checkout"
    for folder in ("src/reproduce", "data", "book/_build", "book/_extra", "tools"):
        (root / folder).mkdir(parents=True)
    files = {"book/_extra/ledger.json": {"n": 1.0}, "book/_build/facts.json": {}}
    for name, content in files.items():
        (root / name).write_text(json.dumps(content))
    monkeypatch.setattr(same_numbers, "ROOT", root)
    monkeypatch.setattr(same_numbers, "BOOK", root / "book")
    path = same_numbers.__file__
    (root / "tools/same_numbers.py").write_text(
        f"import sys; sys.path[:0] = {[str(same_numbers.Path(path).parent)]}\n"
        f"exec(open({path!r}).read())\n"
    )
    return root


@pytest.mark.parametrize(("value", "code"), [(1.0, 0), (1.1, 1)])
def test_results_under_other_arithmetic_are_compared(checkout, capfd, value, code):
    (checkout / "tools/run_notebooks.py").write_text(
        "import json, os, pathlib, sys\n"
        "book = pathlib.Path(sys.argv[0]).parent.parent / 'book'\n"
        "assert os.environ['TZ'] == 'Pacific/Chatham'\n"
        "(book / '_build').mkdir()\n"
        "(book / '_build/facts.json').write_text('{}')\n"
        f"(book / '_extra/ledger.json').write_text(json.dumps(dict(n={value})))\n"
    )
    assert same_numbers.main() == code
    assert ("ledger n: 1.0, 1.1" in capfd.readouterr().out) == bool(code)


def test_arithmetic_that_does_not_change_is_an_error(checkout, monkeypatch):
    monkeypatch.setattr(same_numbers, "other_settings", lambda core: {})
    with pytest.raises(RuntimeError, match="expected other arithmetic"):
        same_numbers.main()


def test_the_settings_name_the_instructions_in_use():
    assert other_settings("Haswell")["OPENBLAS_CORETYPE"] == "Haswell"
    assert {*other_settings("Haswell")["NPY_DISABLE_CPU_FEATURES"].split()} < {
        *arithmetic()
    }
