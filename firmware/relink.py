"""Tells PlatformIO's build what the image depends on besides its objects: the linker scripts (platformio.ini)."""

from SCons.Script import DefaultEnvironment

env = DefaultEnvironment()
env.Depends(env["PIOMAINPROG"], ["$PROJECT_DIR/image.ld", "$PROJECT_DIR/order.ld"])
