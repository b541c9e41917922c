"""Paper A's four cases (Tables 8 to 11), its two replans (Figs. 16 and 17), and Table 7's motors as printed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.dc_motor import Control, DcMotors, Move, Run, integrate, motor_spec, resting_state, run_moves
from planarm.dynamics.energy import edge_duration_s
from planarm.dynamics.rigid_body import RigidBody
from planarm.experiments.mpdstar_scenes import CASES, ZONES_CM, case_scene, zones_scene
from planarm.model.shapes import Circle, Polygon
from planarm.roadmap.planning import RoadmapTask, way_energy_j
from planarm.scene import Scene
from planarm.search.incremental import GraphAnswer

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_SEEDS = 200
DENSE_NODES = 2000
STEP_S = 1e-4
TOLERANCE_CM = 3.0
"""Fig. 17's threshold, which the paper does not print."""


@dataclass(frozen=True, slots=True, eq=False)
class CaseResult:
    """One case on one graph."""

    number: int
    scene: Scene
    nodes: int
    seed: int
    poses_rad: Floats
    """The way, shape (m, joints)."""
    joints_j: Floats
    """Energy consumed by each joint, shape (joints,)."""
    shortest_j: float
    """What the way of least joint travel on the same graph consumes."""
    confirmed_j: float
    """The integrated motion's: RK4 with PD and feed-forward, winding energy included."""
    run: Run
    expanded: int
    search_ms: float
    """Of the search, edges' energies included."""

    @property
    def total_j(self) -> float:
        """Energy consumed by all joints."""
        return float(self.joints_j.sum())


def solve_case(number: int, nodes: int | None = None) -> CaseResult:
    """Plan a case with the paper's number of nodes, or another, and integrate its motion.

    The first seed is taken whose graph joins start and goal.
    """
    for seed in range(1, MOST_SEEDS):
        scene = case_scene(number, nodes, seed)
        task = RoadmapTask.of(scene, scene.margin_cm)
        began_s = perf_counter()
        answer = task.planner.solve()
        search_ms = 1e3 * (perf_counter() - began_s)
        if len(answer.nodes):
            break
    else:
        raise ValueError(f"no graph of case {number} joins start and goal")
    poses = task.roadmap.poses_rad[answer.nodes]
    made = run_way(scene, task, poses)
    short = case_scene(number, nodes, seed, "travel")
    shortest = RoadmapTask.of(short, short.margin_cm).planner.solve()
    return CaseResult(
        number,
        scene,
        scene.roadmap.nodes,
        seed,
        poses,
        way_energy_j(task.roadmap, answer.nodes),
        float(way_energy_j(task.roadmap, shortest.nodes).sum()),
        float(made.part(3)[-1].sum()),
        made,
        answer.work.expanded,
        search_ms,
    )


def run_way(scene: Scene, task: RoadmapTask, poses_rad: Floats) -> Run:
    """Integrate the motion along a way, resting at every configuration."""
    model = task.roadmap.model
    moves = [Move(a, b, edge_duration_s(model, a, b)) for a, b in pairwise(poses_rad)]
    return run_moves(model.body, DcMotors.of(scene), Control.of(motor_spec(scene)), moves, STEP_S)


@dataclass(frozen=True, slots=True, eq=False)
class ReplanResult:
    """A plan, what came in its way, and the plan then."""

    title: str
    scene: Scene
    added: tuple[Circle | Polygon, ...]
    before_rad: Floats
    after_rad: Floats
    """From where the arm was when it learned of the obstacle."""
    before_j: float
    """Of what was left of the old way."""
    after_j: float
    edges: int
    """Directed edges that the obstacle closed."""
    tolerance_cm: float
    repair: GraphAnswer
    first: GraphAnswer


def new_obstacle() -> ReplanResult:
    """Replan the crowded case when an obstacle appears further along the way (Fig. 16)."""
    scene = case_scene(2, DENSE_NODES)
    task = RoadmapTask.of(scene, scene.margin_cm)
    first = task.planner.solve()
    at = len(first.nodes) // 4
    x, y = _tips_cm(task, first.nodes)[at + 6]
    return _replanned("new obstacle", scene, task, first, at, (Circle((float(x), float(y)), 2.0),), 0.0)


def no_enter_zones() -> ReplanResult:
    """Replan when the triangles on both sides turn out to be too hot to come near (Fig. 17)."""
    scene = zones_scene(DENSE_NODES)
    task = RoadmapTask.of(scene, scene.margin_cm)
    first = task.planner.solve()
    zones = tuple(Polygon(zone) for zone in ZONES_CM)
    return _replanned('"no enter" zones', scene, task, first, 0, zones, TOLERANCE_CM)


def _replanned(
    title: str,
    scene: Scene,
    task: RoadmapTask,
    first: GraphAnswer,
    at: int,
    shapes: tuple[Circle | Polygon, ...],
    tolerance_cm: float,
) -> ReplanResult:
    task.planner.move_start(int(first.nodes[at]))
    edges = 0
    for shape in shapes:
        _, changes = task.roadmap.add_obstacle(shape, tolerance_cm)
        task.planner.change(changes)
        edges += len(changes.edges)
    repair = task.planner.solve()
    poses = task.roadmap.poses_rad
    return ReplanResult(
        title,
        scene,
        shapes,
        poses[first.nodes],
        poses[repair.nodes],
        float(way_energy_j(task.roadmap, first.nodes[at:]).sum()),
        float(way_energy_j(task.roadmap, repair.nodes).sum()),
        edges,
        tolerance_cm,
        repair,
        first,
    )


def _tips_cm(task: RoadmapTask, nodes: Ints) -> Floats:
    world = task.roadmap.world
    headings = np.cumsum(task.roadmap.poses_rad[nodes], axis=1)
    x = world.base_x_cm + (world.lengths_cm * np.cos(headings)).sum(axis=1)
    return np.stack([x, world.base_y_cm + (world.lengths_cm * np.sin(headings)).sum(axis=1)], axis=1)


@dataclass(frozen=True, slots=True)
class PrintedMotors:
    """What Table 7's motors do when joint 1 of a three-link arm is asked to turn by half a turn in ten seconds."""

    flat_deg: float
    """How far it gets with the arm lying flat, five more seconds given."""
    upright_deg: float
    """Where it is after thirty seconds with the arm upright, from level."""


def motors_as_printed() -> PrintedMotors:
    """Run Table 7 (signs of eq. 2 corrected; J, Kd and a gear are not printed): three links of 0.3 m and 0.1 kg."""
    one = np.ones(3)
    motors = DcMotors(one, 0.5 * one, 0.01 * one, 0.02 * one, 0.0 * one, 0.1 * one, one, 0.0 * one)
    control = Control(0.1 * one, 0.0 * one, False)
    lengths, masses = 0.3 * one, 0.1 * one
    told = []
    for gravity, duration_s, settle_s in (((0.0, 0.0), 10.0, 5.0), ((0.0, -9.80665), 30.0, 0.0)):
        body = RigidBody.from_links(lengths, masses, 0.5 * lengths, masses * 0.09 / 12.0, 0.0, gravity)
        move = Move(np.zeros(3), np.array([np.pi, 0.0, 0.0]), duration_s)
        state = resting_state(body, motors, move.start_rad)
        state[6:9] = 0.0  # nothing has held the arm before
        state = integrate(body, motors, control, move, state, int(500 * duration_s))[-1]
        if settle_s:
            hold = Move(move.end_rad, move.end_rad, settle_s)
            state = integrate(body, motors, control, hold, state, int(500 * settle_s))[-1]
        told.append(float(np.degrees(state[0])))
    return PrintedMotors(*told)


def paper_cases() -> list[CaseResult]:
    """Return all cases with the paper's number of nodes, and with two thousand."""
    return [solve_case(number, nodes) for number in CASES for nodes in (None, DENSE_NODES)]
