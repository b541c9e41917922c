"""`planarm run --live` in a real browser: start, hold, resume, done; readable by everyone, on this computer alone."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLANARM = Path(sys.executable).parent / "planarm"
COMPILING_MS = 90_000
"""On a machine that never ran them, what judges a run that ended is compiled first."""


@pytest.fixture
def live(tmp_path):
    """A slow short run that waits for its start: its process, and its page's address."""
    scene = tmp_path / "slow.toml"
    text = (ROOT / "tests" / "scenarios" / "arm.toml").read_text()
    scene.write_text(text.replace("max_speed_deg_s = 110", "max_speed_deg_s = 15"))
    command = [PLANARM, "run", scene, "--out", tmp_path / "out", "--live", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        address = next(line.split()[1] for line in run.stderr if line.startswith("live:"))
        yield run, address
        run.kill()


def shown(page, state):
    """Wait until the page says so; by a locator, because the page's policy lets nobody evaluate words."""
    page.locator(".now", has_text=re.compile(f"^{state}$")).wait_for(timeout=COMPILING_MS)


def test_a_run_is_started_held_resumed_and_ends_well(live, opened, violations):
    run, address = live
    with opened(address) as page:
        shown(page, "waiting for the start")
        page.get_by_role("button", name="Hold", disabled=True).wait_for(timeout=COMPILING_MS)
        page.get_by_role("button", name="Start").click()
        shown(page, "running")
        page.get_by_role("button", name="Hold").click()
        shown(page, "held")
        assert violations(page) == []
        held = page.locator(".links.real").get_attribute("points")
        page.wait_for_timeout(250)
        assert page.locator(".links.real").get_attribute("points") == held, "the arm rests on its path"
        page.get_by_role("button", name="Resume").click()
        shown(page, "done")
        assert page.told == []
        assert all(asked.startswith(address) for asked in page.asked)
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 0
    summary = json.loads(out)
    assert summary["net_usteps"] == summary["net_usteps_by_ledger"]


def test_a_run_is_stopped(live, opened):
    run, address = live
    with opened(address, "phone") as page:
        shown(page, "waiting for the start")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing is wider than the screen"
        page.get_by_role("button", name="Start").click()
        shown(page, "running")
        page.get_by_role("button", name="Stop").click()
        shown(page, "failed")
    run.communicate(timeout=60)
    assert run.returncode == 5, "the plan was not executed to its end, and the position is told"
