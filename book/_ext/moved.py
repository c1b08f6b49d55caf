"""Sphinx extension: ``{moved}`` lists the verdicts that changed since the last release.

``data/last-release.toml`` contains the verdicts of that release and the reason of each change, so a
book can be built without the history.
"""

import tomllib
from collections import Counter
from collections.abc import Mapping
from typing import Any

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from after_build import SAFE
from reproduce.judge.ledger import frozen, record_of
from reproduce.locate import data_folder
from reproduce.printed.cells import anchor, library
from reproduce.views._blocks import Block, Blocks, Grid, badge, link

Moved = dict[str, tuple[str, str]]


def moved(release: Mapping[str, Any], now: Mapping[str, str]) -> Moved:
    """Return the former and present verdicts of the cells whose verdict changed, by address.

    Raises
    ------
    ValueError
        If the changed cells are not those of the entries of ``moved``.
    """
    then = {
        cell: verdict
        for verdict, cells in release["verdicts"].items()
        for cell in cells
    }
    found = {
        cell: (then[cell], word)
        for cell, word in now.items()
        if then.get(cell, word) != word
    }
    named = {cell for entry in release.get("moved", ()) for cell in entry["cells"]}
    if unlike := sorted(named ^ set(found)):
        raise ValueError(
            f"last-release.toml: expected [[moved]] with every changed cell, got {unlike} "
            "in only one of them. Add or remove these cells."
        )
    return found


class MovedDirective(SphinxDirective):
    """The number of changed verdicts, and a table for each reason."""

    def run(self) -> list[nodes.Node]:
        """Compare the verdicts and write the tables."""
        path = data_folder() / "last-release.toml"
        self.env.note_dependency(str(path))
        release = tomllib.loads(path.read_text(encoding="utf-8"))
        found = moved(release, {cell: one.verdict for cell, one in frozen().items()})
        kinds = Counter(
            f"{verdict} to {word}" for verdict, word in found.values()
        ).items()
        blocks: list[Block] = [
            f"Since version {release['version']}, of {release['released']}, {len(found)} of "
            f"{len(frozen())} verdicts have moved: "
            + ", ".join(f"{count} from {kind}" for kind, count in kinds)
            + "."
        ]
        for entry in release.get("moved", ()):
            rows: dict[tuple[str, ...], list[Markup]] = {}
            for cell in entry["cells"]:
                record = record_of(cell)
                why = record.reason or record.why
                rows.setdefault((record.key, *found[cell], why), []).append(
                    link(anchor(cell), record.printed_cell.label)
                )
            lines = [
                (
                    Markup("{}, {}: {}").format(
                        key.partition("/")[0],
                        library()[key].place,
                        Markup("; ").join(links),
                    ),
                    Markup("<br>").join(map(badge, words)),
                    why,
                )
                for (key, *words, why), links in rows.items()
            ]
            caption = f"{entry['day']}, commit {entry['commit']}: {entry['because']}"
            blocks.append(Grid(caption, ("cells", "was, is", "because"), lines))
        return [nodes.raw("", Blocks(tuple(blocks))._repr_html_(), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("moved", MovedDirective)
    return SAFE
