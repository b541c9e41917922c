"""`planarm stop`: from another terminal, or after the program that moved the arm is gone."""

from __future__ import annotations

import argparse
import json
import os
import signal
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from typing import TYPE_CHECKING

from planarm.errors import LinkError

if TYPE_CHECKING:
    from planarm.link.port_holder import Holder

BETWEEN_SIGNALS_S = 0.3
"""Signals that come at once are one."""
LET_GO_S = 20.0
"""An arm slows down within a second; the program then asks the board where it stands, and writes its report."""
LOOK_S = 0.1


def execute(options: argparse.Namespace) -> int:
    """Stop the motion along its path; a program of ours that has the port is asked to do it, as by Ctrl-C twice."""
    from planarm.link.port_holder import holders

    others = [] if "://" in options.port else [one for one in holders(options.port) if one.pid != os.getpid()]
    told = _ask_to_stop(options.port, others, options.emergency) if others else _stop_ourselves(options)
    print(json.dumps(told) if options.json else "\n".join(f"{name}: {value}" for name, value in told.items()))
    return 0


def _stop_ourselves(options: argparse.Namespace) -> dict[str, object]:
    from planarm.link.exchange import open_session, request
    from planarm.link.transport import open_transport
    from planarm_wire.messages import EMERGENCY_CODE, EMERGENCY_REPEATS, Query, State, Stop

    with closing(open_transport(options.port)) as transport:
        if options.emergency:
            transport.write(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
        session = open_session(transport)
        status = request(transport, session, Query())
        if status.state not in (State.IDLE, State.FAULT):
            status = request(transport, session, Stop(int(options.quick)))
    return {"state": status.state.name.lower(), "fault": status.fault.name.lower()}


def _ask_to_stop(port: str, others: Sequence[Holder], emergency: bool) -> dict[str, object]:
    """Ask the programs that have the port to stop, and wait until they have let go of it."""
    names = ", ".join(map(str, others))
    supply = "cut the motors' supply if it cannot wait"
    if emergency:
        raise LinkError(
            f"port {port}: in use by {names}, so nothing else can send an emergency stop; without --emergency that"
            f" program is asked to stop; {supply}"
        )
    if not all(one.is_planarm for one in others):
        raise LinkError(
            f"port {port}: in use by {names}, which planarm cannot ask to stop; stop the motion there, or end that"
            f" program and try again; {supply}"
        )
    for _ in ("hold", "stop"):
        for one in others:
            _interrupt(port, one)
        time.sleep(BETWEEN_SIGNALS_S)
    if not _have_let_go(port, others):
        raise LinkError(
            f"port {port}: {names} was asked to stop and still has the port after {LET_GO_S:g} s; look at what it says,"
            f" or end it with `kill {others[0].pid}`: the arm then comes to rest on its path; {supply}"
        )
    return {"asked": [str(one) for one in others], "let_go": True}


def _interrupt(port: str, one: Holder) -> None:
    with suppress(ProcessLookupError):  # it has ended meanwhile
        try:
            os.kill(one.pid, signal.SIGINT)
        except PermissionError as error:
            raise LinkError(f"port {port}: in use by {one}, another user's: stop it there, or as that user") from error


def _have_let_go(port: str, others: Sequence[Holder]) -> bool:
    from planarm.link.port_holder import holders

    pids, limit_s = {one.pid for one in others}, time.monotonic() + LET_GO_S
    while pids & {one.pid for one in holders(port)}:
        if time.monotonic() > limit_s:
            return False
        time.sleep(LOOK_S)
    return True
