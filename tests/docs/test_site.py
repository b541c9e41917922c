"""The documentation as a site: built without any network, strict, every link leads somewhere, formulas are drawn."""

import html.parser
import os
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOADS = {"script": "src", "img": "src", "link": "href", "iframe": "src"}
ABOUT = {"canonical", "prev", "next", "edit"}
"""Links of a page's head that tell something and load nothing."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    pytest.importorskip("mkdocs", reason="the site needs mkdocs (pip, extra docs)")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "-d", folder]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "http_proxy": "http://127.0.0.1:9", "https_proxy": ""}
    done = subprocess.run(command, cwd=ROOT, check=False, env=environment, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 0, done.stderr
    return folder


class Addresses(html.parser.HTMLParser):
    """What a page loads, and where its links lead."""

    def __init__(self, page):
        super().__init__()
        self.loaded, self.linked = [], []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag in LOADS and found.get(LOADS[tag]) and found.get("rel") not in ABOUT:
            self.loaded.append(found[LOADS[tag]])
        if tag == "a" and found.get("href"):
            self.linked.append(found["href"])


def missing(site, page, addresses):
    places = [(a, page.parent / unquote(urlsplit(a).path)) for a in addresses if urlsplit(a).path]
    return [address for address, place in places if not place.exists()]


def test_no_page_loads_anything_from_elsewhere_and_every_link_leads_somewhere(site):
    pages = [page for page in site.rglob("*.html") if page.name != "404.html"]
    assert len(pages) > 30
    for page in pages:
        found = Addresses(page)
        assert [a for a in found.loaded if urlsplit(a).netloc] == [], page.name
        inner = [a for a in found.linked if not urlsplit(a).netloc and not urlsplit(a).scheme]
        assert missing(site, page, [*found.loaded, *inner]) == [], page.name


def test_formulas_commands_and_decisions_are_there(site):
    formulas = (site / "theory" / "dynamics.html").read_text(encoding="utf-8")
    assert formulas.count("<math") > 5 and "$$" not in formulas
    commands = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert all(f"planarm {name}" in commands for name in ("run", "timing", "explain", "completion"))
    decisions = (site / "decisions.html").read_text(encoding="utf-8")
    assert decisions.count("<h2") == len(list((ROOT / "docs" / "decisions").glob("0*.md")))
    assert "inverse_2r" in (site / "reference" / "host.html").read_text(encoding="utf-8")
