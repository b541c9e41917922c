"""Find a spline in joint space that takes little time: several starts, a race between them, and the winner made finer.

Anytime: at every moment the best spline that is proved free is at hand, and it only gets better. The race and the
refinement are CMA-ES on the inner control points, judged by `planarm.fastest.cost`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from planarm.fastest.cost import Problem, costs
from planarm.fastest.evolution import Evolution
from planarm.fastest.spline_basis import greville, span_basis, spread
from planarm.fastest.starts import short_ways
from planarm.model.arm import Arm
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.limits import Limits
from planarm.workspace.joint_proof import JointWorld, pose_spare_cm, prove_pieces
from planarm.workspace.proof import PROVED

Clock = Callable[[], float]
"""Seconds of a clock that never goes back."""

Told = Callable[[float, float], None]
"""Told the share of the budget that is used, and the best duration in seconds so far (infinite before the first)."""

CONTROLS = (8, 11, 15, 20)
"""Control points in the race, and after each refinement."""

WAYS = 5
"""Ways through joint space that are tried for each pair of end poses."""

HEATS = (60, 120, 240)
FINALISTS = 3
"""Generations of each heat of the race; after each, half of the starts go on, but never fewer than the finalists."""

FIRST_STEP_RAD = 0.2
FINE_STEP_RAD = 0.05
CONVERGED_RAD = 2e-4
GENERATIONS = 400
"""Most generations of one run after the race."""

EXTRA_CM = (0.01, 0.03, 0.1)
"""Clearance wanted at gridpoints beyond the margin; the next one when a spline cannot be proved."""

IDLE_RUNS = 4
GAIN = 2e-4
"""The search ends when this many runs in a row have gained less than this share."""


@dataclass(frozen=True, slots=True)
class Task:
    """What is asked: the arm, what it must keep clear of, what its joints can, and the poses at both ends."""

    arm: Arm
    world: JointWorld
    limits: Limits
    ends_rad: Sequence[tuple[Floats, Floats]]
    """Pairs of poses at start and goal; more than one when the elbow may be on either side."""
    box_cm: Floats
    """Least and greatest x and y of the tip, shape (4,)."""
    road_s: float = np.inf
    """Path time within which every stop has to end: what the device's queue holds; infinite when stops need not fit."""


@dataclass(frozen=True, slots=True)
class Budget:
    """When the search has to be done; whichever comes first."""

    seconds: float
    evaluations: int = 10**9


@dataclass(slots=True)
class _Runner:
    """One start's state: where it begins and ends, and its distribution of inner control points."""

    start_rad: Floats
    goal_rad: Floats
    evolution: Evolution
    cost: float = np.inf
    controls: Floats = field(default_factory=lambda: np.zeros((0, 0)))


def find_fastest(
    task: Task, ways: Sequence[Floats], budget: Budget, seed: int, clock: Clock, told: Told
) -> JointSpline | None:
    """Return the fastest spline found whose freedom is proved; None when none was.

    Args:
        task: what is asked.
        ways: poses, shape (m, n) each, of ways known already, such as a path found by another planner.
        budget: when to end.
        seed: of the random draws; with the budget given as evaluations the result is the same every time.
        clock: the clock for the budget.
        told: told the progress.
    """
    return _Search(task, budget, np.random.default_rng(seed), clock, told).run(ways)


class _Search:
    def __init__(self, task: Task, budget: Budget, random: np.random.Generator, clock: Clock, told: Told) -> None:
        self.task, self.budget, self.random, self.clock, self.told = task, budget, random, clock, told
        self.began_s = 0.0
        self.evaluations = 0
        self.extra = 0
        self.best: JointSpline | None = None
        self.best_s = np.inf

    def run(self, ways: Sequence[Floats]) -> JointSpline | None:
        self._load_kernels()
        self.began_s = self.clock()
        winner = self._race([self._runner(way, CONTROLS[0], FIRST_STEP_RAD) for way in [*ways, *self._own_ways()]])
        idle, turn = 0, 0
        while idle < IDLE_RUNS and not self._is_over():
            turn += 1
            finer = self._finer(winner, CONTROLS[min(turn, len(CONTROLS) - 1)])
            self._advance(finer, GENERATIONS)
            gained = finer.cost < winner.cost * (1.0 - GAIN)
            winner = min(winner, finer, key=lambda runner: runner.cost)
            idle = 0 if gained or turn < len(CONTROLS) else idle + 1
        return self.best

    def _load_kernels(self) -> None:
        """Load or compile what runs inside the budget: the first time that takes seconds, and is no searching."""
        runner = self._runner(np.stack(self.task.ends_rad[0]), CONTROLS[0], FIRST_STEP_RAD)
        problem = self._problem(runner, CONTROLS[0])
        costs(problem, runner.evolution.mean[None], np.empty((1, 3)))
        spline = _spline(self.task.arm, problem.basis, runner.controls)
        prove_pieces(self.task.world, spline.borders_s, spline.coefficients)
        pose_spare_cm(self.task.world, runner.start_rad)

    def _race(self, runners: list[_Runner]) -> _Runner:
        """Run all starts some way, the better half of them farther, and so on; return the winner."""
        for generations in HEATS:
            for runner in runners:
                self._advance(runner, generations)
            runners.sort(key=lambda runner: runner.cost)
            runners = runners[: max(FINALISTS, (len(runners) + 1) // 2)]
        return runners[0]

    def _own_ways(self) -> list[Floats]:
        """Return the straight line between each pair of end poses, and short ways around the obstacles."""
        found: list[Floats] = []
        for start, goal in self.task.ends_rad:
            found.append(np.stack([start, goal]))
            if self.task.arm.links == 2:
                ways = short_ways(self.task.world, start, goal, self.task.limits.speeds_rad_s)
                found += islice(ways, WAYS)
        return found

    def _runner(self, way: Floats, count: int, step: float) -> _Runner:
        lengths = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(way, axis=0)).max(axis=1))])
        shares = lengths / lengths[-1] if lengths[-1] > 0.0 else np.linspace(0.0, 1.0, len(way))
        controls = np.stack([np.interp(greville(count), shares, column) for column in way.T], axis=1)
        return _Runner(way[0], way[-1], Evolution(controls[1:-1].ravel(), step, self.random), controls=controls)

    def _finer(self, runner: _Runner, count: int) -> _Runner:
        controls = spread(runner.controls, count)
        evolution = Evolution(controls[1:-1].ravel(), FINE_STEP_RAD, self.random)
        return _Runner(runner.start_rad, runner.goal_rad, evolution, controls=controls)

    def _advance(self, runner: _Runner, generations: int) -> None:
        """Run a start on for some generations, until it has converged or the budget is used up."""
        joints = self.task.arm.links
        count = len(runner.evolution.mean) // joints + 2
        problem = self._problem(runner, count)
        for _ in range(generations):
            if self._is_over() or runner.evolution.step < CONVERGED_RAD:
                return
            candidates = runner.evolution.ask()
            judged = np.empty((len(candidates), 3))
            costs(problem, candidates, judged)
            self.evaluations += len(candidates)
            runner.evolution.tell(candidates, judged[:, 0])
            first = int(np.argmin(judged[:, 0]))
            if judged[first, 0] < runner.cost:
                inner = candidates[first].reshape(-1, joints)
                runner.controls = np.concatenate([runner.start_rad[None], inner, runner.goal_rad[None]])
                runner.cost = float(judged[first, 0])
            self._keep(problem, runner, candidates, judged)
            self.told(self._share(), self.best_s)

    def _keep(self, problem: Problem, runner: _Runner, candidates: Floats, judged: Floats) -> None:
        """Keep the fastest candidate that misses nothing, if it is the fastest so far and is proved free."""
        possible = np.where(judged[:, 2] <= 0.0, judged[:, 1], np.inf)
        first = int(np.argmin(possible))
        if possible[first] >= self.best_s * (1.0 - 1e-6):
            return
        inner = candidates[first].reshape(-1, self.task.arm.links)
        controls = np.concatenate([runner.start_rad[None], inner, runner.goal_rad[None]])
        spline = _spline(self.task.arm, problem.basis, controls)
        if prove_pieces(self.task.world, spline.borders_s, spline.coefficients)[0] == PROVED:
            self.best, self.best_s = spline, float(possible[first])
        else:
            self.extra = min(self.extra + 1, len(EXTRA_CM) - 1)

    def _problem(self, runner: _Runner, count: int) -> Problem:
        limits = self.task.limits
        return Problem(
            self.task.world,
            span_basis(count),
            np.ascontiguousarray(runner.start_rad),
            np.ascontiguousarray(runner.goal_rad),
            limits.speeds_rad_s,
            limits.accelerations_rad_s2,
            self.task.box_cm,
            EXTRA_CM[self.extra],
            limits.accelerations_rad_s2 / limits.share,
            self.task.road_s,
        )

    def _share(self) -> float:
        by_time = (self.clock() - self.began_s) / self.budget.seconds
        return min(1.0, max(by_time, self.evaluations / self.budget.evaluations))

    def _is_over(self) -> bool:
        return self._share() >= 1.0


def _spline(arm: Arm, basis: Floats, controls: Floats) -> JointSpline:
    coefficients = np.einsum("pkc,cj->pkj", basis, controls)
    return JointSpline(arm, np.arange(len(basis) + 1.0), np.ascontiguousarray(coefficients), np.zeros(0))
