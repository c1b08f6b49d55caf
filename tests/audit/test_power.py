"""The detection power: what is planted, what is seen, and that the stored study is the real one."""

import random

import pytest
from made_up import TABLES

from reproduce.audit.power import KINDS, plants, seen_by_relations
from reproduce.audit.report import audit_paper
from reproduce.audit.sight import blind, share, stored, why_unseen
from reproduce.judge.ledger import build
from reproduce.judge.power import seen_by_verdicts
from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS

TEXT = (data_folder() / "studies" / "detection-power.toml").read_text(encoding="utf-8")


def test_every_number_of_both_papers_is_in_the_study():
    seed, slips = stored(TEXT)
    planted = [p for paper in PAPERS for p in plants(audit_paper(paper).cells, seed)]
    assert [slip.plant for slip in slips] == planted
    numbers = [address for paper in PAPERS for address in audit_paper(paper).cells]
    assert list(dict.fromkeys(p.address for p in planted)) == numbers
    assert {p.kind for p in planted} == set(KINDS)


def test_no_plant_prints_what_was_printed():
    for paper in PAPERS:
        cells = audit_paper(paper).cells
        assert all(p.text != cells[p.address].number.text for p in plants(cells, 1))


def test_the_relations_see_what_the_study_says():
    _, slips = stored(TEXT)
    for paper in PAPERS:
        audit = audit_paper(paper)
        ours = [slip for slip in slips if slip.plant.address.startswith(paper)]
        relations = [finding.relation for finding in audit.findings]
        plants_ours = [slip.plant for slip in ours]
        again = seen_by_relations(audit.cells, relations, plants_ours)
        assert again == [slip.relation for slip in ours]
        comparing = [relation for relation in relations if relation.compares]
        again = seen_by_relations(audit.cells, comparing, plants_ours)
        assert again == [slip.compared for slip in ours]


@pytest.mark.slow
def test_the_verdicts_see_what_the_study_says():
    """A seeded sample of it, whatever the computation behind the cell."""
    _, slips = stored(TEXT)
    ledger = build()
    for slip in random.Random(7).sample(slips, 25):
        sight = seen_by_verdicts(slip.plant.address, slip.plant.text, ledger)
        assert (sight.seen, sight.refused) == (slip.verdict, slip.refused), slip.plant


def test_a_verdict_sees_a_wrong_result_and_a_wrong_input():
    assert seen_by_verdicts("niu2024/table-2#scale.red", "0.9967").seen
    assert seen_by_verdicts("niu2024/table-1#focal-length.red", "25.6001").seen
    assert not seen_by_verdicts("niu2024/text-registration#exposure", "900").seen
    assert seen_by_verdicts("niu2024/text-simulation#angle-count", "139").refused


def test_a_study_changed_by_hand_is_refused():
    with pytest.raises(ValueError, match="changed by hand"):
        stored(TEXT.replace("true", "false", 1))


def test_a_table_of_sums_sees_nearly_all():
    cells, relations = TABLES["invoice"]()
    planted = list(plants(cells, 3))
    seen = seen_by_relations(cells, relations, planted)
    assert sum(seen) > 0.8 * len(planted)


def test_shares_add_up():
    _, slips = stored(TEXT)
    whole = share(slips, lambda slip: "all")["all"]
    parts = share(slips, lambda slip: slip.plant.kind).values()
    assert tuple(map(sum, zip(*parts, strict=True))) == whole
    assert whole[0] == len(slips)
    _, compared, related, judged, either = whole
    assert compared <= related
    assert max(related, judged) <= either <= related + judged
    unseen = blind(slips)
    assert unseen
    assert not any(slip.either for slip in slips if slip.plant.address in unseen)


def test_every_slip_that_escapes_has_its_reason():
    _, slips = stored(TEXT)
    escaped = [slip for slip in slips if not slip.either]
    reasons = {s.plant.address: why_unseen(s, audit_paper(s.plant.address.partition("/")[0]))
               for s in escaped}  # fmt: skip
    assert "no relation" in reasons["niu2024/text-registration#magnitude"]
    assert "refuses" in reasons["chen2023/table-4#25.frames"]
    assert "contradicts already" in reasons["niu2024/text-registration#rmse-before-red-y"]
    assert "bounded" in reasons["chen2023/text-context#orbits"]
    assert "within" in reasons["niu2024/table-3#rotation.red"]
