"""`planarm sweep`: see `planarm.cli.campaign`; the file's kind says what a run does."""

from planarm.cli.campaign import execute

__all__ = ["execute"]
