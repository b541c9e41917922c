"""Stand-in for PlatformIO's atmelavr platform."""

from platformio.platform.base import PlatformBase


class AtmelavrPlatform(PlatformBase):
    """Needs no packages: avr-gcc is found on PATH."""
