"""The comparison of Table II in words: its tables, what is assumed, and what is not reproduced and why."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from math import isnan
from typing import Any

from planarm.experiments.lattice_lengths import Steps, steps_of_length
from planarm.experiments.published import A_STAR, CHAOS, CHS, LENGTH_DECIMALS, MODIFIED, SOURCE, TABLE2
from planarm.experiments.table2 import QUANTITIES, RUNS, Improvement, Percentages, Quantity, Row, Scatter, Table2
from planarm.experiments.text_table import TextTable, number


def as_json(result: Table2) -> dict[str, Any]:
    """Return the whole comparison for JSON; what could not be computed is null."""
    told = {"source": SOURCE, "assumed": assumptions(result), "not_reproduced": findings(result), **asdict(result)}
    for entry, one in zip(told["scatter"], result.scatter, strict=True):
        entry["no_path_share"] = one.no_path_share
    without_nan: dict[str, Any] = _without_nan(told)
    return without_nan


def as_markdown(result: Table2) -> str:
    """Return the comparison as a Markdown document."""
    parts = ["# Paper C, Table II, computed anew", f"Published: {SOURCE}."]
    parts += ["## What is assumed", _bullets(assumptions(result))]
    parts += [table.markdown() for table in tables(result)]
    parts += ["## What is reproduced, and what is not", _bullets(findings(result))]
    return "\n\n".join(parts) + "\n"


def tables(result: Table2) -> tuple[TextTable, ...]:
    """Return lengths, times, improvements and the scatter of Chaos A*."""
    improvements = (_improvements(result, quantity) for quantity in QUANTITIES)
    return (_lengths(result), _times(result), *improvements, _scatter(result))


def assumptions(result: Table2) -> tuple[str, ...]:
    """Say what the paper leaves open and what is taken here."""
    first, second = result.maps
    return (
        f"Start (49, 2), goal (1, 45), a margin of {first.margin_cm:g} cm around the obstacles, four circles in case "
        "1, an axis-aligned square and two circles in case 2: a reconstruction, not the paper's scenario, which it "
        "does not print. It was found by fitting lengths, and other pairs of start and goal fit A*'s as well.",
        f"Nodes at multiples of {first.cell_cm:g} cm; free are {first.free_nodes} in case 1, {second.free_nodes} in "
        "case 2.",
        '"nodes" is the paper\'s reading: only the node at the end of a move must be free. "proved": the whole arm is '
        "proved free all along the move. Both on the same map.",
        f"Chaos A* draws 23 of 44 neighbours, once a run; its figures are medians over {result.seeds} seeds.",
        f"Our times are medians of {RUNS} warm searches on this machine, the map being built "
        f"({first.build_ms:.2f} and {second.build_ms:.2f} ms more). The paper's are from MATLAB on a machine that it "
        "does not name, and it does not say what they include: compare within a column, not across.",
    )


def findings(result: Table2) -> tuple[str, ...]:
    """Say what is reproduced, what is not, and why."""
    rows = {(row.case, row.planner): row for row in result.rows}
    chs = [rows[case, CHS.name] for case in (1, 2)]
    modified = [rows[case, MODIFIED.name] for case in (1, 2)]
    return (
        "A*: both lengths to the last printed digit. The reconstruction was chosen so.",
        f"CHS: {chs[0].nodes.length_cm:.4f} and {chs[1].nodes.length_cm:.4f} cm against {chs[0].published.length_cm:g} "
        f"and {chs[1].published.length_cm:g}: all digits in case 1, in case 2 "
        f"{10 * (chs[1].nodes.length_cm - chs[1].published.length_cm):.2f} mm longer. Case 2's path hops over blocked "
        f"cells; proved free it is {chs[1].proved.length_cm:.4f} cm.",
        *_collision_findings(result),
        _modified_finding(modified[0].nodes.length_cm, modified[1].nodes.length_cm),
        _chaos_finding(result),
        "Improvements: the paper divides by the new value and cuts off after two decimals; so all 16 come out. "
        f"By the usual rule its {TABLE2[2, CHAOS].time_improvement_percent:g} % is "
        f"{_published_time(result, 2).usual_rule:.1f} %, its {TABLE2[1, CHAOS].time_improvement_percent:g} % is "
        f"{_published_time(result, 1).usual_rule:.1f} %.",
        _time_finding([row for row in result.rows if row.planner in (A_STAR.name, CHAOS.name)]),
    )


def _collision_findings(result: Table2) -> Iterator[str]:
    """Name the paths under the paper's reading on which a link comes too near to an obstacle between nodes."""
    margin_cm = {one.case: one.margin_cm for one in result.maps}
    too_near = [
        f"{row.planner} in case {row.case} to {10 * row.nodes.clearance_cm:.2f} mm"
        for row in result.rows
        if row.nodes.clearance_cm <= margin_cm[row.case]
    ]
    if too_near:
        yield (
            f"Checking only nodes lets a link's centre line come nearer to an obstacle than the margin of "
            f"{10 * result.maps[0].margin_cm:g} mm: {', '.join(too_near)}. No proved path does."
        )


def _modified_finding(case1_cm: float, case2_cm: float) -> str:
    base_cm, first_cm, second_cm = (
        TABLE2[1, A_STAR].length_cm,
        TABLE2[1, MODIFIED].length_cm,
        TABLE2[2, MODIFIED].length_cm,
    )
    (base,) = steps_of_length(base_cm, 1.0, LENGTH_DECIMALS, knights=False)
    (first,) = steps_of_length(first_cm, 1.0, LENGTH_DECIMALS, knights=True)
    return (
        f"Modified A*: not reproduced; the method gives {case1_cm:.4f} and {case2_cm:.4f} cm here, and on cells of "
        f"1 cm the published lengths cannot come from it, whatever start, goal and obstacles are. {base_cm:.4f} = "
        f"{_sum(base)} is the only 8-neighbour length that rounds so, and joins nodes whose dx + dy is "
        f"{_parity(base)}; {first_cm:.4f} = {_sum(first)} is the only 24-neighbour length that rounds so, and joins "
        f"nodes whose dx + dy is {_parity(first)}. One start and goal cannot have both. {second_cm:.4f} is no "
        "24-neighbour length at all, on cells of 1 or 0.5 cm, and stands in the table twice, under Chaos A* too."
    )


def _chaos_finding(result: Table2) -> str:
    spread = [one for one in result.scatter if one.as_published and one.moves == "nodes" and one.subset == "run"]
    shares = " and ".join(f"{number(100 * one.published_or_shorter, 0)} %" for one in spread)
    lost = " and ".join(str(one.no_path) for one in spread)
    return (
        "Chaos A*: one published length is one draw of a random subset, so there is nothing to hit. Of our paths "
        f"{shares} are as short as the published ones or shorter; {lost} of {result.seeds} seeds find none. The paper "
        "does not say when it draws: drawn anew at every node the lengths scatter less."
    )


def _time_finding(rows: Sequence[Row]) -> str:
    """Compare Chaos A*'s time with A*'s; the rows are A*, Chaos A* of case 1, then of case 2."""
    pairs = list(zip(rows[::2], rows[1::2], strict=True))
    ours = " and ".join(f"{number(chaos.nodes.time_ms / base.nodes.time_ms, 2)}" for base, chaos in pairs)
    theirs = " and ".join(f"{chaos.published.time_s / base.published.time_s:.2f}" for base, chaos in pairs)
    return (
        "Times: all eight published ones are multiples of 1/64 s, the tick of a clock. The paper's Chaos A* takes "
        f"{theirs} of its A*'s time; ours {ours}, with only nodes checked: it looks at 23 neighbours where A* looks "
        "at 8, and one and the same search serves both."
    )


def _published_time(result: Table2, case: int) -> Percentages:
    return next(
        one.published
        for one in result.improvements
        if (one.case, one.planner, one.quantity) == (case, CHAOS.name, "time")
    )


def _sum(steps: Steps) -> str:
    knights = f" + {steps.knight} √5" if steps.knight else ""
    return f"{steps.straight} + {steps.diagonal} √2{knights}"


def _parity(steps: Steps) -> str:
    return "odd" if steps.odd else "even"


def _lengths(result: Table2) -> TextTable:
    header = ("case", "planner", "neighbours", "published", "ours, nodes", "ours, proved")
    return TextTable("Lengths (cm)", header, tuple(_length_cells(row) for row in result.rows), words=3)


def _length_cells(row: Row) -> tuple[str, ...]:
    neighbours = f"23 of {row.neighbours}" if row.planner == CHAOS.name else str(row.neighbours)
    ours = (number(one.length_cm, LENGTH_DECIMALS) for one in (row.nodes, row.proved))
    return (str(row.case), row.planner, neighbours, str(row.published.length_cm), *ours)


def _times(result: Table2) -> TextTable:
    header = ("case", "planner", "published (s)", "ours, nodes (ms)", "ours, proved (ms)")
    return TextTable("Times", header, tuple(_time_cells(row) for row in result.rows), words=2)


def _time_cells(row: Row) -> tuple[str, ...]:
    ours = (number(one.time_ms, 3) for one in (row.nodes, row.proved))
    return (str(row.case), row.planner, str(row.published.time_s), *ours)


def _improvements(result: Table2, quantity: Quantity) -> TextTable:
    sides = tuple(f"{side} {rule}" for side in ("paper", "nodes", "proved") for rule in ("/new", "/A*"))
    title = f"Improvement of the {quantity} over A* (%): (A* - new) / new is the paper's rule, / A* the usual one"
    rows = tuple(_improvement_cells(one) for one in result.improvements if one.quantity == quantity)
    return TextTable(title, ("case", "planner", "printed", *sides), rows, words=2)


def _improvement_cells(one: Improvement) -> tuple[str, ...]:
    pairs = (one.published, one.nodes, one.proved)
    values = (number(value, 2) for pair in pairs for value in (pair.paper_rule, pair.usual_rule))
    return (str(one.case), one.planner, f"{one.printed:.2f}", *values)


def _scatter(result: Table2) -> TextTable:
    header = ("case", "moves", "drawn", "per", "no path", "5 %", "median", "95 %", "as short")
    title = f"Chaos A* over {result.seeds} seeds: lengths (cm), and the share as short as the published length"
    return TextTable(title, header, tuple(_scatter_cells(one) for one in result.scatter), words=4)


def _scatter_cells(one: Scatter) -> tuple[str, ...]:
    drawn = f"{one.drawn} of {one.neighbours}"
    lengths = (number(length, 2) for length in (one.p5_cm, one.median_cm, one.p95_cm))
    short = f"{number(100 * one.published_or_shorter, 0)} %"
    return (str(one.case), one.moves, drawn, one.subset, f"{100 * one.no_path_share:.1f} %", *lengths, short)


def _bullets(sentences: tuple[str, ...]) -> str:
    return "\n".join(f"- {sentence}" for sentence in sentences)


def _without_nan(value: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and isnan(value) else value
