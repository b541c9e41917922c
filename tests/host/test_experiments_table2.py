"""Paper C's Table II beside ours: the published percentages follow the paper's rule, our lengths the reconstruction."""

import json
from dataclasses import replace
from itertools import pairwise, product
from math import floor, sqrt

import pytest

from planarm.cli.main import main
from planarm.experiments.lattice_lengths import steps_of_length
from planarm.experiments.published import A_STAR, CASES, CHAOS, CHS, MODIFIED, PLANNERS, TABLE2
from planarm.experiments.table2 import compare_table2, load_case, percentages, typical_path
from planarm.experiments.table2_folder import write_table2
from planarm.experiments.table2_tables import as_json, as_markdown, findings, tables
from planarm.search.stencils import cover

SEEDS = 40


@pytest.fixture(scope="module")
def result():
    return compare_table2(SEEDS)


def row_of(result, case, planner):
    return next(row for row in result.rows if (row.case, row.planner) == (case, planner.name))


def cut(percent):
    """Two decimals, the rest cut off."""
    return floor(100.0 * percent) / 100.0


def test_all_16_published_percentages_are_the_papers_rule_cut_off_after_two_decimals(result):
    assert len(result.improvements) == 16
    assert [cut(one.published.paper_rule) for one in result.improvements] == [
        one.printed for one in result.improvements
    ]


def test_the_two_rules():
    assert percentages(80.0, 50.0).paper_rule == 60.0
    assert percentages(80.0, 50.0).usual_rule == 37.5
    assert percentages(50.0, 80.0).usual_rule == -60.0


def test_the_table_holds_each_planner_and_case_once():
    assert set(TABLE2) == set(product(CASES, PLANNERS))


@pytest.mark.parametrize(
    ("case", "planner", "nodes_cm", "proved_cm"),
    [
        (1, A_STAR, 29 + 31 * sqrt(2), 29 + 31 * sqrt(2)),
        (2, A_STAR, 17 + 38 * sqrt(2), 17 + 38 * sqrt(2)),
        (1, MODIFIED, 69.6340, 69.6340),
        (2, MODIFIED, 69.1368, 69.3150),
        (1, CHS, 68.98427, 68.98427),
        (2, CHS, 68.32806, 68.79158),
    ],
)
def test_our_lengths_are_the_reconstructions(result, case, planner, nodes_cm, proved_cm):
    """The first from an independent search over start, goal, shapes and margin; proved as docs/planners.md has them."""
    row = row_of(result, case, planner)
    assert row.nodes.length_cm == pytest.approx(nodes_cm, abs=5e-5)
    assert row.proved.length_cm == pytest.approx(proved_cm, abs=5e-5)


def test_our_improvements_are_those_of_our_lengths_and_times(result):
    for one in result.improvements:
        planner = next(planner for planner in PLANNERS if planner.name == one.planner)
        base, row = row_of(result, one.case, A_STAR), row_of(result, one.case, planner)
        for moves in ("nodes", "proved"):
            ours, reference = getattr(row, moves), getattr(base, moves)
            key = "length_cm" if one.quantity == "length" else "time_ms"
            new, old = getattr(ours, key), getattr(reference, key)
            assert getattr(one, moves).paper_rule == pytest.approx(100 * (old / new - 1))
            assert getattr(one, moves).usual_rule == pytest.approx(100 * (1 - new / old))


def chs_like_cm(case, one):
    """The octagon's own shortest length: Chaos A* that draws all of it, by the square or disc that holds it."""
    holder = {8: A_STAR, 20: MODIFIED, 44: replace(MODIFIED, neighbours=48), 68: replace(CHS, neighbours=80)}
    return case.search(holder[one.neighbours], one.moves).path.length_cm if one.neighbours != 68 else 0.0


def test_chaos_a_star_is_a_distribution_never_shorter_than_with_its_whole_octagon(result):
    assert len({(one.case, one.moves, one.subset, one.neighbours) for one in result.scatter}) == 2 * 2 * 2 * 4
    cases = {number: load_case(number) for number in CASES}
    for one in result.scatter:
        planner = replace(CHAOS, neighbours=one.neighbours)
        found = [cases[one.case].search(planner, one.moves, seed, one.subset).path for seed in range(SEEDS)]
        whole = chs_like_cm(cases[one.case], one)
        assert one.shortest_cm >= whole - 1e-9
        lengths = sorted(path.length_cm for path in found if path is not None)
        assert one.no_path == SEEDS - len(lengths)
        assert (one.shortest_cm, one.longest_cm) == (lengths[0], lengths[-1])
        assert sum(length <= one.median_cm for length in lengths) * 2 >= len(lengths)
        assert sum(length >= one.median_cm for length in lengths) * 2 >= len(lengths)
        assert one.shortest_cm <= one.p5_cm <= one.median_cm <= one.p95_cm <= one.longest_cm
        shorter = sum(length <= one.published_cm for length in lengths)
        assert one.published_or_shorter == pytest.approx(shorter / len(lengths))


def test_the_row_of_chaos_a_star_is_the_median_of_runs(result):
    for one in result.scatter:
        if one.subset == "run" and one.as_published:
            assert getattr(row_of(result, one.case, CHAOS), one.moves).length_cm == one.median_cm


def test_proving_moves_never_shortens_a_path(result):
    for row in result.rows:
        assert row.proved.length_cm >= row.nodes.length_cm


def test_parity_and_length_of_steps_hold_for_real_paths():
    """The arithmetic, held against a path that the search found."""
    for number in CASES:
        points = load_case(number).search(MODIFIED, "nodes").path.points_cm
        dx, dy = points[-1] - points[0]
        length_cm = load_case(number).search(MODIFIED, "nodes").path.length_cm
        possible = steps_of_length(length_cm, 1.0, 9, knights=True)
        assert [steps.odd for steps in possible] == [round(dx + dy) % 2 == 1]


def test_case_2_of_chs_hops_over_blocked_nodes_when_only_nodes_are_checked():
    case = load_case(2)
    nodes = [tuple(map(round, point)) for point in case.search(CHS, "nodes").path.points_cm]
    column, row = round(case.free_map.x_cm[0]), round(case.free_map.y_cm[0])
    crossed = [(a[0] + x, a[1] + y) for a, b in pairwise(nodes) for x, y in cover(b[0] - a[0], b[1] - a[1])]
    assert any(case.free_map.region[y - row, x - column] for x, y in crossed)


def test_only_paths_with_unproved_moves_come_nearer_than_the_margin(result):
    """CHS in case 2 to 1.9 mm, as docs/planners.md says; the margin is 4 mm."""
    for row in result.rows:
        if row.planner != CHAOS.name:
            assert row.proved.clearance_cm > 0.4
    assert row_of(result, 2, CHS).nodes.clearance_cm == pytest.approx(0.190, abs=5e-4)
    assert row_of(result, 2, MODIFIED).nodes.clearance_cm < 0.4
    told = next(sentence for sentence in findings(result) if "4 mm" in sentence)
    assert "Modified A* in case 2 to 3.74 mm, CHS in case 2 to 1.90 mm" in told


def test_the_typical_path_of_chaos_a_star_is_near_the_median(result):
    path, seed = typical_path(load_case(1), CHAOS, "nodes", SEEDS)
    one = next(
        one for one in result.scatter if (one.case, one.neighbours, one.moves, one.subset) == (1, 44, "nodes", "run")
    )
    assert load_case(1).search(CHAOS, "nodes", seed).path.length_cm == path.length_cm <= one.median_cm
    assert path.length_cm > one.p5_cm


def test_no_seeds_is_refused():
    with pytest.raises(ValueError, match="below 1"):
        compare_table2(0)


def test_every_figure_reaches_the_json(result):
    told = json.loads(json.dumps(as_json(result), allow_nan=False))
    assert {"source", "assumed", "not_reproduced", "seeds", "maps", "rows", "improvements", "scatter"} == set(told)
    assert [len(told[key]) for key in ("maps", "rows", "improvements", "scatter")] == [2, 8, 16, 32]
    first = told["rows"][0]
    assert first["published"]["length_cm"] == 72.8406
    assert first["nodes"]["length_cm"] == pytest.approx(72.84062, abs=5e-6)
    assert {"length_cm", "time_ms", "clearance_cm"} == set(first["proved"])
    assert told["improvements"][14]["published"]["usual_rule"] == pytest.approx(63.82, abs=0.005)
    assert told["scatter"][0]["no_path_share"] == told["scatter"][0]["no_path"] / SEEDS
    assert [one["free_nodes"] for one in told["maps"]] == [2129, 2708]


def test_what_is_not_a_number_is_null_in_json_and_none_in_words(result):
    first = next(i for i, one in enumerate(result.scatter) if one.as_published)
    lost = replace(result.scatter[first], no_path=SEEDS, median_cm=float("nan"), published_or_shorter=float("nan"))
    without = replace(result, scatter=(*result.scatter[:first], lost, *result.scatter[first + 1 :]))
    assert as_json(without)["scatter"][first]["median_cm"] is None
    assert "none" in tables(without)[-1].rows[first]
    assert any("none %" in sentence for sentence in findings(without))


def test_the_markdown_has_every_row_of_every_table(result):
    text = as_markdown(result)
    shown = tables(result)
    assert [len(table.rows) for table in shown] == [8, 8, 8, 8, 32]
    for table in shown:
        assert table.title in text
        assert all(len(cells) == len(table.header) for cells in table.rows)
        assert all(f"| {' | '.join(cells)} |" in text for cells in table.rows)
    assert "| 1 | CHS | 56 | 68.984 | 68.9843 | 68.9843 |" in text


def test_the_folder_holds_the_tables_and_a_picture_for_each_planner_and_case(result, tmp_path):
    files = write_table2(result, tmp_path / "new" / "folder")
    assert sorted(files) == sorted((tmp_path / "new" / "folder").iterdir())
    pictures = {file.stem for file in files if file.suffix == ".png"}
    paths = {f"case{case}_{planner.algorithm}" for case in CASES for planner in PLANNERS}
    spaces = {f"case{case}_free_space" for case in CASES}
    assert pictures == paths | {f"{name}_joints" for name in paths} | spaces | {"stencils"}
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files if file.suffix == ".png")
    assert json.loads((tmp_path / "new" / "folder" / "table2.json").read_text()) == as_json(result)


def test_the_command_prints_json_alone(capsys):
    with pytest.raises(SystemExit) as left:
        main(["compare", "table2", "--seeds", "3", "--json"])
    captured = capsys.readouterr()
    assert left.value.code == 0
    assert json.loads(captured.out)["seeds"] == 3


def test_the_command_prints_tables_and_what_is_not_reproduced(capsys):
    with pytest.raises(SystemExit) as left:
        main(["compare", "table2", "--seeds", "3"])
    out = " ".join(capsys.readouterr().out.split())
    assert left.value.code == 0
    for words in ("72.8406", "176.39", "63.82", "Modified A*: not reproduced", "29 + 31 √2", "reconstruction"):
        assert words in out


@pytest.mark.parametrize("words", [["--seeds", "0"], ["--seeds", "many"], ["table3"]])
def test_bad_words_are_exit_code_2(capsys, words):
    with pytest.raises(SystemExit) as left:
        main(["compare", *(["table2"] if words[0] == "--seeds" else []), *words])
    assert left.value.code == 2
    assert capsys.readouterr().out == ""


def test_a_folder_that_cannot_be_made_is_bad_input(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as left:
        main(["compare", "table2", "--out", str(tmp_path / "file" / "folder"), "--json"])
    error = json.loads(capsys.readouterr().out)["error"]
    assert left.value.code == error["exit_code"] == 2
    assert str(tmp_path / "file" / "folder") in error["message"]
