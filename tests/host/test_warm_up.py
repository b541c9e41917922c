"""After the warm-up, planning a shipped scene needs no kernel that is not compiled or loaded yet."""

import subprocess
import sys

NEW_OVERLOADS = """
import sys
from numba.core.registry import CPUDispatcher
from planarm.model.shapes import Circle, Polygon
from planarm.operations.replanning import first_plan
from planarm.operations.verdicts import judge
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.warm_up import warm_up

def ready():
    modules = [m for name, m in sys.modules.items() if name.startswith("planarm.")]
    kernels = {id(k): k for m in modules for k in vars(m).values() if isinstance(k, CPUDispatcher)}
    return {(k.__name__, str(signature)) for k in kernels.values() for signature in k.overloads}

warm_up(on_roadmap=True, moving=True, replanning=True)
before = ready()
for name in ("table1_case1", "table1_case2", "energy_two_links", "moving_env1"):
    plan_scene(load_scene(f"examples/{name}.toml"), lambda stage, share: None)
scene = load_scene("examples/energy_two_links.toml")
task, plan = first_plan(scene, lambda stage, share: None)
for shape in (Circle((0.0, 32.0), 1.5), Polygon(((0.0, 40.0), (3.0, 40.0), (0.0, 43.0)))):
    judge(plan, shape, 1.0, 0.1, 0.1)
    task.planner.change(task.roadmap.add_obstacle(shape)[1])
    task.planner.solve()
assert len(before) > 10, before
print(sorted(ready() - before))
"""


def test_the_small_scene_reaches_every_kernel(request):
    done = subprocess.run(
        [sys.executable, "-c", NEW_OVERLOADS], cwd=request.config.rootpath, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
