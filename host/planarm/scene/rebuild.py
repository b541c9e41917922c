"""A scene out of the mapping that `dataclasses.asdict` made of it, as plan files keep it."""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from planarm.scene.types import Scene


def scene_from_mapping(mapping: Mapping[str, Any]) -> Scene:
    """Return the scene whose `asdict`, after a way through JSON, is `mapping`.

    Raises:
        KeyError, TypeError: it is not; plan files are protected by their hash, so this is a file of another version.
    """
    return typing.cast("Scene", _value(Scene, mapping))


def _value(kind: Any, data: Any) -> Any:  # noqa: ANN401 - any field of any dataclass
    """Return `data` as the type of a field."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        known = {field.name: _value(hints[field.name], data[field.name]) for field in fields(kind)}
        return typing.cast("type", kind)(**known)
    if origin is tuple and data is not None:
        kinds = parts[:1] * len(data) if parts[1:] == (...,) else parts
        return tuple(_value(part, one) for part, one in zip(kinds, data, strict=True))
    if origin in (typing.Union, types.UnionType) and data is not None:
        (inner,) = (part for part in parts if part is not types.NoneType)
        return _value(inner, data)
    return data
