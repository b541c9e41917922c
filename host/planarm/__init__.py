"""planarm: a planar robot arm from a scene file to proven step pulses."""
