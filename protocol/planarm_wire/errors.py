"""What can go wrong with the wire.

    ProtocolError
    ├── SpecError    messages.toml is missing, or something in it is wrong
    └── WireError    a message does not fit its form, or a payload does not hold one

A damaged frame is no exception: the decoder hands out a `framing.FrameError` value and goes on.
"""

from __future__ import annotations


class ProtocolError(Exception):
    """Base of all errors of `planarm_wire`."""


class SpecError(ProtocolError):
    """The protocol's specification cannot be used; the text names the place in the file and what to change."""


class WireError(ProtocolError):
    """A message or payload breaks the protocol; the text names the message, the field, the value and its limit."""
