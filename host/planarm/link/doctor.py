"""What stands between this computer and a board: ports with their lasting names, rights, other programs, tools."""

import os
import shutil
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import serial.tools.list_ports

from planarm.link.exchange import open_session, request
from planarm.link.journal import JournalWriter, Kind
from planarm.link.port_holder import PROC, holders
from planarm.link.transport import Transport
from planarm_wire.messages import BOARDS, Query, State

BY_ID = Path("/dev/serial/by-id")
UDEV_RULES = (Path("/etc/udev/rules.d"), Path("/usr/lib/udev/rules.d"), Path("/run/udev/rules.d"))
MODEM_MANAGER = "ModemManager"
IGNORE_RULE = "ID_MM_DEVICE_IGNORE"
SLOW_SYNC_S = 0.02
"""A frame waits for the disk: twice this, in a row, and a queue of 150 ms runs low."""
SYNCS = 20
ROUND_TRIPS = 20


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at; `advice` is empty when it is well."""

    what: str
    advice: str = ""


@dataclass(frozen=True, slots=True)
class Port:
    """A serial port: device, the name that it keeps wherever it is plugged in, what it says it is, who has it open."""

    device: str
    by_id: str
    description: str
    usable: bool
    held_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that was found."""

    ports: tuple[Port, ...]
    findings: tuple[Finding, ...]
    board: dict[str, object] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether nothing needs a hand."""
        return not any(finding.advice for finding in self.findings)


def examine(folder: Path, proc: Path = PROC, by_id: Path = BY_ID, rules: Sequence[Path] = UDEV_RULES) -> Report:
    """Look at this computer.

    Args:
        folder: where runs are kept, whose disk journals are written to.
        proc: where the system tells of processes.
        by_id: where it has lasting names of ports.
        rules: where it has device rules.
    """
    ports = tuple(_ports(proc, by_id))
    findings = [_ports_finding(ports), *_rights(ports), *_modem_manager(proc, rules), _avrdude(), _disk(folder)]
    return Report(ports, tuple(findings))


def ask_board(transport: Transport) -> dict[str, object]:
    """Say HELLO and ask a few times; return what the board tells, with the round trips.

    An image tells how many joints it steps, not their wiring: `boards` names those that it may be.

    Raises:
        LinkError: it does not answer, or is none of ours.
        DeviceFault: it refuses.
    """
    session = open_session(transport)
    assert session.welcome is not None, "an open session has a welcome"
    trips_s = []
    for _ in range(ROUND_TRIPS):
        began_s = transport.clock.now_s()
        status = request(transport, session, Query())
        trips_s.append(transport.clock.now_s() - began_s)
    return {
        "firmware": ".".join(map(str, session.welcome.firmware_version)),
        "joints": session.welcome.joints,
        "boards": [board.name for board in BOARDS.values() if board.joints == session.welcome.joints],
        "boot_nonce": f"{session.welcome.boot_nonce:#010x}",
        "reset_cause": session.welcome.reset_cause.name.lower(),
        "interrupted": bool(session.welcome.interrupted),
        "state": State(status.state).name.lower(),
        "fault": status.fault.name.lower(),
        "executed_segments": status.ledger.executed_segments,
        "position_usteps": list(status.ledger.position_usteps),
        "inputs": status.inputs,
        "crc_errors": status.crc_errors,
        "bytes_lost": status.overruns + status.ring_full,
        "round_trip_ms": round(1e3 * statistics.median(trips_s), 3),
        "round_trip_most_ms": round(1e3 * max(trips_s), 3),
    }


def _ports(proc: Path, by_id: Path) -> list[Port]:
    names = {link.resolve(): str(link) for link in by_id.glob("*")} if by_id.is_dir() else {}
    found = []
    for port in serial.tools.list_ports.comports():
        usable = sys.platform == "win32" or os.access(port.device, os.R_OK | os.W_OK)
        held = tuple(str(holder) for holder in holders(port.device, proc))
        name = names.get(Path(port.device).resolve(), "")
        found.append(Port(port.device, name, port.description or "", usable, held))
    return sorted(found, key=lambda port: port.device)


def _ports_finding(ports: Sequence[Port]) -> Finding:
    if ports:
        return Finding(f"{len(ports)} serial port{'s' * (len(ports) != 1)}")
    return Finding("no serial port", "plug the board in; a cable that only charges has no data lines")


def _rights(ports: Sequence[Port]) -> list[Finding]:
    return [
        Finding(f"{port.device} may not be opened", "join the port's group (usually dialout) and log in again")
        for port in ports
        if not port.usable
    ] + [
        Finding(f"{port.device} is in use by {', '.join(port.held_by)}", "close that program first")
        for port in ports
        if port.held_by
    ]


def _modem_manager(proc: Path, rules: Sequence[Path]) -> list[Finding]:
    """ModemManager opens new ports and talks to them, which resets an Uno."""
    if not any(_name_of(folder) == MODEM_MANAGER for folder in proc.glob("[0-9]*")):
        return []
    for folder in rules:
        for rule in folder.glob("*.rules") if folder.is_dir() else ():
            if "2341" in (text := rule.read_text(errors="replace")) and IGNORE_RULE in text:
                return [Finding(f"ModemManager runs and leaves Unos alone ({rule})")]
    return [Finding("ModemManager runs, and opens every new port", "install the udev rule of docs/streaming.md")]


def _name_of(folder: Path) -> str:
    try:
        return (folder / "comm").read_text().strip()
    except OSError:
        return ""


def _avrdude() -> Finding:
    found = shutil.which("avrdude")
    return Finding(f"avrdude: {found}") if found else Finding("no avrdude", "install it for planarm flash")


def _disk(folder: Path, now_s: Callable[[], float] = time.monotonic) -> Finding:
    """Measure how long a frame waits until the disk has it."""
    path = folder / ".planarm-doctor.journal"
    journal = JournalWriter(path)
    try:
        took_s = []
        for _ in range(SYNCS):
            began_s = now_s()
            journal.add(Kind.SENT, 0.0, bytes(60))
            journal.sync()
            took_s.append(now_s() - began_s)
    finally:
        journal.close()
        path.unlink(missing_ok=True)
    text = f"a frame is on the disk after {1e3 * statistics.median(took_s):.1f} ms (most {1e3 * max(took_s):.1f} ms)"
    slow = statistics.median(took_s) > SLOW_SYNC_S
    return Finding(text, "keep runs (--out) on a faster disk" if slow else "")
