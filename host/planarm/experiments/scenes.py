"""Where the example scenes lie that the comparisons run on."""

from pathlib import Path
from typing import Final

from planarm.errors import SceneError
from planarm.scene import Scene, load_scene

_PACKAGE: Final = Path(__file__).resolve().parents[1]
_FOLDERS: Final = (
    _PACKAGE / "examples",  # installed wheel
    _PACKAGE.parents[1] / "examples",  # checkout
)


def table1_scene(case: int) -> Scene:
    """Return the example scene of a case of paper C's Table I.

    Raises:
        SceneError: it is not where it should be, or is no scene.
    """
    return load_scene(example_file(f"table1_case{case}.toml"))


def example_file(name: str) -> Path:
    """Return where a shipped example lies.

    Raises:
        SceneError: it is not where it should be.
    """
    for folder in _FOLDERS:
        if (folder / name).is_file():
            return folder / name
    looked = " or ".join(str(folder) for folder in _FOLDERS)
    raise SceneError(name, "", f"is not in {looked}; install planarm again")
