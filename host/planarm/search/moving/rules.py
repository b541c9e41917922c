"""Runs by a rule, simulated to their end before anything moves: plain D* and paper B's modified D*.

A rule looks at the nodes at each motion sample, and ends at the goal. What lies between two samples, and the rest at
the goal to the horizon, are judged afterwards: a run in which something touches there has failed as well, however it
ended by its own light.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planarm.search.moving.dstar import CONTACT, HORIZON, NO_PATH, REACHED, first_path, run_modified, run_plain
from planarm.search.moving.space_time import world_of
from planarm.search.moving.timed_path import TimedPath
from planarm.workspace.moving_map import MovingMap
from planarm.workspace.moving_proof import MovingWorld, fill_move, prove_moving_piece
from planarm.workspace.proof import BLOCKED

Rule = Literal["plain", "modified"]
Outcome = Literal["reached", "contact", "goal taken", "no path", "horizon"]
OUTCOMES: dict[int, Outcome] = {REACHED: "reached", CONTACT: "contact", NO_PATH: "no path", HORIZON: "horizon"}


@dataclass(frozen=True, slots=True)
class Contact:
    """The first contact of a run."""

    sample: int
    """The sample at which, or before which, it is."""
    time_s: float
    obstacle: int
    """Counted from 1."""
    between: bool
    """True when it is only between two samples, where a rule does not look."""
    at_goal: bool = False
    """True when the arm rests at the goal, where the rule has ended."""

    def words(self) -> str:
        """Say what touches, and when."""
        if self.at_goal:
            return (
                f"obstacles[{self.obstacle}] touches the arm at the goal by sample {self.sample} ({self.time_s:.3f} s)"
            )
        where = f"between samples {self.sample - 1} and {self.sample}" if self.between else f"at sample {self.sample}"
        return f"obstacles[{self.obstacle}] touches a link {where} ({self.time_s:.3f} s)"


@dataclass(frozen=True, slots=True)
class RuleRun:
    """What became of a run by a rule."""

    rule: Rule
    outcome: Outcome
    """As the rule sees it, at samples; then what lies between is looked at: any contact makes it one, and one while the
    arm rests at the goal, up to the horizon, makes it "goal taken"."""
    path: TimedPath | None
    """Where the arm was, up to the end or the contact; None without a path."""
    contact: Contact | None
    run_s: float
    """Wall time of search and simulation, without the map."""

    def words(self) -> str:
        """Say how it ended."""
        if self.contact is not None:
            return self.contact.words()
        arrival = f" at sample {self.path.arrival}" if self.outcome == "reached" and self.path is not None else ""
        return f"{self.outcome}{arrival}"

    def figures(self) -> dict[str, str]:
        """Return it as one mapping, for summaries."""
        return {"rule": self.rule, "outcome": self.outcome, "what": self.words()}


def run_rule(rule: Rule, moving_map: MovingMap, start: int, goal: int) -> RuleRun:
    """Simulate a rule from a cell to a cell.

    Args:
        rule: which.
        moving_map: the free nodes over time; its delay margin is left aside.
        start: cell of the tip at sample 0, free then.
        goal: cell that it is to reach.
    """
    began_s = perf_counter()
    poses, free = moving_map.poses, moving_map.free
    places = np.full(len(free), -1, np.int64)
    first, last = int(poses.place[start]), int(poses.place[goal])
    if rule == "plain":
        code, end, _ = run_plain(poses, free, first, last, places)
    else:
        path = first_path(poses, free[0], first, last)
        code, end = run_modified(poses, free, path, places) if len(path) else (NO_PATH, 0)
    run_s = perf_counter() - began_s
    outcome = OUTCOMES[code]
    if outcome == "no path":
        return RuleRun(rule, outcome, None, None, run_s)
    timed = TimedPath.through(moving_map, poses.cell[places[: end + 1]].astype(np.int64))
    contact = first_contact(moving_map, timed)
    if contact is None and outcome == "reached":
        contact = _contact_at_goal(moving_map, timed)
    if contact is not None:
        outcome = "goal taken" if contact.at_goal else "contact"
    return RuleRun(rule, outcome, timed, contact, run_s)


def first_contact(moving_map: MovingMap, path: TimedPath) -> Contact | None:
    """Return the first contact of a path's motion, at samples and in between, without any delay."""
    world, sample_s = world_of(moving_map), moving_map.clock.sample_s
    piece = np.empty((4, 2))
    for k in range(path.arrival):
        end_s = (k + 1) * sample_s
        at_end, by = _judge_pose(world, path.q_rad[k + 1], end_s)
        fill_move(path.q_rad[k], path.q_rad[k + 1], sample_s, piece)
        verdict, time_s, obstacle = prove_moving_piece(world, piece, k * sample_s, sample_s, 0.0)
        if at_end == BLOCKED:
            return Contact(k + 1, end_s, by + 1, between=False)
        if verdict == BLOCKED:
            return Contact(k + 1, float(time_s), int(obstacle) + 1, between=True)
    return None


def _contact_at_goal(moving_map: MovingMap, path: TimedPath) -> Contact | None:
    """Return the first contact of the arm that rests at a path's end, up to the horizon; None when it stays free."""
    world, clock = world_of(moving_map), moving_map.clock
    piece = np.zeros((4, 2))
    piece[0] = path.q_rad[-1]
    for k in range(path.arrival, clock.samples):
        verdict, time_s, obstacle = prove_moving_piece(world, piece, k * clock.sample_s, clock.sample_s, 0.0)
        if verdict == BLOCKED:
            return Contact(k + 1, float(time_s), int(obstacle) + 1, between=False, at_goal=True)
    return None


def _judge_pose(world: MovingWorld, q_rad: NDArray[np.float64], time_s: float) -> tuple[int, int]:
    """Judge one pose at one time; return (verdict, obstacle)."""
    piece = np.zeros((4, 2))
    piece[0] = q_rad
    verdict, _, obstacle = prove_moving_piece(world, piece, time_s, 0.0, 0.0)
    return int(verdict), int(obstacle)
