"""Where the end effector may go: the free Cartesian space of a two-link arm, and proofs that moves stay in it."""
