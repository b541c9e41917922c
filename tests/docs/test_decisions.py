"""The table of decisions names every decision, by its file."""

import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "decisions"


def test_the_table_holds_every_decision_once():
    told = re.findall(r"^\| \[\d{4}\]\((\d{4}-[a-z0-9-]+\.md)\) \| .+ \|$", (FOLDER / "README.md").read_text(), re.M)
    assert told == sorted(path.name for path in FOLDER.glob("0*.md"))
