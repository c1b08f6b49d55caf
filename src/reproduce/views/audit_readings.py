"""What the audit page says of the two readings of the papers."""

from __future__ import annotations

from markupsafe import Markup

from reproduce.audit.readings import Merged, lines, merged
from reproduce.audit.report import audit_paper
from reproduce.printed.cells import PAPERS
from reproduce.views.audit_pages import errata_register, html_table
from reproduce.views.pages import Html


def counts() -> dict[str, Merged]:
    """Count what each reading found.

    Returns
    -------
    dict
        ``relations`` (lines of declaration) and ``errata``.
    """
    relations = [f.relation for paper in PAPERS for f in audit_paper(paper).findings]
    return {
        "relations": merged(lines(relations)),
        "errata": merged(entry.reading for entry in errata_register()),
    }


def table() -> Html:
    """Show what the two readings found, and how much both may have missed.

    Returns
    -------
    Html
        A row for the relations and one for the errata.
    """
    names = {"relations": "lines of relations", "errata": "errata"}
    rows = []
    for name, found in counts().items():
        missed = f"{found.missed:.0f} ± {found.error:.0f}"
        numbers = (found.first, found.second, found.both, found.merging, found.found, missed)
        rows.append([Markup("{}").format(entry) for entry in (names[name], *numbers)])
    heads = ("", "First reading only", "Second only", "Both", "When merging", "All")
    caption = "Two readings, and an estimate of what both missed"
    return Html(html_table((*heads, "Missed by both"), rows, caption, "rp-table rp-score"))


def glue() -> None:
    """Make the counts available to the sentences of a page.

    ``readings-NAME-first``, ``-second``, ``-both``, ``-merging``, ``-missed`` and ``-error`` for
    relations and errata.
    """
    from myst_nb import glue as glue_one

    for name, found in counts().items():
        for what in ("first", "second", "both", "merging", "missed", "error"):
            glue_one(f"readings-{name}-{what}", f"{getattr(found, what):.0f}", display=False)
