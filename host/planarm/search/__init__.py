"""Path planning by graph search: one best-first search, the stencils of paper C, and what a search answers."""
