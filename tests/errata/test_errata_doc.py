"""docs/errata.md names a test for each error, and those tests exist."""

import ast
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOC = HERE.parents[1] / "docs" / "errata.md"


def names_in(paper):
    tree = ast.parse((HERE / f"test_errata_{paper}.py").read_text(encoding="utf-8"))
    return {node.name.removeprefix("test_") for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_row_of_the_document_names_tests_that_exist():
    lines = DOC.read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("| ") and "`test_...`" not in line]
    sections = {"A": "a", "B": "b", "C": "c"}
    paper, told = "", 0
    for row in rows:
        first, *_, named = (cell.strip() for cell in row.strip("|").split(" | "))
        paper = sections.get(first[:1], paper)
        for name in re.findall(r"`([a-z0-9_.]+)`", named):
            stem = name.removesuffix("...")
            assert any(test.startswith(stem) for test in names_in(paper)), f"{row}: no test {name}"
            told += 1
    assert told >= 30
