"""Which rounding rules a printed result speaks for, and which it cannot tell apart."""

from types import SimpleNamespace

from reproduce.audit.examine import rounding_votes
from reproduce.audit.relation import Tolerance
from reproduce.audit.rounding import ROUNDINGS, rules_that_print
from reproduce.printed.number import PrintedNumber


def test_the_last_bits_of_a_sum_speak_for_no_rule():
    """A tenth and two tenths are three tenths, whatever floating point makes of them."""
    assert 0.1 + 0.2 > 0.3
    assert rules_that_print(0.1 + 0.2, PrintedNumber("0.3")) == frozenset(ROUNDINGS)
    assert rules_that_print(0.0, PrintedNumber("0.0")) == frozenset(ROUNDINGS)


def test_only_results_that_tell_rules_apart_have_a_vote():
    def printed_by(*rules):
        return SimpleNamespace(rules=frozenset(rules))

    findings = [printed_by(*ROUNDINGS), printed_by(), printed_by("truncation", "half-up")]
    votes = rounding_votes([*findings, printed_by("truncation")])
    assert {rule: count for rule, count in votes.items() if count} == {
        "truncation": 2,
        "half-up": 1,
    }


def test_tolerances_are_read_in_their_unit_or_in_hundredths():
    assert Tolerance(0.025, "small angles").text == "2.5 %"
    assert Tolerance(0.3, "nominal", "arcsec").text == "0.3 arcsec"
