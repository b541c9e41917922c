"""The documentation's pictures are there, and docs/make_images.py is what makes them."""

import re
import runpy
from pathlib import Path

from matplotlib.image import imread

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]


def pictures_shown():
    """Every local picture that a document shows, as a path."""
    for document in DOCUMENTS:
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", document.read_text(encoding="utf-8")):
            if "://" not in target:
                yield document.parent / target


def test_every_picture_shown_is_there():
    shown = list(pictures_shown())
    assert {picture.name for picture in shown} >= {"report_case1.png", "stencils.png", "table1_case1.png"}
    assert [picture for picture in shown if not picture.is_file()] == []


def test_the_script_makes_all_pictures_of_the_folder(tmp_path):
    """Their names and sizes: the bytes depend on matplotlib's version and its fonts."""
    made = runpy.run_path(str(ROOT / "docs" / "make_images.py"))["make_images"](tmp_path)
    kept = sorted((ROOT / "docs" / "images").glob("*.png"))
    assert sorted(file.name for file in made) == [file.name for file in kept]
    for file in kept:
        assert imread(tmp_path / file.name).shape == imread(file).shape
