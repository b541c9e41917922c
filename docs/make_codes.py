"""Write docs/codes.md from what `planarm explain` knows: `python docs/make_codes.py [FILE]`."""

import sys
from pathlib import Path

from planarm.explain import explanations

KINDS = {"E": "Errors", "C": "Checks of the certificate", "F": "Faults of the device", "R": "Refusals of the device"}
HEAD = """# Codes

What can go wrong, each with its cause and what helps; `planarm explain CODE` prints the same. The first digit of an
error's code is the exit code. This page is made by `python docs/make_codes.py`.
"""


def codes_page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for letter, title in KINDS.items():
        rows = [
            f"| {e.code} | {e.title} | {e.cause} | {e.fix} |" for e in explanations().values() if e.code[0] == letter
        ]
        parts.append("\n".join([f"\n## {title}", "| code | what | cause | fix |", "|---|---|---|---|", *rows, ""]))
    return "".join(parts)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent / "codes.md"
    target.write_text(codes_page(), encoding="utf-8")
