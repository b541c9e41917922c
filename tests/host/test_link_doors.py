"""Doors to a board beside the plain port: files, spies, the network; who holds a port; what the doctor sees."""

import gc
import os
import pty
import socket
import subprocess
import sys
import threading
import tty
from pathlib import Path

import pytest
import serial
import serial.rfc2217

from link_echo import write_echo_image
from link_model import motion
from planarm.cli.main import main
from planarm.errors import LinkError
from planarm.link.doctor import ask_board, examine
from planarm.link.exchange import stream_plan
from planarm.link.flash import flash
from planarm.link.journal import Kind, read_journal
from planarm.link.port_holder import Holder, holders
from planarm.link.transport import open_transport
from planarm_wire.framing import Frame, FrameDecoder
from planarm_wire.messages import BOARDS

FOREVER_S = float("inf")


def test_a_file_gets_the_bytes_that_a_board_would_get(tmp_path):
    plan = motion(20)
    path = tmp_path / "stream.bin"
    line = open_transport(f"file://{path}")
    result = stream_plan(line, plan)
    line.close()
    frames = FrameDecoder().feed(path.read_bytes())
    assert all(isinstance(frame, Frame) for frame in frames)
    assert len(path.read_bytes()) == result.bytes_sent
    with pytest.raises(LinkError, match=r"file://.*cannot be written"):
        open_transport(f"file://{tmp_path}/none/stream.bin")
    with pytest.raises(LinkError, match="give a path"):
        open_transport("file://")


def test_a_spy_keeps_what_passes(tmp_path):
    kept = tmp_path / "line.journal"
    line = open_transport(f"spy+sim://?image={write_echo_image(tmp_path)}#{kept}")
    line.clock.wait_until(0.001)
    line.write(b"ab")
    data = b""
    while len(data) < 2:
        data += line.read(10, FOREVER_S)
    assert data == b"ab"
    line.close()
    records = read_journal(kept).records
    assert [r.data for r in records if r.kind is Kind.SENT] == [b"ab"]
    assert b"".join(r.data for r in records if r.kind is Kind.RECEIVED) == b"ab"
    with pytest.raises(LinkError, match="unknown scheme"):
        open_transport(f"spy+usb://1#{kept}")


@pytest.mark.filterwarnings("ignore:set(Daemon|Name)\\(\\) is deprecated:DeprecationWarning")  # pyserial 3.5 calls them
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # and leaves its socket to the collector
def test_a_port_on_another_computer_by_rfc2217():
    """The other computer is a thread: its serial port is pyserial's loop, its server pyserial's own."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            peer, _ = server.accept()
            with (
                peer,
                serial.serial_for_url("loop://", timeout=0.05) as port,
                peer.makefile("wb", buffering=0) as writer,
            ):
                manager = serial.rfc2217.PortManager(port, writer)
                while data := peer.recv(1024):
                    port.write(b"".join(manager.filter(data)))
                    writer.write(b"".join(manager.escape(port.read(port.in_waiting))))

        other = threading.Thread(target=serve, daemon=True)
        other.start()
        line = open_transport(f"rfc2217://127.0.0.1:{server.getsockname()[1]}")
        line.write(b"\x7e\xff\x00")
        data = b""
        while len(data) < 3:
            data += line.read(10, line.clock.now_s() + 5.0)
        assert data == b"\x7e\xff\x00"
        line.close()
        other.join(5.0)
    del line
    gc.collect()


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells in /proc who has a file open")
def test_the_second_host_is_told_who_the_first_is(terminal):
    program = (
        "import sys, time; from planarm.link.transport import open_transport;"
        "line = open_transport(sys.argv[1]); print('open', flush=True); sys.stdin.read()"
    )
    words = [sys.executable, "-c", program, terminal]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout.readline() == "open\n"
        with pytest.raises(LinkError, match=rf"in use by process {first.pid} \(python.*\); close that program first"):
            open_transport(terminal)
        first.stdin.close()
    open_transport(terminal).close()


def test_holders_are_found_in_proc(tmp_path):
    device = tmp_path / "ttyACM0"
    device.write_text("")
    for pid, target, command in ((7, device, b"/usr/bin/screen\0/dev/ttyACM0\0"), (8, tmp_path / "other", b"cat\0")):
        descriptors = tmp_path / "proc" / str(pid) / "fd"
        descriptors.mkdir(parents=True)
        (descriptors / "3").symlink_to(target)
        (descriptors.parent / "cmdline").write_bytes(command)
    (tmp_path / "proc" / "9").mkdir()
    assert holders(str(device), tmp_path / "proc") == (Holder(7, "screen /dev/ttyACM0"),)
    (tmp_path / "proc/7/cmdline").write_bytes(b"python\0-c\0import time\ntime.sleep(9)\0")
    (told,) = holders(str(device), tmp_path / "proc")
    assert told.command == "python -c import time time.sleep(9)", "one line, whatever the process was given"


@pytest.mark.parametrize(
    ("words", "ours"),
    [
        (("/usr/bin/python3", "/home/x/.venv/bin/planarm", "run", "a.toml"), True),
        (("/home/x/bin/planarm", "run"), True),
        (("python", "-m", "planarm", "goto"), True),
        (("python", "-c", "from planarm.cli.main import main; main()", "run"), True),
        (("screen", "/dev/ttyACM0"), False),
        (("minicom", "-C", "/home/x/planarm/log"), False),
    ],
)
def test_our_own_programs_are_known(tmp_path, words, ours):
    """Others are not sent signals, even when they have something of ours among their words."""
    device = tmp_path / "ttyACM0"
    device.write_text("")
    descriptors = tmp_path / "proc" / "7" / "fd"
    descriptors.mkdir(parents=True)
    (descriptors / "3").symlink_to(device)
    (descriptors.parent / "cmdline").write_bytes("\0".join((*words, "")).encode())
    assert [one.is_planarm for one in holders(str(device), tmp_path / "proc")] == [ours]


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells in /proc who has a file open")
@pytest.mark.parametrize("more", [[], ["--emergency"]])
def test_stop_names_a_foreign_program_that_has_the_port_and_says_what_to_do(terminal, more, capsys):
    words = [sys.executable, "-c", "import sys; f = open(sys.argv[1]); print('open', flush=True); sys.stdin.read()"]
    with subprocess.Popen([*words, terminal], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "open\n"
        with pytest.raises(SystemExit) as left:
            main(["stop", "--port", terminal, *more])
        assert other.poll() is None, "it was left alone"
        other.stdin.close()
    told = " ".join(capsys.readouterr().err.split())
    assert left.value.code == 5
    assert f"in use by process {other.pid} (python" in told
    advice = "which planarm cannot ask to stop; stop the motion there" if not more else "without --emergency"
    assert advice in told
    assert "cut the motors' supply" in told


def test_the_doctor_names_ports_by_id_and_what_needs_a_hand(tmp_path, monkeypatch):
    device = tmp_path / "ttyACM0"
    device.write_text("")
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    (by_id / "usb-Arduino_Uno-if00").symlink_to(device)
    manager = tmp_path / "proc" / "40"
    manager.mkdir(parents=True)
    (manager / "comm").write_text("ModemManager\n")

    class Info:
        def __init__(self) -> None:
            self.device, self.description = str(device), "Arduino Uno"

    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [Info()])
    monkeypatch.setattr("shutil.which", lambda _name: None)
    report = examine(tmp_path, tmp_path / "proc", by_id, [tmp_path / "rules"])
    assert [(port.device, port.by_id) for port in report.ports] == [(str(device), str(by_id / "usb-Arduino_Uno-if00"))]
    advice = " ".join(finding.advice for finding in report.findings)
    assert "udev rule" in advice
    assert "planarm flash" in advice
    assert any("on the disk after" in finding.what for finding in report.findings)
    assert not report.ok
    rules = tmp_path / "rules"
    rules.mkdir()
    (rules / "99-uno.rules").write_text('ATTRS{idVendor}=="2341", ENV{ID_MM_DEVICE_IGNORE}="1"\n')
    report = examine(tmp_path, tmp_path / "proc", by_id, [rules])
    assert any("leaves Unos alone" in finding.what for finding in report.findings)


def test_the_doctor_asks_the_board():
    told = ask_board(open_transport("sim://"))
    assert told["state"] == "idle"
    assert told["position_usteps"] == [0, 0]
    assert set(told["boards"]) == {board.name for board in BOARDS.values() if board.joints == 2}
    assert 1.0 < told["round_trip_ms"] < 5.0


def test_flashing_says_what_is_missing_and_what_avrdude_said(tmp_path):
    image = tmp_path / "uno.hex"
    with pytest.raises(LinkError, match="no such flash image"):
        flash("/dev/ttyACM0", image)
    image.write_text("")
    with pytest.raises(LinkError, match=r"port sim://: flashing needs a board's own device"):
        flash("sim://", image)
    with pytest.raises(LinkError, match="no-such-tool is not installed"):
        flash("/dev/ttyACM0", image, "no-such-tool")
    refused = subprocess.CompletedProcess([], 1, "", "avrdude: stk500_getsync(): not in sync\n")
    with pytest.raises(LinkError, match=r"/dev/ttyACM0: avrdude could not write .*not in sync.*boot loader"):
        flash("/dev/ttyACM0", image, "sh", lambda _words: refused)
    seen = []
    flash("/dev/ttyACM0", image, "sh", lambda words: seen.append(words) or subprocess.CompletedProcess([], 0, "", ""))
    assert seen[0][-2:] == ["-U", f"flash:w:{image}:i"]
    assert Path(seen[0][0]).name == "sh"
