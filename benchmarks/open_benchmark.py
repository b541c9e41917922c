"""Make the open benchmark's data anew, or check it: every scene's hash and its certified optimum.

`./dev bench open_benchmark` checks the first scenes against examples/open_benchmark.csv; `--all` checks every one, and
`--write FILE` writes the data. An optimum is the shortest polyline through free nodes whose straight moves are all
proved free for the whole arm, by a search over all pairs of nodes (`planarm.experiments.node_optimum`).
"""

import argparse
import sys
import time
from pathlib import Path

from planarm.experiments.benchmark_scenes import SCENES, benchmark_scene, scene_hash
from planarm.experiments.external import read_optima
from planarm.experiments.node_optimum import shortest_through_nodes

FEW = 20


def main() -> int:
    """Check or write; return 1 when something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true", help="check all scenes, not a few")
    parser.add_argument("--write", metavar="FILE", help="write the data instead of checking it")
    options = parser.parse_args()
    count = SCENES if options.all or options.write else FEW
    known = () if options.write else read_optima()
    began_s = time.perf_counter()
    lines = ["scene,hash,optimum_cm"]
    wrong = 0
    for number in range(count):
        scene, free_map = benchmark_scene(number)
        path = shortest_through_nodes(free_map, scene.task.start_cm, scene.task.goal_cm)
        assert path is not None, "scenes without a path are drawn again"
        lines.append(f"{number},{scene_hash(scene)},{path.length_cm:.9f}")
        if known:
            same = known[number].hash == scene_hash(scene) and abs(known[number].optimum_cm - path.length_cm) < 1e-8
            wrong += not same
    if options.write:
        Path(options.write).write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.stdout.write(f"{count} scenes in {time.perf_counter() - began_s:.0f} s; {wrong} differ\n")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
