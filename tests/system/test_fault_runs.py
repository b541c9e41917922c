"""Whatever goes wrong with line, power or host, and when: no wrong step, and a true word about the position."""

from collections import Counter
from pathlib import Path

import pytest

from planarm.campaign.fault_runs import KINDS, run_faults
from planarm.errors import SceneError
from planarm.scene import load_scene

SCENE = Path(__file__).resolve().parents[2] / "examples/sweeps/short_move.toml"
SEEDS_IN_FULL = 10_000 // len(KINDS) + 1


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


def test_no_mishap_makes_a_wrong_step_or_a_false_verdict(scene, sized):
    """Every kind with some seeds; with --full 10,000 runs and more. A failed run is repeated by its fault and seed."""
    rows = []
    for kind in KINDS:
        for seed in range(sized(2, SEEDS_IN_FULL)):
            verdict, reason, figures = run_faults(scene, {"fault": kind, "seed": seed}, {})
            assert verdict == "ok", f"fault {kind}, seed {seed}: {reason}; {figures}"
            rows.append(figures)
    verdicts = Counter(row["verdict"] for row in rows)
    whole = max(row["steps"] for row in rows)
    assert set(verdicts) == {"complete", "exact", "bounded", "lost"}, verdicts
    assert verdicts["complete"] > 0.25 * len(rows)
    assert sum(row["steps"] > 0 for row in rows) > 0.6 * len(rows), "most runs move the arm"
    broken = [row for row in rows if 0 < row["steps"] < whole]
    assert broken, "some break off on the way"
    finished = sum(row["steps_in_the_end"] == whole for row in rows)
    assert finished >= len(rows) - sum(row.get("resumed") == "lost" for row in rows)


def test_the_same_fault_and_seed_is_the_same_run(scene):
    first = run_faults(scene, {"fault": "flip", "seed": 3}, {})
    run_faults(scene, {"fault": "two_resets", "seed": 1}, {})
    assert run_faults(scene, {"fault": "flip", "seed": 3}, {}) == first


def test_an_unknown_mishap_is_refused(scene):
    with pytest.raises(SceneError, match="one of none, drop"):
        run_faults(scene, {"fault": "rain"}, {})
