"""Search among moving obstacles: exactly in space and time, and by D* as paper B has it."""
