"""Way-points to a smooth path: straight pieces and parabolic corners of the tip, every corner proved free."""
