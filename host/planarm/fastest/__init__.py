"""The path itself optimised for duration: splines in joint space, from several starts, never out of free space."""
