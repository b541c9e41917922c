"""Path to motion: how fast a joint path can be run under each joint's speed and acceleration."""
