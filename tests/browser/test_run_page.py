"""The page of a run in a real browser: it asks nothing of any network, tells no error, and can be read by everyone."""

import re
from pathlib import Path

import pytest

from planarm.errors import StepsDifferError
from planarm.pipeline import run_scene
from planarm.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "tests" / "scenarios" / "arm.toml"
LOOKS = ("desktop", "dark", "phone")


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """The page of a run without fault."""
    out = tmp_path_factory.mktemp("clean")
    run_scene(load_scene(SCENE), "sim://", out, lambda _stage, _share: None)
    return out / "report.html"


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """The page of a run with a jammed rotor."""
    out = tmp_path_factory.mktemp("faulty")
    with pytest.raises(StepsDifferError):
        faults = SCENE.with_name("mechanics_stall.toml")
        run_scene(load_scene(SCENE), "sim://", out, lambda _stage, _share: None, faults=faults)
    return out / "report.html"


@pytest.mark.parametrize("look", LOOKS)
def test_a_clean_run_reads_well_in_every_look(clean, opened, violations, look):
    with opened(clean.as_uri(), look) as page:
        assert page.told == []
        assert page.asked == [clean.as_uri()]
        assert violations(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing is wider than the screen"


def test_a_faulty_run_says_so_and_shows_when(faulty, opened, violations):
    with opened(faulty.as_uri()) as page:
        assert page.told == []
        assert violations(page) == []
        assert "lost" in page.locator(".verdict.red").inner_text()
        slip = page.locator(".events li.bad button", has_text="slipped").first
        told_s = float(slip.locator("span").first.inner_text().removesuffix(" s"))
        slip.click()
        assert float(shown_s(page)) == pytest.approx(told_s, abs=1e-3)


def shown_s(page):
    return page.locator(".player output").inner_text().split(" / ")[0]


def test_keys_move_the_moment_and_the_arm_with_it(clean, opened):
    with opened(clean.as_uri()) as page:
        before = page.locator(".links").first.get_attribute("points")
        for _ in range(3):
            page.keyboard.press("Shift+ArrowRight")
        page.keyboard.press("ArrowLeft")
        assert float(shown_s(page)) == pytest.approx(0.29)
        assert page.locator(".links").first.get_attribute("points") != before
        page.keyboard.press("Home")
        assert float(shown_s(page)) == 0.0


def test_it_plays_and_pauses(clean, opened):
    with opened(clean.as_uri()) as page:
        page.get_by_role("button", name="Play").click()
        page.locator(
            ".player output", has_text=re.compile(r"^(?!0\.0[0-4])")
        ).wait_for()  # the policy lets nobody evaluate
        page.get_by_role("button", name="Pause").click()
        held = shown_s(page)
        page.wait_for_timeout(80)
        assert shown_s(page) == held


def test_dragging_over_a_curve_moves_the_moment(clean, opened):
    with opened(clean.as_uri()) as page:
        box = page.locator(".strip svg").first.bounding_box()
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        assert float(shown_s(page)) > 0.1


def test_the_certificate_tells_its_verdicts_in_words_and_shapes(clean, opened):
    with opened(clean.as_uri()) as page:
        marks = page.locator(".certificate tbody .mark")
        words = {text.strip() for text in marks.all_inner_texts()}
        assert words <= {"holds", "look", "fails"} and "holds" in words
        assert page.locator(".certificate tbody .mark svg").count() == marks.count()
