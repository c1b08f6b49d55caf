"""What sentences say of the evidence about ourselves, from its stored tables."""

from __future__ import annotations

from reproduce.store import studies

__all__ = ["evidence_facts"]


def evidence_facts() -> dict[str, str]:
    """Return the counts of planted slips, of two readings and of rounding residuals, by name."""
    planted = studies.table("planted-slips")
    seen = planted["relation"] | planted["verdict"]
    strict = planted["compared"] | planted["verdict"]
    found = {
        "planted": str(len(planted)),
        "seen": f"{100 * seen.mean():.0f}\u202f%",
        "strict": f"{100 * strict.mean():.0f}\u202f%",
        "refused": str((planted["refused"] & ~seen).sum()),
        "blind": str((~seen.groupby(planted["cell"]).any()).sum()),
    }
    for row in studies.table("two-readings").itertuples():
        for what in ("first", "second", "both", "merging", "missed", "error"):
            found[f"{row.what}-{what}"] = f"{getattr(row, what):.0f}"
    for row in studies.table("rounding-residuals").itertuples():
        name = f"{row.paper}-{row.against}"
        found[f"{name}-telling"] = str(row.telling)
        found[f"{name}-probability"] = f"{row.probability:.2f}"
        found[f"{name}-exact"] = str(row.exact)
    return found
