"""Starts the SCons of this Python, where PlatformIO expects its own copy."""

import SCons.Script

if __name__ == "__main__":
    SCons.Script.main()
