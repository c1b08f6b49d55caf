"""One headless Chromium reads every built page once; the tests judge what it saw."""

import functools
import os
import shutil
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from reading import HTML, PHONE, Visit, built_pages, note_console, read

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


def missing_browser(what: str) -> None:
    """Skip with a notice, or fail where the environment demands the browser."""
    if os.environ.get("REPRODUCE_REQUIRE_BROWSER") == "1":
        pytest.fail(f"{what}, and REPRODUCE_REQUIRE_BROWSER=1 demands it")
    pytest.skip(f"{what}; install it to check the pages (Debian: apt install chromium)")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        missing_browser("no Chromium was found on the PATH")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def page(browser: Browser) -> Page:
    context = browser.new_context(viewport=PHONE)
    return context.new_page()


@pytest.fixture(scope="session")
def visits(page: Page) -> dict[str, Visit]:
    """Every page of the book, read from the disk."""
    current = Visit()
    page.on("console", lambda message: note_console(current, message))
    page.on("pageerror", lambda error: current.console.append(str(error)))
    page.on("request", lambda request: current.requests.append(request.url))
    seen = {}
    for address in built_pages():
        current = seen[address] = Visit()
        read(page, (HTML / address).as_uri(), current)
    current = Visit()  # later reading is none of these pages'
    return seen


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture(scope="session")
def served() -> Iterator[str]:
    """The built book behind a local web server; yields its address."""
    handler = functools.partial(_Quiet, directory=str(HTML))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()
