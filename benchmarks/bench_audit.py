"""The audit of both papers, corrections included: under 10 s."""

from reproduce.audit.report import audit_paper

SECONDS = 10.0
PAPERS = ("niu2024", "chen2023")


def test_audit_of_both_papers(benchmark):
    """Nothing is kept from one round to the next but what importing loads."""

    def audits():
        audit_paper.cache_clear()
        return [audit_paper(paper) for paper in PAPERS]

    benchmark.pedantic(audits, rounds=3)
    print(f"\naudit of both papers: {benchmark.stats['median']:.1f} s (limit {SECONDS})")
    assert benchmark.stats["median"] < SECONDS
