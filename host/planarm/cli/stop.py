"""`planarm stop`: from another terminal, or after the program that moved the arm is gone."""

from __future__ import annotations

import argparse
import json
import os
import signal
import time
from contextlib import closing

from planarm.errors import LinkError

BETWEEN_SIGNALS_S = 0.3
"""Signals that come at once are one."""


def execute(options: argparse.Namespace) -> int:
    """Stop the motion along its path; a program that has the port is asked to do it, as by Ctrl-C twice."""
    from planarm.link.exchange import open_session, request
    from planarm.link.port_holder import holders
    from planarm.link.transport import open_transport
    from planarm_wire.messages import EMERGENCY_CODE, EMERGENCY_REPEATS, Query, State, Stop

    others = [] if "://" in options.port else [one for one in holders(options.port) if one.pid != os.getpid()]
    if others:
        if options.emergency or not all("planarm" in one.command for one in others):
            names = ", ".join(map(str, others))
            raise LinkError(f"port {options.port}: in use by {names}; stop it there, or cut the motors' supply")
        for _ in ("hold", "stop"):
            for one in others:
                os.kill(one.pid, signal.SIGINT)
            time.sleep(BETWEEN_SIGNALS_S)
        told: dict[str, object] = {"asked": [str(one) for one in others]}
    else:
        with closing(open_transport(options.port)) as transport:
            if options.emergency:
                transport.write(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
            session = open_session(transport)
            status = request(transport, session, Query())
            if status.state not in (State.IDLE, State.FAULT):
                status = request(transport, session, Stop(int(options.quick)))
            told = {"state": status.state.name.lower(), "fault": status.fault.name.lower()}
    print(json.dumps(told) if options.json else "\n".join(f"{name}: {value}" for name, value in told.items()))
    return 0
