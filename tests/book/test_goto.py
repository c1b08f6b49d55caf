"""`goto.html` leads to the page of an anchor, and to no page for any other name."""

import json
import re
import subprocess

import pytest
from playwright._impl._driver import compute_driver_executable

from anchors import GOTO

SCRIPT = """
const location = {{hash: {hash}, replace: (to) => console.log(to)}};
{script}
"""


@pytest.mark.parametrize(
    ("name", "page"),
    [
        ("niu2024-table-3", "niu2024/registration.html#niu2024-table-3"),
        ("constructor", ""),
        ("__proto__", ""),
        ("toString", ""),
        ("", ""),
    ],
)
def test_only_known_anchors_lead_on(name: str, page: str) -> None:
    (script,) = re.findall("<script>(.*)</script>", GOTO, re.DOTALL)
    script = script.replace(
        "PLACES", json.dumps({"niu2024-table-3": "niu2024/registration"})
    )
    node, _ = compute_driver_executable()
    code = SCRIPT.format(hash=json.dumps(f"#{name}"), script=script)
    done = subprocess.run(
        [node, "-e", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == page
