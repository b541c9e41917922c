"""The open benchmark: its scenes are the ones in the data file, its optima exact, its judge neither kind nor unkind."""

import json
import sys
from math import dist, hypot
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from planarm.cli.main import main
from planarm.experiments.benchmark_scenes import BOUND, SCENES, benchmark_scene, problem, scene_hash
from planarm.experiments.external import judge, read_optima, score_external
from planarm.experiments.node_optimum import line_is_legal, shortest_through_nodes
from planarm.search.grid_search import find_path
from planarm.workspace.world import FREE

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = f"{sys.executable} {ROOT / 'examples' / 'external_planner.py'}"


def quick_scenes(count):
    """Scenes whose ends are near to each other, so that all pairs are soon tried."""
    numbers = (k for k in range(SCENES) if dist(*ends(benchmark_scene(k)[0])) < 32)
    return [next(numbers) for _ in range(count)]


def ends(scene):
    return scene.task.start_cm, scene.task.goal_cm


def test_the_data_file_holds_every_scene_once_with_its_hash(sized):
    optima = read_optima()
    assert len(optima) == SCENES == 1000
    assert len({one.hash for one in optima}) == SCENES
    for k in range(0, SCENES, sized(50, 1)):
        scene, _ = benchmark_scene(k)
        assert scene_hash(scene) == optima[k].hash, k
        assert hypot(*np.subtract(*ends(scene))) < optima[k].optimum_cm


def test_the_optima_are_those_of_all_pairs_by_scipy(sized):
    """Dijkstra over all legal pairs of nodes in the ellipse that holds every path no longer than a known one."""
    optima = read_optima()
    for k in quick_scenes(sized(1, 12)):
        scene, free_map = benchmark_scene(k)
        start, goal = ends(scene)
        known = find_path(free_map, start, goal, BOUND).path.length_cm
        rows, columns = np.nonzero(free_map.region == FREE)
        nodes = np.stack([free_map.x_cm[columns], free_map.y_cm[rows]], axis=1)
        around = np.hypot(*(nodes - start).T) + np.hypot(*(nodes - goal).T) <= known + 1e-9
        nodes = nodes[around]
        pairs = [
            (i, j, dist(nodes[i], nodes[j]))
            for i in range(len(nodes))
            for j in range(i)
            if line_is_legal(free_map.world, *nodes[i], *nodes[j])
        ]
        i, j, length = zip(*pairs, strict=True)
        graph = coo_array((length, (i, j)), (len(nodes), len(nodes))).tocsr()
        here, there = (int(np.argmin(np.hypot(*(nodes - point).T))) for point in (start, goal))
        exact = dijkstra(graph, directed=False, indices=here)[there]
        assert optima[k].optimum_cm == pytest.approx(exact, abs=1e-8), k
        path = shortest_through_nodes(free_map, start, goal)
        assert path.length_cm == pytest.approx(exact, abs=1e-9), k


def test_no_planner_of_ours_is_shorter_than_an_optimum(sized):
    optima = read_optima()
    for k in range(0, SCENES, sized(40, 4)):
        scene, free_map = benchmark_scene(k)
        path = find_path(free_map, *ends(scene), BOUND).path
        verdict, length = judge(json.dumps({"points_cm": path.points_cm.tolist()}), scene, free_map)
        assert verdict == "solved", k
        assert length == pytest.approx(path.length_cm)
        assert length >= optima[k].optimum_cm - 1e-8, k


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (lambda p: p, "solved"),
        (lambda p: None, "no path"),
        (lambda p: [p[0], [p[1][0] + 0.5, p[1][1]], *p[2:]], "off the nodes"),
        (lambda p: p[:-1], "not from start to goal"),
        (lambda p: [p[0], p[-1]], "not proved free"),
        (lambda p: [[float("nan"), 0.0], *p], "not as docs/benchmark.md says"),
        (lambda p: p[:1], "not as docs/benchmark.md says"),
        (lambda p: "here", "not as docs/benchmark.md says"),
    ],
)
def test_the_judge(change, verdict):
    scene, free_map = benchmark_scene(3)
    points = find_path(free_map, *ends(scene), BOUND).path.points_cm.tolist()
    told, length = judge(json.dumps({"points_cm": change(points)}), scene, free_map)
    assert told == verdict
    assert (length is not None) == (verdict == "solved")


@pytest.mark.parametrize(
    ("line", "verdict"),
    [("", "no answer"), ("{", "not as docs/benchmark.md says"), ("3", "not as docs/benchmark.md says")],
)
def test_lines_that_are_no_answer(line, verdict):
    assert judge(line, *benchmark_scene(3)) == (verdict, None)


def test_the_sample_planner_solves_what_it_answers_and_is_never_below_the_optimum():
    score = score_external(SAMPLE, 2, 60.0)
    assert [one.verdict for one in score.answers].count("solved") == 2
    for one in score.answers:
        assert one.verdict in ("solved", "no path")
        assert one.gap_percent is None or one.gap_percent > -1e-6


def test_a_planner_that_dies_or_is_late_leaves_no_answers():
    dead = score_external(f"{sys.executable} -c pass", 2, 10.0)
    late = score_external(f'{sys.executable} -c "import time; time.sleep(60)"', 2, 0.2)
    for score in (dead, late):
        assert [one.verdict for one in score.answers] == ["no answer", "no answer"]
        assert score.fields()["optimal"] == 0 and score.silent


def test_a_planner_without_any_answer_is_an_error_not_a_score(capsys):
    with pytest.raises(SystemExit) as left:
        main(["compare", "--external", f"{sys.executable} -c pass", "--scenes", "2", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert left.value.code == 2
    assert "answered none of 2 scenes" in told["error"]["message"] and "--timeout-s" in told["error"]["message"]


def test_a_problem_says_all_that_docs_name():
    text = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    told = {"scene": 0, **problem(benchmark_scene(0)[0])}
    assert all(f"`{key}`" in text for key in told)


def test_the_command_scores_a_planner(capsys):
    with pytest.raises(SystemExit) as left:
        main(["compare", "--external", SAMPLE, "--scenes", "1", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert left.value.code == 0
    assert told["scenes"] == 1 and len(told["answers"]) == 1


@pytest.mark.parametrize("words", [[], ["table2", "--external", "x"], ["--external", "no-such-program-here"]])
def test_bad_words_are_exit_code_2(capsys, words):
    with pytest.raises(SystemExit) as left:
        main(["compare", *words])
    assert left.value.code == 2
    assert capsys.readouterr().out == ""
