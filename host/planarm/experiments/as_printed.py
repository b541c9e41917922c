"""What the papers' printed forms do, beside the corrected ones: `planarm compare table2 --as-printed`."""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.experiments.printed import ArcTangent, forward_paper_b, inverse_paper_c, search_paper_c
from planarm.experiments.published import A_STAR, CASES, CHS, MODIFIED, TABLE2, Planner
from planarm.experiments.table2 import Case, load_case
from planarm.experiments.text_table import TextTable, number
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.notice import Notice, silent
from planarm.search.stencils import stencil

Floats = NDArray[np.float64]

ARM_C: Final = Arm((30.0, 20.0), (0.0, 0.0), ((-np.pi, np.pi), (-np.pi, np.pi)))
"""Paper C, section VIII."""
ARM_B: Final = Arm((50.0, 50.0), (0.0, 0.0), ((0.0, 2.0 * np.pi), (-0.5 * np.pi, 0.5 * np.pi)))
"""Paper B, section 6 and Table 1."""


@dataclass(frozen=True, slots=True)
class PrintedEquation:
    """How far the end effector stands from where an equation says, as printed and corrected."""

    equation: str
    reading: str
    poses: int
    """Over all of them the mean and the worst are taken."""
    mean_cm: float
    worst_cm: float
    corrected_worst_cm: float


@dataclass(frozen=True, slots=True)
class PrintedSearch:
    """A planner's length by the printed pseudo-code, by the search that improves open nodes, and as published."""

    case: int
    planner: str
    printed_cm: float
    corrected_cm: float
    published_cm: float


@dataclass(frozen=True, slots=True)
class AsPrinted:
    """Both comparisons."""

    equations: tuple[PrintedEquation, ...]
    searches: tuple[PrintedSearch, ...]


def compare_as_printed(notice: Notice = silent) -> AsPrinted:
    """Run the printed equations and the printed search."""
    notice("as printed", 0.0)
    equations = _equation_9("printed"), _equation_9("atan2"), _equations_1_2()
    runs = list(product(CASES, (A_STAR, MODIFIED, CHS)))
    cases, searches = {case: load_case(case) for case in CASES}, list[PrintedSearch]()
    for case, planner in runs:
        notice("as printed", len(searches) / len(runs))
        searches.append(_search(cases[case], planner))
    notice("as printed", 1.0)
    return AsPrinted(equations, tuple(searches))


def as_printed_tables(result: AsPrinted) -> tuple[TextTable, ...]:
    """Return both comparisons as tables."""
    equations = TextTable(
        "Kinematics as printed: how far the end effector stands from the point (cm)",
        ("equation", "read as", "poses", "mean", "worst", "corrected"),
        tuple(
            (
                e.equation,
                e.reading,
                str(e.poses),
                f"{e.mean_cm:.1f}",
                f"{e.worst_cm:.1f}",
                f"{e.corrected_worst_cm:.0e}",
            )
            for e in result.equations
        ),
        words=2,
    )
    searches = TextTable(
        "Pseudo-code as printed, open nodes never improved: lengths (cm), only nodes checked",
        ("case", "planner", "as printed", "improving", "error", "published"),
        tuple(
            (
                str(s.case),
                s.planner,
                number(s.printed_cm, 4),
                number(s.corrected_cm, 4),
                number(s.printed_cm - s.corrected_cm, 4),
                str(s.published_cm),
            )
            for s in result.searches
        ),
        words=2,
    )
    return equations, searches


def reachable_tips_cm() -> Floats:
    """Return the nodes of paper C's workspace within reach of its arm, the base left out, shape (n, 2)."""
    x, y = np.meshgrid(np.arange(-50.0, 51.0), np.arange(0.0, 51.0))
    r = np.hypot(x, y)
    within = (r >= 10.0) & (r <= 50.0)
    return np.stack([x[within], y[within]], axis=1)


def poses_of_table_1_rad() -> Floats:
    """Return joint angles over paper B's Table 1, a degree apart, shape (n, 2)."""
    theta1, theta2 = np.meshgrid(np.radians(np.arange(0, 361)), np.radians(np.arange(-90, 91)))
    return np.stack([theta1.ravel(), theta2.ravel()], axis=1)


def _equation_9(kind: ArcTangent) -> PrintedEquation:
    tips_cm = reachable_tips_cm()
    q_rad = inverse_paper_c(ARM_C.link_lengths_cm, tips_cm, kind)
    off_cm, exact_cm = (_off_cm(ARM_C, q, tips_cm) for q in (q_rad, inverse_2r(ARM_C, tips_cm, "up")))
    reading = "tan⁻¹ as printed" if kind == "printed" else "atan2, + as printed"
    return PrintedEquation(
        "C, eqs. 7-9", reading, len(tips_cm), float(off_cm.mean()), float(off_cm.max()), float(exact_cm.max())
    )


def _equations_1_2() -> PrintedEquation:
    q_rad = poses_of_table_1_rad()
    tips_cm = forward(ARM_B, q_rad)[:, -1]
    off_cm = np.hypot(*(forward_paper_b(ARM_B.link_lengths_cm, q_rad) - tips_cm).T)
    there_and_back_cm = _off_cm(ARM_B, inverse_2r(ARM_B, tips_cm, "down"), tips_cm)  # eqs. 3-6 are right
    return PrintedEquation(
        "B, eqs. 1-2", "as printed", len(q_rad), *map(float, (off_cm.mean(), off_cm.max(), there_and_back_cm.max()))
    )


def _off_cm(arm: Arm, q_rad: Floats, tips_cm: Floats) -> Floats:
    off_cm: Floats = np.hypot(*(forward(arm, q_rad)[:, -1] - tips_cm).T)
    return off_cm


def _search(case: Case, planner: Planner) -> PrintedSearch:
    task = case.scene.task
    printed_cm = search_paper_c(
        case.free_map, stencil(planner.algorithm, planner.neighbours), task.start_cm, task.goal_cm
    )
    path = case.search(planner, "nodes").path
    corrected_cm = path.length_cm if path else float("nan")
    return PrintedSearch(case.number, planner.name, printed_cm, corrected_cm, TABLE2[case.number, planner].length_cm)
