"""Where the released flash image lies: the one that `sim://` runs and that a board is flashed with."""

from pathlib import Path

from planarm.errors import LinkError

_PACKAGE = Path(__file__).resolve().parents[1]
_PLACES = (
    _PACKAGE / "released" / "uno.hex",  # installed wheel
    _PACKAGE.parents[1] / "firmware" / "release" / "uno.hex",  # checkout
)


def released_image() -> Path:
    """Path of the released image (Intel HEX); a LinkError names the places where it was looked for."""
    for place in _PLACES:
        if place.is_file():
            return place
    looked = " or ".join(str(place) for place in _PLACES)
    raise LinkError(
        f"the released flash image was not found at {looked}; install planarm again or build firmware/release/uno.hex"
    )
