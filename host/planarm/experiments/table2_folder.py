"""The folder of the comparison: table2.json, table2.md, a picture for each planner and case, and the stencils."""

from __future__ import annotations

import json
from pathlib import Path

from planarm.experiments.pictures import draw_paper_stencils, draw_path
from planarm.experiments.published import CASES, CHAOS, PLANNERS, Planner
from planarm.experiments.table2 import Case, Notice, Table2, load_case, typical_path
from planarm.experiments.table2_tables import as_json, as_markdown


def write_table2(result: Table2, out: Path, notice: Notice = lambda _stage, _share: None) -> list[Path]:
    """Write everything and return the files; those of an earlier comparison are overwritten.

    The paths are those of the paper's reading; of Chaos A*'s seeds the one with the median length is drawn.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = [out / "table2.json", out / "table2.md", out / "stencils.png"]
    files[0].write_text(json.dumps(as_json(result), indent=1) + "\n", encoding="utf-8")
    files[1].write_text(as_markdown(result), encoding="utf-8")
    draw_paper_stencils(files[2])
    for number in CASES:
        case = load_case(number)
        for planner in PLANNERS:
            notice("pictures", (len(files) - 3) / (len(CASES) * len(PLANNERS)))
            target = out / f"case{number}_{planner.algorithm}.png"
            if _draw(case, planner, result.seeds, target):
                files.append(target)
    notice("pictures", 1.0)
    return files


def _draw(case: Case, planner: Planner, seeds: int, target: Path) -> bool:
    """Draw the planner's path; tell whether there is one."""
    path, seed = typical_path(case, planner, "nodes", seeds)
    if path is None:
        return False
    how = (
        f"23 of {planner.neighbours} neighbours, seed {seed} (near the median)"
        if planner is CHAOS
        else f"{planner.neighbours} neighbours"
    )
    draw_path(
        target,
        case.scene,
        case.free_map,
        path,
        subtitle=f"{planner.name}, {how}, {path.length_cm:.4f} cm; only nodes checked, as the paper reads",
    )
    return True
