"""`planarm compare mpdstar`: every claim it prints is held here on a small run of the same code."""

import json
from dataclasses import replace

import numpy as np
import pytest

from planarm.experiments.mpdstar import MpdStar, as_json, as_markdown, findings, tables, write_mpdstar
from planarm.experiments.mpdstar_cases import motors_as_printed, new_obstacle, no_enter_zones, solve_case
from planarm.experiments.mpdstar_growth import ALGORITHMS, PUBLISHED, Saving, growth, savings
from planarm.experiments.mpdstar_scenes import CASES, case_scene
from planarm.workspace.joint_proof import joint_world, pose_spare_cm, prove_joint_line
from planarm.workspace.proof import PROVED


@pytest.fixture(scope="module")
def result():
    rows = growth((91, 273), 5, lambda _nodes: None)
    found = savings(4, 300, lambda _count: None)
    cases = [solve_case(number) for number in (1, 4)]
    return MpdStar(cases, (new_obstacle(), no_enter_zones()), rows, found, motors_as_printed())


def test_the_published_figures_are_the_paper_s():
    """Table 6, and Tables 8 to 11, as docs/errata.md and the paper have them."""
    assert [row[0] for row in PUBLISHED] == [91, 91, 91, 182, 273]
    assert [row[1] for row in PUBLISHED] == [3, 7, 10, 13, 21]
    assert PUBLISHED[-1][2:] == (3.047, 40.849, 2450.375)
    assert [case.printed_total for case in CASES.values()] == [53.61, 113.1, 1702.0, 39.54]
    assert [(case.nodes, case.printed_path) for case in CASES.values()] == [(87, 16), (86, 11), (152, 13), (42, 11)]
    for case in CASES.values():
        if case.printed_joints:
            assert sum(case.printed_joints) == pytest.approx(case.printed_total, abs=0.05)


@pytest.mark.parametrize("number", CASES)
def test_each_case_s_ends_are_free_and_something_is_in_the_way(number):
    scene = case_scene(number)
    world = joint_world(scene)
    start, goal = np.array(scene.task.start_rad), np.array(scene.task.goal_rad)
    assert pose_spare_cm(world, start) > 0.0
    assert pose_spare_cm(world, goal) > 0.0
    assert number == 2 or prove_joint_line(world, start, goal)[0] != PROVED


def test_the_integrated_motion_confirms_the_energy_and_least_travel_costs_more(result):
    for case in result.cases:
        assert case.confirmed_j == pytest.approx(case.total_j, rel=0.01)
        assert case.total_j <= case.shortest_j * (1.0 + 1e-9)
        assert case.run.part(0)[-1] == pytest.approx(case.poses_rad[-1], abs=1e-4)


def test_a_star_and_the_others_expand_as_many_nodes_in_a_first_plan(result):
    """Not what Table 6 says; A* stops at the start, the others expand it, too."""
    for nodes in (91, 273):
        expanded = [row.first_expanded for row in result.rows if row.nodes == nodes]
        assert len(expanded) == len(ALGORITHMS)
        assert max(expanded) - min(expanded) <= 2
    stored, compared, _ = (row.read_off for row in result.rows if row.nodes == 273)
    assert compared > 4 * stored


def test_replans_keep_clear_of_what_came(result):
    for one in result.replans:
        assert one.edges > 0
        assert len(one.after_rad) > 1
        assert one.after_j > one.before_j
        assert (one.after_rad[-1] == one.before_rad[-1]).all()


def test_the_printed_motors_do_not_move_the_arm(result):
    assert abs(result.motors.flat_deg) < 18.0
    assert result.motors.upright_deg < -70.0


def test_a_saving_is_a_share_of_the_shortest_way_s_energy(result):
    assert Saving(1, 3, 3.0, 4.0).share == 0.25
    assert all(-1e-9 <= one.share < 1.0 for one in result.savings)


def test_tables_page_pictures_and_json(result, tmp_path):
    small = replace(result, cases=result.cases[:1])
    files = write_mpdstar(small, tmp_path, lambda _stage, _share: None)
    assert all(path.stat().st_size > 0 for path in files)
    told = json.loads((tmp_path / "mpdstar.json").read_text())
    assert told == as_json(small)
    assert len(told["findings"]) == len(findings(small))
    assert next(table.title for table in tables(small)) in as_markdown(small)
    for table in tables(small):
        assert all(len(row) == len(table.header) for row in table.rows)
