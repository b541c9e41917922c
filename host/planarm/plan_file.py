"""Plan files: everything `stream` needs, and what a person wants to know, as one JSON object with a hash.

See docs/decisions/0006. The numbers that the firmware executes are integers; the SHA-256 covers every other key.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import planarm
from planarm.errors import CertificateError, PlanFileError
from planarm.output import writing
from planarm.scene import Scene
from planarm.stepping.certify import Certificate, Check
from planarm.stepping.plan import Allowance, SegmentPlan
from planarm_wire.errors import WireError
from planarm_wire.messages import SPEC_HASH, Move, Segment
from planarm_wire.wirings import board_of

FORMAT = 4
"""Raised with whatever a plan file must hold: the fields of a scene, too, which stand in it as they are."""


@dataclass(frozen=True, slots=True)
class StoredPlan:
    """A plan as a file holds it.

    Attributes:
        scene: The scene as planned, in the units of `planarm.scene`.
        path_points_cm: Way-points of the end effector.
        motion_s: Planned duration.
        segments: What is streamed, with the start on the micro-step lattice.
        certificate: The checks that it passed, or did not.
    """

    scene: Mapping[str, Any]
    path_points_cm: tuple[tuple[float, float], ...]
    motion_s: float
    segments: SegmentPlan
    certificate: Certificate


def save_plan(plan: StoredPlan, path: Path) -> None:
    """Write the plan to `path`.

    Raises:
        OutputError: It cannot be written.
    """
    body = _to_json(plan)
    body["sha256"] = _digest(body)
    with writing(path):
        path.write_text(json.dumps(body, indent=1) + "\n", encoding="utf-8")


def load_plan(path: Path) -> StoredPlan:
    """Read a plan.

    Raises:
        PlanFileError: The file cannot be read, is no plan of this format, or is for a wiring that is not known.
        CertificateError: It was changed after it was certified, or made for another wire.
    """
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PlanFileError(f"{path}: cannot be read: {error.strerror}; make a plan with 'planarm plan'") from error
    except UnicodeDecodeError as error:
        raise PlanFileError(
            f"{path}: is no plan: byte {error.start} is no UTF-8; make one with 'planarm plan'"
        ) from error
    except (ValueError, RecursionError) as error:
        of_it = f" {path} -o FILE.plan" if path.suffix == ".toml" else ""  # a scene in a plan's place
        raise PlanFileError(f"{path}: is no plan: {error}; make one with 'planarm plan{of_it}'") from error
    if not isinstance(body, dict) or "format" not in body:
        raise PlanFileError(f"{path}: is no plan; make one with 'planarm plan'")
    if body["format"] != FORMAT:
        raise PlanFileError(
            f"{path}: has format {body['format']}, by planarm {body.get('planarm', '?')}, this planarm reads format"
            f" {FORMAT}; make it anew with 'planarm plan'"
        )
    if body.pop("sha256", None) != _digest(body):
        raise CertificateError(f"{path}: was changed after it was made (its SHA-256 differs); make it anew")
    if body["spec_hash"] != SPEC_HASH:
        raise CertificateError(
            f"{path}: was made for wire {body['spec_hash']:08x}, this planarm speaks {SPEC_HASH:08x}; make it anew"
        )
    try:
        board_of(len(body["start_usteps"]), body["wiring"])
    except WireError as error:
        raise PlanFileError(f"{path}: no board executes it: {error}; make it anew with 'planarm plan'") from error
    return _from_json(body)


def arm_hash(scene: Mapping[str, Any]) -> str:
    """Return a hash of the arm that a scene's plain data describe: links, joints with their motors, coupling, masses.

    Two scenes with the same arm among other obstacles, with another task or planner, have the same.
    """
    arm = {key: scene[key] for key in ("arm", "joints", "coupling", "mechanics")}
    return _digest({"arm": json.loads(json.dumps(arm))})


def require_arm(plan: StoredPlan, scene: Scene, name: str) -> None:
    """Check that a plan was made for the arm of a scene.

    Raises:
        CertificateError: It was made for another arm.
    """
    theirs = asdict(scene)
    if arm_hash(plan.scene) == arm_hash(theirs):
        return
    differ = [key for key in ("arm", "joints", "coupling", "mechanics") if not _alike(plan.scene[key], theirs[key])]
    raise CertificateError(
        f"{name}: was made for another arm than that of {scene.source} ({', '.join(differ)} differ); plan it anew"
    )


def _alike(one: object, other: object) -> bool:
    """Tell whether two pieces of a scene are the same once written as JSON."""
    return bool(json.loads(json.dumps(one)) == json.loads(json.dumps(other)))


def _to_json(plan: StoredPlan) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "planarm": planarm.__version__,
        "spec_hash": SPEC_HASH,
        "arm_hash": arm_hash(plan.scene),
        "scene": plan.scene,
        "path_points_cm": plan.path_points_cm,
        "motion_s": plan.motion_s,
        "wiring": plan.segments.wiring,
        "start_usteps": plan.segments.start_usteps,
        "duration_ticks": plan.segments.duration_ticks,
        "segments": [_segment_to_json(segment) for segment in plan.segments.segments],
        "allowances": [[one.slow_per_s, one.fast_per_s, one.need_ticks] for one in plan.segments.allowances],
        "certificate": [
            {name: getattr(check, name) for name in Check.__dataclass_fields__} for check in plan.certificate.checks
        ],
    }


def _from_json(body: Mapping[str, Any]) -> StoredPlan:
    segments = SegmentPlan(
        segments=tuple(_segment_from_json(row) for row in body["segments"]),
        duration_ticks=body["duration_ticks"],
        start_usteps=tuple(body["start_usteps"]),
        allowances=tuple(Allowance(*one) for one in body["allowances"]),
        wiring=body["wiring"],
    )
    return StoredPlan(
        scene=body["scene"],
        path_points_cm=tuple((x, y) for x, y in body["path_points_cm"]),
        motion_s=body["motion_s"],
        segments=segments,
        certificate=Certificate(tuple(Check(**row) for row in body["certificate"])),
    )


def _segment_to_json(segment: Segment) -> list[Any]:
    moves = [[m.steps_dir, m.first_ticks, m.interval_q8, m.add] for m in segment.moves]
    return [segment.duration_flags, moves]


def _segment_from_json(row: list[Any]) -> Segment:
    duration_flags, moves = row
    return Segment(duration_flags, tuple(Move(*move) for move in moves))


def _digest(body: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
