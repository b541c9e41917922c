"""Stand-in for PlatformIO's native platform."""

from platformio.platform.base import PlatformBase


class NativePlatform(PlatformBase):
    """Programs for this computer."""

    def is_embedded(self) -> bool:
        """Tell PlatformIO to run the tests here instead of uploading them."""
        return False
