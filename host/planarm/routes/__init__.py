"""From a scene to a path, or to a timed motion among moving obstacles, that is proved free; and its alternatives."""
