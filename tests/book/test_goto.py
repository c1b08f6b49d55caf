"""Links to places and files of the book: `goto.html`, targets that stay, and tables to save."""

import json
import re
from pathlib import Path

import pytest
from commands import output_of
from playwright._impl._driver import compute_driver_executable
from reading import DESKTOP, HTML, PHONE, SETTLED

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
    assert output_of(node, "-e", code) == "niu2024/registration.html#niu2024-table-3\n"


FAR = """name => {
    const target = document.getElementById(name);
    return Math.abs(target.getBoundingClientRect().top - 80);
}"""


@pytest.mark.browser
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize(
    "address",
    [
        "niu2024/registration.html#equation-niu2024-17",
        "niu2024/calibration.html#equation-niu2024-24",
        "niu2024/simulation.html#niu2024-table-3",
    ],
)
def test_the_target_of_a_link_stays_in_place(open_page, address, size):
    """Formulas above the target get their height after the page is shown."""
    page = open_page(viewport=size)
    page.goto(f"file://{HTML}/{address}", wait_until="domcontentloaded")
    name, far = address.partition("#")[2], []
    for _ in range(10):
        page.wait_for_timeout(150)
        far.append(page.evaluate(FAR, name))
    assert max(far[1:]) < size["height"] / 2, far
    page.evaluate(SETTLED)
    page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(300)
    assert page.evaluate("scrollY") == 0, "a reader leads"


@pytest.mark.browser
@pytest.mark.parametrize("ending", ["tex", "csv", "json", "md"])
def test_a_table_is_saved_and_does_not_replace_the_book(open_page, ending):
    page = open_page("chen2023/accuracy.html")
    link = page.locator(f'.rp-bar a[href$="tables/chen2023-table-4.{ending}"]')
    with page.expect_download() as saved:
        link.click()
    assert saved.value.suggested_filename == f"chen2023-table-4.{ending}"
    written = HTML / "tables" / f"chen2023-table-4.{ending}"
    assert Path(saved.value.path()).read_bytes() == written.read_bytes()
    assert page.url.endswith("accuracy.html")
