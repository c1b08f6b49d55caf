"""A paper is added without editing a file of the project: a made-up one on the search path."""

import json
import os
import subprocess
import sys
from html import unescape

import pytest
from commands import words
from places import ROOT

FOLDER = ROOT / "tests/made_up"
SCRIPT = """
import json
import reproduce as rp
from reproduce.papers.catalogue import catalogue
from reproduce.papers.posteriors import posteriors

table = rp.table("lamp2025/table-2")
changed = table.rerun({"lamp2025/table-1#focal-length.far": "150 mm"}).frame()
figure, ratio = rp.figure("lamp2025/fig-1"), rp.table("lamp2025/ratio")
wider = figure.rerun({"lamp2025/table-1#focal-length.far": "150 mm"})
print(json.dumps({
    "papers": list(dict.fromkeys(key.partition("/")[0] for key in catalogue())),
    "contents": list(rp.contents("lamp2025").frame().index),
    "verdicts": {name: table[name].verdict for name in ("angle.near", "angle.far")},
    "shown": repr(table),
    "page": table._repr_html_(),
    "changed": changed["changed"].to_dict(),
    "check": bool(rp.check("lamp2025/table-1", "lamp2025/table-2")),
    "figure": [one.data["y"].tolist() for one in (figure, wider)],
    "errata": list(rp.audit("lamp2025").frame().index),
    "audit": repr(rp.audit("lamp2025")),
    "cite": rp.cite("lamp2025/table-2#angle.far", "text"),
    "study": [
        table.frame().to_dict("records")
        for table in (ratio, ratio.rerun({"lamp2025/table-1#focal-length.far": "150 mm"}))
    ],
    "inputs": rp.posterior("lamp-registration").inputs,
    "posteriors": [name for name in posteriors() if name.startswith("lamp")],
    "model": list(posteriors()["lamp-registration"].model().names),
}))
"""


def run(*arguments, path=FOLDER):
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=os.environ | {"REPRODUCE_PATH": str(path)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def found():
    result = run("-c", SCRIPT)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_the_paper_stands_behind_the_others(found):
    assert found["papers"] == ["niu2024", "chen2023", "lamp2025"]
    assert found["contents"] == [
        "lamp2025/table-1",
        "lamp2025/fig-1",
        "lamp2025/table-2",
    ]


def test_its_tables_are_judged_shown_and_rerun(found):
    assert found["verdicts"] == {"angle.near": "exact", "angle.far": "differs"}
    assert found["check"] is True
    assert "Erratum lamp2025-far-angle" in words(found["shown"])
    assert 'id="lamp2025-table-2"' in found["page"]
    assert found["changed"]["angle.far"] == pytest.approx(
        5e-6 / 0.15 * 206264.806, rel=1e-6
    )


def test_its_figure_is_drawn_and_drawn_again(found):
    assert found["figure"] == [[50.0, 75.0], [50.0, 150.0]]


def test_its_erratum_citation_and_study_are_found(found):
    assert found["errata"] == ["lamp2025-far-angle"]
    assert "lamp2025" in found["audit"]
    assert "Nora Nobody" in found["cite"]
    compared = [[{"lens": "far over near", "ratio": value}] for value in (1.5, 3.0)]
    assert found["study"] == [[pytest.approx(row) for row in rows] for rows in compared]


def test_a_reply_of_its_authors_stands_beside_the_verdict_and_the_erratum(found):
    reply = "N. Nobody, 2026-11-24: the far lens was another one."
    assert reply in words(found["shown"])
    assert reply in words(found["audit"])
    assert f"The authors' reply: {reply}" in unescape(found["page"])
    assert "none yet" not in found["page"]


def test_its_posterior_is_found(found):
    assert found["posteriors"] == ["lamp-registration"]
    assert found["inputs"] == ["lamp2025/table-1#focal-length.*"]
    assert "scale" in found["model"]


def test_a_paper_without_its_entry_in_the_references_is_refused(tmp_path):
    (tmp_path / "data" / "printed" / "lost2025").mkdir(parents=True)
    (tmp_path / "data" / "references.bib").write_text("")
    result = run("-c", "import reproduce as rp; rp.contents()", path=tmp_path)
    assert "expected one entry of references.bib" in result.stderr
    assert "lost2025" in result.stderr
