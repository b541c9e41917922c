"""planarm: a planar robot arm from a scene file to proven step pulses."""

__version__ = "0.1.0"
