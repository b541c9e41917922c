"""After the warm-up, planning a shipped scene compiles nothing more."""

import subprocess
import sys

COUNT_COMPILES = """
from numba.core import event
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.warm_up import warm_up

warm_up()
with event.install_recorder("numba:compile") as recorder:
    for case in (1, 2):
        plan_scene(load_scene(f"examples/table1_case{case}.toml"), lambda stage, share: None)
print(len(recorder.buffer))
"""


def test_the_small_scene_reaches_every_kernel(request):
    done = subprocess.run(
        [sys.executable, "-c", COUNT_COMPILES], cwd=request.config.rootpath, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "0"
