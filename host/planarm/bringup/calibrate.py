"""Link lengths and zero angles from points that the tip has touched, by least squares.

With motors at u the joints are at q = T u + z (T the transmission, z the zero angles), and the tip of an arm whose base
stands at b is at b + sum over k of l_k e(q_1 + ... + q_k). The lengths l and the zeros z that bring the tips nearest to
the touched points are found by Levenberg and Marquardt's method (scipy.optimize.least_squares). Each point gives two
equations, so n links with their n zeros need n points, and at least two more are asked for: without more points than
that, errors of touching would not show.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from planarm.errors import UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission
from planarm.scene import Scene

MORE_POINTS = 2
"""So many more points than links are asked for at least."""
WORST_CONDITION = 1e4
"""Beyond it an error of touching of 0.1 mm may be a length wrong by a metre."""
NEW_LENGTH_SHARE = 0.25
"""A length that changes by more than this was rather a wrong point, or another arm."""

_HEAD = re.compile(r"\s*\[(\[?[\w.]+\]?)\]")
_LENGTHS = re.compile(r"(\s*link_lengths_cm\s*=\s*)\[[^\]]*\]")
_ZERO = re.compile(r"\s*zero_offset_deg\s*=")


@dataclass(frozen=True, slots=True)
class TouchedPoint:
    """Where the motors stood, in micro-steps, and where the tip was then."""

    usteps: tuple[int, ...]
    tip_cm: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the points say.

    Attributes:
        link_lengths_cm: of each link.
        zero_offsets_rad: the joint angles at which the motors stand at micro-step 0.
        lengths_std_cm, zeros_std_rad: standard errors, by the residuals.
        residuals_mm: distance of each point from where the calibrated arm has its tip.
        before_mm: the same with the scene as it was.
    """

    link_lengths_cm: tuple[float, ...]
    zero_offsets_rad: tuple[float, ...]
    lengths_std_cm: tuple[float, ...]
    zeros_std_rad: tuple[float, ...]
    residuals_mm: tuple[float, ...]
    before_mm: tuple[float, ...]

    @property
    def rms_mm(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(np.square(self.residuals_mm))))

    def explain(self) -> str:
        """Say how well it fits, and which point fits worst."""
        worst = int(np.argmax(self.residuals_mm))
        return (
            f"{len(self.residuals_mm)} points fit within {self.rms_mm:.3g} mm (rms), {max(self.before_mm):.3g} mm at "
            f"worst before; point {worst + 1} is farthest off, by {self.residuals_mm[worst]:.3g} mm"
        )


def calibrate(scene: Scene, points: Sequence[TouchedPoint]) -> Calibration:
    """Return the lengths and zeros that fit the touched points best.

    Raises:
        UsageError: there are too few points, they do not determine the arm, or a length changes by more than a
            quarter.
    """
    links = len(scene.joints)
    if len(points) < links + MORE_POINTS:
        raise UsageError(
            f"{len(points)} touched points are given, at least {links + MORE_POINTS} are needed; touch more"
        )
    turned = np.array([point.usteps for point in points]) @ Transmission.of(scene).rad_per_ustep.T
    tips = np.array([point.tip_cm for point in points])
    known = np.array([*scene.arm.link_lengths_cm, *(joint.zero_offset_rad for joint in scene.joints)])

    def errors_cm(wanted: np.ndarray) -> np.ndarray:
        arm = replace(Arm.from_spec(scene.arm), link_lengths_cm=tuple(wanted[:links].tolist()))
        return np.asarray((forward(arm, turned + wanted[links:])[:, -1] - tips).ravel())

    found = least_squares(errors_cm, known, method="lm", x_scale="jac")
    _require_determined(found.jac)
    lengths = found.x[:links]
    for number, (new, old) in enumerate(zip(lengths, scene.arm.link_lengths_cm, strict=True), start=1):
        if abs(new - old) > NEW_LENGTH_SHARE * old:
            raise UsageError(
                f"link {number} would be {new:.4g} cm long, the scene says {old:g}; check the points (worst: "
                f"{_worst(found.fun)}), or give a length nearer to the truth"
            )
    spread = _standard_errors(found.jac, found.fun)
    return Calibration(
        tuple(map(float, lengths)),
        tuple(map(float, found.x[links:])),
        tuple(map(float, spread[:links])),
        tuple(map(float, spread[links:])),
        _distances_mm(found.fun),
        _distances_mm(errors_cm(known)),
    )


def _require_determined(jacobian: np.ndarray) -> None:
    columns = np.linalg.norm(jacobian, axis=0)
    condition = np.inf if not columns.all() else np.linalg.cond(jacobian / columns)
    if not condition < WORST_CONDITION:
        raise UsageError(
            "the touched points do not determine lengths and zeros: they are too much alike; touch some near the base "
            "and some at full stretch, in different directions"
        )


def _standard_errors(jacobian: np.ndarray, errors: np.ndarray) -> np.ndarray:
    free = max(1, len(errors) - jacobian.shape[1])
    variance = float(errors @ errors) / free
    return np.asarray(np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian))))


def _distances_mm(errors_cm: np.ndarray) -> tuple[float, ...]:
    return tuple(float(10.0 * d) for d in np.hypot(*errors_cm.reshape(-1, 2).T))


def _worst(errors_cm: np.ndarray) -> str:
    distances = _distances_mm(errors_cm)
    worst = int(np.argmax(distances))
    return f"point {worst + 1}, {distances[worst]:.3g} mm off"


def read_points(path: Path, joints: int) -> list[TouchedPoint]:
    """Read touched points: CSV with a head `motor1_usteps,motor2_usteps,x_cm,y_cm`.

    Raises:
        UsageError: the file cannot be read or has another form; the message names the line.
    """
    head = [*(f"motor{n}_usteps" for n in range(1, joints + 1)), "x_cm", "y_cm"]
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {error}; give a CSV file with the head {','.join(head)}") from error
    if not rows or [word.strip() for word in rows[0]] != head:
        raise UsageError(f"{path}: line 1: the head must be {','.join(head)}")
    points = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            values = [float(word) for word in row]
            points.append(TouchedPoint(tuple(int(v) for v in values[:joints]), (values[joints], values[joints + 1])))
        except (ValueError, IndexError) as error:
            raise UsageError(f"{path}: line {line}: {','.join(row)!r} is not {len(head)} numbers") from error
    return points


def calibrated_text(text: str, calibration: Calibration) -> str:
    """Return a scene file's text with the new lengths and zeros; everything else, comments too, stays as it is.

    Raises:
        UsageError: the file does not have its lengths on one line, or its joints as `[[joints]]` tables.
    """
    lengths = "[" + ", ".join(f"{length:.5g}" for length in calibration.link_lengths_cm) + "]"
    zeros = [f"zero_offset_deg = {zero:.5g}" for zero in np.degrees(calibration.zero_offsets_rad)]
    table, joint, replaced = "", 0, False
    told: list[str] = []
    for line in text.splitlines():
        head = _HEAD.match(line)
        table = head[1] if head else table
        if table == "[joints]" and _ZERO.match(line):
            continue
        is_lengths = table == "arm" and _LENGTHS.match(line) is not None
        told.append(_LENGTHS.sub(rf"\g<1>{lengths}", line) if is_lengths else line)
        replaced = replaced or is_lengths
        if head and table == "[joints]" and joint < len(zeros):
            told.append(zeros[joint])
            joint += 1
    if not replaced or joint != len(zeros):
        raise UsageError("a scene to be written anew needs arm.link_lengths_cm on one line, and [[joints]] tables")
    return "\n".join(told) + "\n"
