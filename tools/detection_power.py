"""Plant a slip of each kind in every printed cell and store which ones a check would see.

Run as ``python tools/detection_power.py``; it writes ``data/studies/detection-power.toml``.
"""

from __future__ import annotations

import hashlib
import time
from pathlib import Path

import reproduce
from reproduce.audit.power import Plant, plants, seen_by_relations
from reproduce.audit.report import audit_paper
from reproduce.judge.ledger import build
from reproduce.judge.power import seen_by_verdicts
from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS

SEED = 20_240_102
HEAD = """\
# Which slips of the pen the checks would see: one slip of each kind planted in every printed cell,
# each alone. Seen means that an agreement, of a relation or of a verdict, turned into a
# disagreement. refused: a computation raised an error on the changed input; not counted as seen.
"""


def rows(planted: list[Plant], paper: str) -> list[str]:
    """Return one line of TOML for each slip."""
    audit, ledger = audit_paper(paper), build()
    relations = [finding.relation for finding in audit.findings]
    by_relation = seen_by_relations(audit.cells, relations, planted)
    lines = []
    for plant, related in zip(planted, by_relation, strict=True):
        sight = seen_by_verdicts(plant.address, plant.text, ledger)
        flags = (related, sight.seen, sight.refused)
        told = ", ".join(str(flag).lower() for flag in flags)
        lines.append(f'    ["{plant.address}", "{plant.kind}", "{plant.text}", {told}],')
    return lines


def main() -> None:
    """Run the study and write it."""
    start = time.perf_counter()
    lines: list[str] = []
    for paper in PAPERS:
        lines += rows(list(plants(audit_paper(paper).cells, SEED)), paper)
    body = "\n".join(lines)
    digest = hashlib.sha256(body.encode()).hexdigest()
    seconds = time.perf_counter() - start
    text = (
        f'{HEAD}command = "python tools/detection_power.py"\nversion = "{reproduce.__version__}"\n'
        f'seed = {SEED}\nseconds = {seconds:.0f}\nsha256 = "{digest}"\n'
        f'columns = ["cell", "kind", "printed instead", "relation", "verdict", "refused"]\n'
        f"slips = [\n{body}\n]\n"
    )
    path: Path = data_folder() / "studies" / "detection-power.toml"
    path.write_text(text, encoding="utf-8")
    print(f"{len(lines)} slips in {seconds:.0f} s: {path}")


if __name__ == "__main__":
    main()
