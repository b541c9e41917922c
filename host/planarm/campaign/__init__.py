"""Many independent runs: sweeps over scenes and settings, and campaigns of faults, on one core or on a cluster."""
