"""`goto.html` leads to the page of an anchor, and to no page for any other name."""

import json
import re
import subprocess

from playwright._impl._driver import compute_driver_executable

from anchors import GOTO

KNOWN = {"niu2024-table-3": "niu2024/registration"}
NAMES = [*KNOWN, "constructor", "__proto__", "toString", ""]
SCRIPT = """
for (const anchor of %s) {
    const location = {hash: `#${anchor}`, replace: (to) => console.log(to)};
    %s
}"""


def test_only_known_anchors_lead_on():
    (script,) = re.findall("<script>(.*)</script>", GOTO, re.DOTALL)
    code = SCRIPT % (json.dumps(NAMES), script.replace("PLACES", json.dumps(KNOWN)))
    node, _ = compute_driver_executable()
    done = subprocess.run(
        [node, "-e", code], capture_output=True, text=True, check=True
    )
    assert done.stdout == "niu2024/registration.html#niu2024-table-3\n"
