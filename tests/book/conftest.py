"""Fixtures of the browser tests: a headless Chromium, a page, a local web server."""

import functools
import shutil
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from playwright.sync_api import sync_playwright
from reading import HTML, PHONE, skip_or_fail

FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run "
    "--disable-background-networking --disable-component-update --disable-sync"
).split()


@pytest.fixture(scope="session")
def browser():
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        skip_or_fail("no Chromium on the PATH (Debian: apt install chromium)")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser):
    """Open a page of the book, or a blank page, in a new context."""
    contexts = []

    def opened(address="", **settings):
        settings = {"viewport": PHONE, "reduced_motion": "reduce"} | settings
        contexts.append(browser.new_context(**settings))
        page = contexts[-1].new_page()
        if address:
            page.goto(f"file://{HTML}/{address}", wait_until="load")
        return page

    yield opened
    for context in contexts:
        context.close()


class _Silent(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        """Write no log."""


@pytest.fixture(scope="session")
def served():
    """Serve the built book on a local port and yield its address."""
    handler = functools.partial(_Silent, directory=str(HTML))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()
