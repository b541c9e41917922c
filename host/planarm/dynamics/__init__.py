"""Masses in motion: rigid bodies of planar arms, and what motors can give; SI units throughout."""
