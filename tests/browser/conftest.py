"""A real browser for the pages: Debian's Chromium, driven by Playwright; without them the tests here are skipped."""

import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DESKTOP = {"viewport": {"width": 1440, "height": 900}}
DARK = {**DESKTOP, "color_scheme": "dark"}
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "has_touch": True}
LOOKS = {"desktop": DESKTOP, "dark": DARK, "phone": PHONE}


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium for all tests of a worker."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the pages' tests need playwright (pip, extra dev)")
    if CHROMIUM is None:
        pytest.skip("the pages' tests need Chromium (Debian: apt-get install chromium)")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def opened(browser):
    """Open an address with a look; the page's `told` collects what a careful author would be ashamed of."""

    @contextmanager
    def open_page(address, look="desktop"):
        context = browser.new_context(**LOOKS[look])
        page = context.new_page()
        page.told = []
        page.asked = []
        page.on("console", lambda message: page.told.append(message.text))
        page.on("pageerror", lambda error: page.told.append(str(error)))
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(address)
        try:
            yield page
        finally:
            context.close()

    return open_page


@pytest.fixture
def violations():
    """What axe-core finds on a page: contrast, labels, roles, order; each as its rule and the elements."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python (pip, dev)")

    def look(page):
        found = axe.Axe().run(page).response["violations"]
        return [(one["id"], [node["html"] for node in one["nodes"]]) for one in found]

    return look
