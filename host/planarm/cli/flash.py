"""`planarm flash --port DEVICE`: the released image onto a board, read back and compared, and the board asked."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from pathlib import Path


def execute(options: argparse.Namespace) -> int:
    """Write with avrdude, which verifies; then say HELLO to what runs now."""
    from planarm.link.doctor import ask_board
    from planarm.link.flash import flash
    from planarm.link.released_image import released_image
    from planarm.link.serial_transport import let_go
    from planarm.link.transport import open_transport

    image = Path(options.image) if options.image else released_image(options.board)
    flash(options.port, image, prepare=let_go)
    told: dict[str, object] = {"image": str(image), "verified": True}
    if not options.image:
        with closing(open_transport(options.port)) as transport:
            told |= ask_board(transport)
    print(json.dumps(told) if options.json else "\n".join(f"{name}: {value}" for name, value in told.items()))
    return 0
