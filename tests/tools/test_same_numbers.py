"""Differences of two results, and the settings of the other arithmetic."""

import json

import pytest

import same_numbers
from same_numbers import arithmetic, differences, is_wrong, other_settings

DRAWING = '<b>one</b><svg><path id="p0123456789" d="M 1.5 2.5 L 3e-05 4"/></svg>'
TOLERANCES = dict.fromkeys(("tolerance", "error", "share"), 1e-5)
INTERVAL = {"interval": [1.0, 2.0], **TOLERANCES}
EMPTY = {"interval": None, "tolerance": 1e-5}
EQUAL = (
    (1.0, 1.0 + 5e-13),
    ({"a": [1, "x", None, True]}, {"a": [1, "x", None, True]}),
    (INTERVAL, {**INTERVAL, "tolerance": 1e-5 + 1e-15}),
    (INTERVAL, {**INTERVAL, "error": 1e-5 + 1e-15}),
    (DRAWING, DRAWING.replace("2.5", "2.500001")),
    (DRAWING, DRAWING.replace("p012", "p123")),
    (DRAWING, DRAWING.replace('4"/>', '4\nz"/>')),
)
DIFFERENT = (
    (1.0, 1.0 + 5e-12),
    (0.0, 1e-30),
    (INTERVAL, {**INTERVAL, "share": 1e-5 + 1e-15}),
    (EMPTY, {**EMPTY, "tolerance": 1e-5 + 1e-15}),
    (1.0, 1),
    ([1.0], [1.0, 2.0]),
    ({"a": 1.0}, {"b": 1.0}),
    ("1.25", "1.26"),
    ("one\ntwo", "one"),
    (DRAWING, DRAWING.replace("2.5", "2.502")),
    (DRAWING, DRAWING.replace("L", "M")),
    (DRAWING, DRAWING.replace("one", "two")),
    (DRAWING, 2 * DRAWING),
)
SCRIPT = """import json, os, pathlib, sys
book = pathlib.Path(sys.argv[0]).parent.parent / 'book'
assert (os.environ['TZ'], sys.argv[1:]) == ('Pacific/Chatham', ['numbers'])
(book / '_build').mkdir()
(book / '_build/facts.json').write_text('{}')
(book / '_extra/ledger.json').write_text(json.dumps(dict(n=VALUE)))
"""


def test_rounding_is_no_difference_and_others_have_their_place():
    for first, second in EQUAL:
        assert list(differences(first, second)) == []
    for first, second in DIFFERENT:
        found = list(differences({"here": first}, {"here": second}))
        assert found[0].startswith(" here")


def test_only_drawings_of_random_draws_may_move_visibly():
    for page, shift, wrong in (
        ("posteriors/own.md", 0.01, False),
        ("posteriors/own.md", 0.1, True),
        ("data.md", 0.01, True),
    ):
        first, second = (f'<svg><path d="M {x:.3f} 2"/></svg>' for x in (1, 1 + shift))
        (found,) = differences({page: first}, {page: second})
        assert is_wrong(found) == wrong


def test_results_with_other_arithmetic_are_compared(tmp_path, monkeypatch, capfd):
    """A checkout with one number, computed in another process."""
    for folder in ("src/reproduce", "data", "book/_build", "book/_extra", "tools"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "book/_extra/ledger.json").write_text(json.dumps({"n": 1.0}))
    (tmp_path / "book/_build/facts.json").write_text("{}")
    monkeypatch.setattr(same_numbers, "ROOT", tmp_path)
    monkeypatch.setattr(same_numbers, "BOOK", tmp_path / "book")
    path = same_numbers.__file__
    (tmp_path / "tools/same_numbers.py").write_text(
        f"import sys; sys.path[:0] = {[str(same_numbers.Path(path).parent)]}\n"
        f"exec(open({path!r}).read())\n"
    )
    for value, code in ((1.0, 0), (1.1, 1)):
        script = SCRIPT.replace("VALUE", str(value))
        (tmp_path / "tools/run_notebooks.py").write_text(script)
        assert same_numbers.main("Prescott", "numbers") == code
        assert ("ledger n: 1.0, 1.1" in capfd.readouterr().out) == bool(code)
    settings = other_settings("Haswell")
    assert settings["OPENBLAS_CORETYPE"] == "Haswell"
    assert {*settings["NPY_DISABLE_CPU_FEATURES"].split()} < {*arithmetic()}
    monkeypatch.setattr(same_numbers, "other_settings", lambda core: {})
    with pytest.raises(RuntimeError, match="other arithmetic"):
        same_numbers.main()
