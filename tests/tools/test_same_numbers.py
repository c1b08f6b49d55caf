"""What counts as the same under another arithmetic, and that a setting changes the arithmetic."""

import pytest

import same_numbers
from same_numbers import (
    ELSEWHERE,
    PLAIN,
    ROOT,
    USUAL,
    apart,
    as_it_is,
    differences,
    settings,
)

DRAWING = '<b>one</b><svg><path id="p0123456789" d="M 1.5 {} L 3e-05 4"/></svg>'


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 1.0 + 5e-13),
        ({"a": [1, "x", None, True]}, {"a": [1, "x", None, True]}),
        (DRAWING.format("2.5"), DRAWING.format("2.500001")),
        (
            {"interval": [1.0, 2.0], "tolerance": 1e-5},
            {"interval": [1.0, 2.0], "tolerance": 1e-5 + 1e-15},
        ),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace("p012", "p123")),
        (DRAWING.format("2.5"), DRAWING.format("2.5").replace('4"/>', '4\nz"/>')),
    ],
)
def test_next_to_nothing_is_no_difference(one, other):
    assert list(differences(one, other)) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 1.0 + 5e-12),
        (0.0, 1e-30),
        (
            {"interval": [1.0, 2.0], "share": 1e-5},
            {"interval": [1.0, 2.0], "share": 1e-5 + 1e-15},
        ),
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
def test_every_kind_of_difference_is_told_with_its_place(one, other):
    assert next(differences({"here": one}, {"here": other})).startswith(" here")


def test_at_least_three_settings_are_tried():
    assert {USUAL, PLAIN, ELSEWHERE} <= set(settings())


def test_a_setting_reaches_the_arithmetic():
    usual, plain = (
        apart(settings()[name], ROOT, ["notation.md"]) for name in (USUAL, PLAIN)
    )
    assert plain["arithmetic"]["instructions"] == []
    assert plain["arithmetic"] != usual["arithmetic"]
    assert (
        plain["pages"]
        == usual["pages"]
        == {"notation.md": {"words": {}, "texts": [], "seconds": 0}}
    )


def test_an_error_or_a_warning_of_a_page_stops_the_comparison():
    with pytest.raises(RuntimeError, match=r"nothing\.md: exit code 1"):
        apart({}, ROOT, ["nothing.md"])


def test_what_is_put_in_from_outside_is_no_setting(monkeypatch):
    """A kernel that a user chose for all programs is not taken for that of the machine."""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    as_it_is.cache_clear()
    bare = as_it_is()
    as_it_is.cache_clear()
    monkeypatch.delenv("OPENBLAS_CORETYPE")
    assert bare == as_it_is()
    assert bare["core"] not in settings()


@pytest.mark.parametrize(
    ("page", "moved", "wrong"),
    [
        ("posteriors/own.md", 0.01, 0),
        ("posteriors/own.md", 0.1, 1),
        ("data.md", 0.01, 1),
    ],
)
def test_drawings_of_draws_alone_may_move_by_what_nobody_sees(
    monkeypatch, page, moved, wrong
):
    def made_up(environment, root, pages):
        away = moved * ("Prescott" in environment.values())
        drawn = f'<svg><path d="M {1 + away:.3f} 2"/></svg>'
        shown = {
            one: {"words": {}, "texts": [drawn if one == page else ""]} for one in pages
        }
        return {"arithmetic": dict(environment), "pages": shown, "ledger": {}}

    monkeypatch.setattr(same_numbers, "apart", made_up)
    monkeypatch.setattr(same_numbers, "NEEDED", ())
    assert same_numbers.compared() == wrong


def test_a_difference_is_counted_and_printed(monkeypatch, capsys):
    def made_up(environment, root, pages):
        value = 1.0 + 1e-9 * ("TZ" in environment)
        shown = {page: {"words": {"x": str(value)}, "texts": []} for page in pages}
        ledger = {} if pages else {"cell": value}
        return {"arithmetic": dict(environment), "pages": shown, "ledger": ledger}

    monkeypatch.setattr(same_numbers, "apart", made_up)
    monkeypatch.setattr(same_numbers, "NEEDED", ())
    wrong = same_numbers.compared()
    quick = sum(page.parent.name != "posteriors" for page in same_numbers.notebooks())
    assert wrong == quick + 1, "every page, and the ledger, under one setting"
    assert "ledger cell: 1.0, 1.000000001" in capsys.readouterr().out
