"""The folder of the comparison: table2.json, table2.md, and pictures like those of paper C, figs. 2 to 18."""

from __future__ import annotations

import json
from pathlib import Path

from planarm.experiments.pictures import draw_angles, draw_free_space, draw_paper_stencils, draw_path
from planarm.experiments.published import CASES, CHAOS, PLANNERS, Planner
from planarm.experiments.table2 import Case, Table2, load_case, typical_path
from planarm.experiments.table2_tables import as_json, as_markdown
from planarm.notice import Notice, silent


def write_table2(result: Table2, out: Path, notice: Notice = silent) -> list[Path]:
    """Write everything and return the files; those of an earlier comparison are overwritten.

    The paths are those of the paper's reading (figs. 11, 13, 15, 17), the joint angles those of a motion along them
    (figs. 12, 14, 16, 18); of Chaos A*'s seeds the one with the median length is drawn.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = [out / "table2.json", out / "table2.md", out / "stencils.png"]
    files[0].write_text(json.dumps(as_json(result), indent=1) + "\n", encoding="utf-8")
    files[1].write_text(as_markdown(result), encoding="utf-8")
    draw_paper_stencils(files[2])
    for step, number in enumerate(CASES):
        case = load_case(number)
        files.append(out / f"case{number}_free_space.png")
        draw_free_space(files[-1], case.scene, case.free_map)
        for part, planner in enumerate(PLANNERS):
            notice("pictures", (step + part / len(PLANNERS)) / len(CASES))
            files += _draw(case, planner, result.seeds, out / f"case{number}_{planner.algorithm}")
    notice("pictures", 1.0)
    return files


def _draw(case: Case, planner: Planner, seeds: int, stem: Path) -> list[Path]:
    """Draw the planner's path and the joints along it; return the files, none when there is no path."""
    path, seed = typical_path(case, planner, "nodes", seeds)
    if path is None:
        return []
    how = (
        f"23 of {planner.neighbours} neighbours, seed {seed} (near the median)"
        if planner is CHAOS
        else f"{planner.neighbours} neighbours"
    )
    subtitle = f"{planner.name}, {how}, {path.length_cm:.4f} cm; only nodes checked, as the paper reads"
    files = [stem.with_suffix(".png"), stem.with_name(f"{stem.name}_joints.png")]
    draw_path(files[0], case.scene, case.free_map, path, subtitle=subtitle)
    draw_angles(files[1], case.scene, case.free_map, path, subtitle=subtitle)
    return files
