"""Captured pin edges against the plan: what was stepped, when, and whether the driver's rules were kept."""
