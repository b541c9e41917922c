"""Make the pictures of the report anew: `python docs/make_screenshots.py [FOLDER]`; needs Chromium and Playwright.

Kept apart from make_images.py, because the bytes depend on the browser and its fonts.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from planarm.errors import PlanarmError
from planarm.notice import silent
from planarm.pipeline import run_scene
from planarm.scene import load_scene

DOCS = Path(__file__).resolve().parent
CASE1 = DOCS.parent / "examples" / "table1_case1.toml"
STALL = DOCS.parent / "tests" / "scenarios" / "mechanics_stall.toml"
MOVING = DOCS.parent / "examples" / "moving_env1.toml"
SHOWN = {
    "report_case1": (CASE1, None, "light", 1.1),
    "report_stall_dark": (CASE1, STALL, "dark", 1.3),
    "report_moving": (MOVING, None, "light", 9.0),
}
"""For each picture: the scene, what goes wrong, the look, and the moment that is shown, in seconds."""


def make_screenshots(folder: Path) -> list[Path]:
    """Run each scene, open its report, and take what a desktop shows; return the files."""
    made = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        for name, (scene, faults, scheme, moment_s) in SHOWN.items():
            with tempfile.TemporaryDirectory() as out:
                page = browser.new_page(viewport={"width": 1440, "height": 1200}, color_scheme=scheme)
                page.goto(f"{_report(Path(out), scene, faults).as_uri()}#t={moment_s}")
                made.append(folder / f"{name}.png")
                page.screenshot(path=made[-1])
        browser.close()
    return made


def _report(out: Path, scene: Path, faults: Path | None) -> Path:
    """Run a scene and return its report; a run that goes wrong as wanted has one, too."""
    try:
        run_scene(load_scene(scene), "sim://", out, silent, faults=faults)
    except PlanarmError:
        if faults is None:  # else it was asked to go wrong, and the report says how
            raise
    return out / "report.html"


if __name__ == "__main__":
    make_screenshots(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "screenshots")
