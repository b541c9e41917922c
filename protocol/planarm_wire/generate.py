"""Writes or compares what is generated from `messages.toml`: `python -m planarm_wire.generate [--check]`.

Exit code 0: written, or all as it should be; 1: `--check` found a file that differs; 2: the specification cannot be
used (it is wrong, or this is an installed package, which has none).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from planarm_wire.errors import SpecError
from planarm_wire.generators.header import messages_h, wiring_h
from planarm_wire.generators.page import protocol_md
from planarm_wire.generators.python import messages_py
from planarm_wire.spec import SPEC_PATH, Spec, load_spec

ROOT: Final = SPEC_PATH.parents[1]


def _vectors_json(spec: Spec) -> str:
    # Made with the codec itself, which needs the generated messages.py: so it is imported, and run, last.
    from planarm_wire.generators.vectors import vectors_json  # noqa: PLC0415

    return vectors_json(spec)


GENERATED: Final[dict[str, Callable[[Spec], str]]] = {
    "protocol/planarm_wire/messages.py": messages_py,
    "firmware/core/messages.h": messages_h,
    "docs/protocol.md": protocol_md,
    "protocol/vectors.json": _vectors_json,
}
"""Each generated file, below the repository's root, and what makes its text."""


def outdated(root: Path = ROOT) -> Iterator[tuple[Path, str]]:
    """Yield each generated file that is missing or differs from the specification, with the text it should have.

    A file is compared when the caller asks for the next one, so writing each before going on is safe.
    """
    spec = load_spec(root / "protocol" / "messages.toml")
    wirings = {f"firmware/core/boards/{board.name}/wiring.h": wiring_h(board) for board in spec.boards}
    for name, make in {**wirings, **GENERATED}.items():
        path = root / name
        text = make(spec)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            yield path, text


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m planarm_wire.generate", description="Generate from messages.toml.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a file differs")
    check = parser.parse_args(arguments).check
    differs = False
    try:
        for path, text in outdated():
            differs = True
            if not check:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8", newline="\n")
            verb = "differs from messages.toml" if check else "written"
            sys.stdout.write(f"{path.relative_to(ROOT)}: {verb}\n")
    except SpecError as problem:
        sys.stderr.write(f"{problem}\n")
        return 2
    if check and differs:
        sys.stdout.write("run `python -m planarm_wire.generate` and commit the result\n")
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
