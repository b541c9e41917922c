"""The wire between planarm's host and its firmware: framing, messages, limits and the words for faults.

`messages.toml` is the one place where the protocol is written; `messages.py` is generated from it, and so
are the firmware's header, the page `docs/protocol.md` and the golden vectors. Nothing here does any I/O.

This module imports nothing, so that importing one part (say `planarm_wire.kernel_cache`) does not load the
others.
"""
