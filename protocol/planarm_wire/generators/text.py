"""Small functions that the generated files share."""

from __future__ import annotations

import re
import textwrap
from typing import Final

from planarm_wire.layout import EACH_JOINT, END
from planarm_wire.spec import FieldSpec

NOTICE: Final = "Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit."


def class_name(name: str) -> str:
    """Return `host_message` as `HostMessage`."""
    return "".join(part.capitalize() for part in name.split("_"))


def sentence(text: str) -> str:
    """Return the text on one line, with a capital letter (unless it starts with a field's name) and a full stop."""
    flat = " ".join(text.split())
    first = re.split(r"[^A-Za-z0-9_]", flat, maxsplit=1)[0]
    if "_" not in first:
        flat = flat[0].upper() + flat[1:]
    return flat if flat.endswith((".", "?", "!")) else flat + "."


def wrapped(text: str, indent: str, width: int = 116) -> str:
    """Break the text into lines that start with `indent`."""
    return textwrap.fill(text, width, initial_indent=indent, subsequent_indent=indent, break_long_words=False)


def byte_range(least: int, most: int) -> str:
    """Return "5 bytes" or "3 to 48 bytes"."""
    if least == most:
        return f"{least} byte" + ("" if least == 1 else "s")
    return f"{least} to {most} bytes"


def presence(field: FieldSpec) -> str:
    """Return when a field is on the wire, in words; empty when always."""
    return f"only when {field.when[0]} >= {field.when[1]}, else 0" if field.when else ""


def count_words(field: FieldSpec) -> str:
    """Return how often a field stands there; empty when once."""
    if field.count is None:
        return ""
    if field.count == END:
        return "one or more, to the payload's end"
    if field.count == EACH_JOINT:
        return "one a joint"
    return f"{field.count} times" + ("" if field.repeat.isdigit() else f" ({field.repeat})")
