"""Graphs of configurations (paper A's occupancy analysis): nodes, checked moves, what an obstacle touches, costs."""
