"""Plant a slip of each kind in every printed cell and store which ones a check would see.

Run as ``python tools/detection_power.py``; it writes ``data/studies/detection-power.toml``. With
``--check`` it computes everything again, and fails if the file says otherwise.
"""

from __future__ import annotations

import hashlib
import sys
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
COLUMNS = '["cell", "kind", "printed instead", "compared", "relation", "verdict", "refused"]'
HEAD = """\
# Which slips of the pen the checks would see: one slip of each kind planted in every printed cell,
# each alone. Seen means that an agreement, of a relation or of a verdict, turned into a
# disagreement; compared leaves out relations that know no more than a sign, a bound or a last
# digit. refused: a computation raised an error on the changed input; not counted as seen.
"""


def rows(planted: list[Plant], paper: str) -> list[str]:
    """Return one line of TOML for each slip."""
    audit, ledger = audit_paper(paper), build()
    relations = [finding.relation for finding in audit.findings]
    by_relation = seen_by_relations(audit.cells, relations, planted)
    compared = seen_by_relations(audit.cells, [r for r in relations if r.compares], planted)
    lines = []
    for plant, held, related in zip(planted, compared, by_relation, strict=True):
        sight = seen_by_verdicts(plant.address, plant.text, ledger)
        flags = (held, related, sight.seen, sight.refused)
        told = ", ".join(str(flag).lower() for flag in flags)
        lines.append(f'    ["{plant.address}", "{plant.kind}", "{plant.text}", {told}],')
    return lines


def main() -> None:
    """Run the study and write it, or hold what is written against it."""
    start = time.process_time()
    lines: list[str] = []
    for paper in PAPERS:
        lines += rows(list(plants(audit_paper(paper).cells, SEED)), paper)
    body = "\n".join(lines)
    digest = hashlib.sha256(body.encode()).hexdigest()
    seconds = time.process_time() - start
    text = (
        f'{HEAD}command = "python tools/detection_power.py"\nversion = "{reproduce.__version__}"\n'
        f'seed = {SEED}\nprocessor_seconds = {seconds:.0f}\nsha256 = "{digest}"\n'
        f"columns = {COLUMNS}\n"
        f"slips = [\n{body}\n]\n"
    )
    path: Path = data_folder() / "studies" / "detection-power.toml"
    if "--check" in sys.argv[1:]:
        same = f"slips = [\n{body}\n]\n" in path.read_text(encoding="utf-8")
        print(f"{len(lines)} slips in {seconds:.0f} s: {'as stored' if same else 'NOT as stored'}")
        sys.exit(not same)
    path.write_text(text, encoding="utf-8")
    print(f"{len(lines)} slips in {seconds:.0f} s: {path}")


if __name__ == "__main__":
    main()
