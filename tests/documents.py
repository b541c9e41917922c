"""What README and tutorial tell people to type: shell blocks, and files to write."""

import re
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^```(?P<head>[^\n]*)\n(?P<body>.*?)^```$", re.M | re.S)
EXIT = re.compile(r"\s+# exit code (\d)$")


@dataclass(frozen=True)
class Typed:
    """A command line, and the exit code that the document promises."""

    line: str
    exit_code: int = 0


@dataclass(frozen=True)
class Written:
    """A file to write: its name, its text, and the file that it continues."""

    name: str
    text: str
    continues: str = ""


def instructions(document: Path) -> list[Typed | Written]:
    """Everything that the document tells to write or to type, in order."""
    found: list[Typed | Written] = []
    for block in FENCE.finditer(document.read_text(encoding="utf-8")):
        head, body = block["head"].strip(), block["body"]
        named = re.search(r'title="([^"]+)"', head)
        if named:
            origin = re.search(r'from="([^"]+)"', head)
            found.append(Written(named[1], body, origin[1] if origin else ""))
        elif head in ("", "sh", "text"):
            found += [_typed(line) for line in body.splitlines() if re.match(r"(planarm|\./dev)\b", line.strip())]
    return found


def _typed(line: str) -> Typed:
    code = EXIT.search(line)
    bare = re.sub(r"\s+#.*$", "", line.strip())
    return Typed(bare, int(code[1]) if code else 0)
