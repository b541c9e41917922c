"""The scene that a command names, with the command line's overrides."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from planarm.errors import PlanarmError
from planarm.first_start import compile_parts
from planarm.scene import Scene, load_scene, with_planner, with_space
from planarm_wire.kernel_cache import is_cold


def chosen_scene(options: argparse.Namespace) -> Scene:
    """Read the scene and put the overrides in.

    Raises:
        SceneError: The scene, or an override, is wrong.
    """
    scene = with_space(load_scene(Path(options.scene)), options.space)
    return with_planner(scene, algorithm=options.planner, neighbours=options.neighbours, seed=options.seed)


def require_file(name: str, error: type[PlanarmError], advice: str) -> None:
    """Refuse a file that cannot be read, before anything that takes time is done for it.

    Args:
        name: its path, as it was given.
        error: what to raise.
        advice: what to give instead.

    Raises:
        PlanarmError: of the kind `error`.
    """
    try:
        with Path(name).open("rb"):
            pass
    except OSError as cause:
        raise error(f"{name}: cannot be read: {cause.strerror or cause}; {advice}") from cause


def tell_first_compile(*packages: str) -> None:
    """Say why the first run takes longer, before it does."""
    if any(is_cold(package) for package in packages):
        print("Compiling the numeric kernels, once a version: about a minute ...", file=sys.stderr)


def compile_first(*packages: str) -> None:
    """On the first start of a version, say so and compile the kernels on all cores."""
    cold = tuple(package for package in packages if is_cold(package))
    tell_first_compile(*cold)
    if cold:
        compile_parts(cold)
