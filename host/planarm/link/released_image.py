"""Where the released flash image lies: the one that `sim://` runs and that a board is flashed with."""

from pathlib import Path

from planarm.errors import LinkError

_PACKAGE = Path(__file__).resolve().parents[1]
_FOLDERS = (
    _PACKAGE / "released",  # installed wheel
    _PACKAGE.parents[1] / "firmware" / "release",  # checkout
)


def released_image(board: str = "uno") -> Path:
    """Path of a board's released image (Intel HEX); a LinkError names the places where it was looked for."""
    places = [folder / f"{board}.hex" for folder in _FOLDERS]
    for place in places:
        if place.is_file():
            return place
    looked = " or ".join(map(str, places))
    raise LinkError(
        f"the released flash image was not found at {looked}; install planarm again or run firmware/build.py release"
    )
