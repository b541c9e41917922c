"""`emulate` and `python -m planarm_sim`: a program behind a terminal, until it is stopped."""

import csv
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import serial

from planarm_sim import Uno
from planarm_sim.__main__ import main, summary
from planarm_sim.bench import Bench
from planarm_sim.bridge import BOOT_S
from planarm_sim.bridge.pty_line import PtyLine
from planarm_sim.debug.packets import packet
from planarm_sim.drivers import wiring_of
from planarm_sim.emulate import TRACED_PINS, Stop, Watch, emulate, run_board
from planarm_sim.errors import ImageError
from planarm_sim.plant import desk_arm
from planarm_sim.trace import read_vcd
from sim_board.fake_line import FakeClock, FakeLine

ROOT = Path(__file__).parents[2]
DATA = Path(__file__).parent / "data"
LONG_S = 60.0  # a bound for what comes at once; compiling the chip for the first time is the longest


def run(image: str, acts=(), **settings):
    clock = FakeClock()
    said: list[str] = []
    uno = Uno.from_hex(DATA / image)
    return run_board(uno, FakeLine(clock, list(acts)), clock, Stop(), say=said.append, **settings), uno, said


# --- the engine, in emulated time ---


def test_edges_are_counted_and_carried_to_the_waveform_file(tmp_path):
    result, uno, _ = run("pulses.hex", watch=Watch(vcd=tmp_path / "w.vcd"), seconds=0.1)
    reference = Uno.from_hex(DATA / "pulses.hex")
    reference.run(cycles=uno.cycle)
    vcd = read_vcd(tmp_path / "w.vcd")
    assert set(vcd.edges) == set(TRACED_PINS)
    for pin in ("D9", "D10"):
        edges = reference.edges(pin)
        np.testing.assert_array_equal(vcd.edges[pin][1:], edges)
        assert result.rising_edges[pin] == int(edges["level"].sum()) == pytest.approx(1000, abs=1)
    assert set(result.rising_edges) == {"D9", "D10"}
    assert len(uno.edges("D9")) == 0, "carried away, so that memory does not grow"


def test_a_bench_around_the_board_moves_with_it_and_is_told_of():
    clock, uno = FakeClock(), Uno.from_hex(DATA / "pulses.hex")
    bench = Bench(uno, desk_arm(1), [wiring_of("tmc2209", step="D9", direction="D4", microsteps=64)])
    result = run_board(uno, FakeLine(clock, []), clock, Stop(), bench=bench, seconds=0.1, say=[].append)
    assert result.bench == bench.report()
    assert result.bench.counts[0].pulses == result.rising_edges["D9"]
    # 64 micro-steps of 200 full steps; DIR is low, so the arm turns clockwise.
    assert bench.q_rad[0] == pytest.approx(-result.rising_edges["D9"] / 12_800 * 2 * np.pi, abs=0.02)
    assert "\narm: " in summary(result)


def test_what_it_did_is_data():
    result, _, said = run("echo.hex", [(0.0, "open"), (0.15, b"abc")], seconds=0.1)
    assert result.cycles == pytest.approx(1_600_000, abs=8)
    assert result.clock_s == pytest.approx(0.1 + BOOT_S, abs=0.01)
    assert result.ratio == pytest.approx(0.5, rel=0.05), "half the time it stood in reset"
    assert result.ended == "time is up"
    assert not result.program_failed
    assert (result.counts.from_host_bytes, result.counts.to_host_bytes) == (3, 5)
    assert said == []
    assert summary(result) == (
        f"time is up; {result.cycles} cycles in 0.20 s ({result.ratio:.2f} x real time); rising edges: none; "
        "serial: opened 1 x, 3 bytes in, 5 out, 0 lost"
    )


def test_a_program_that_ends_ends_the_emulation(tmp_path):
    result, _, _ = run("echo.hex", [(0.0, "open"), (0.15, b"\x00")], watch=Watch(vcd=tmp_path / "w.vcd"))
    assert result.program_failed
    assert "BREAK" in result.ended
    assert read_vcd(tmp_path / "w.vcd").end_cycle > 0.04 * 16e6


def test_profile_and_serial_log_are_written_and_summed_up(tmp_path):
    watch = Watch(profile=tmp_path / "p.json", serial_log=tmp_path / "s.csv")
    result, uno, _ = run("echo.hex", [(0.0, "open"), (0.15, b"ab")], watch=watch, seconds=0.1)
    written = json.loads((tmp_path / "p.json").read_text())
    assert written == json.loads(json.dumps(result.insight.as_dict()))
    assert written["cycles"] == uno.cycle
    assert written["load"] == 1.0
    told = summary(result).splitlines()
    assert told[1] == "processor: 100.0% awake, 0.0% in interrupts; deepest stack 0 bytes", "echo.S polls"
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    sent = [row["byte"] for row in rows if row["direction"] == "to board"]
    answered = [row["byte"] for row in rows if row["direction"] == "from board"]
    assert sent == ["0x61", "0x62"]
    assert answered == ["0x52", "0x03", "0x62", "0x63"], "R, the causes of reset (power-up, pin), one more than sent"
    assert all(int(row["end_cycle"]) - int(row["start_cycle"]) == 640 for row in rows)
    assert len(uno.serial.log) == 0, "carried away, so that memory does not grow"


def test_profile_of_a_program_with_interrupts(tmp_path, capsys):
    image = str(ROOT / "firmware" / "release" / "uno.hex")
    run_it = [image, "--seconds", "0.05", "--speed", "max", "--profile", str(tmp_path / "p.json")]
    assert main([*run_it, "--symbols", str(tmp_path / "none.elf")]) == 2
    out, err = capsys.readouterr()
    assert out == "", "nothing was started"
    assert "none.elf: cannot be read" in err
    assert main(run_it) == 0
    assert "deepest stack" in capsys.readouterr().out


def test_a_debugger_attaches_to_a_running_board(tmp_path):
    said: list[str] = []
    stop, clock = Stop(), FakeClock()
    uno = Uno.from_hex(DATA / "pulses.hex")
    shown: list[bytes] = []

    class Conversation(FakeLine):
        """Attaches when the board has run a while, looks, lets it go on, and asks for the end."""

        peer: socket.socket | None = None

        def is_open(self):
            if self.clock.time_s > 0.02 and self.peer is None:
                port = int(said[0].rsplit(":", 1)[1])
                self.peer = socket.create_connection(("127.0.0.1", port), timeout=LONG_S)
                self.peer.sendall(packet(b"p22"))
            if self.clock.time_s > 0.04:
                stop()
            return super().is_open()

    line = Conversation(clock, [])

    def talk():
        while line.peer is None:
            time.sleep(0.001)
        shown.append(line.peer.recv(100))
        line.peer.sendall(packet(b"c"))

    debugger = threading.Thread(target=talk)
    debugger.start()
    result = run_board(uno, line, clock, stop, watch=Watch(gdb_port=0), say=said.append)
    debugger.join(LONG_S)
    line.peer.close()
    assert said[0].startswith("avr-gdb attaches by: target remote localhost:")
    assert re.fullmatch(rb"\+\$[0-9a-f]{8}#[0-9a-f]{2}", shown[0])
    assert result.ended == "stopped"
    assert uno.time_s > 0.03


def test_warnings_come_along():
    result, _, _ = run("unmodelled.hex", seconds=0.01)
    assert any("TWBR" in warning for warning in result.warnings)


def test_asking_for_the_end_ends_it_and_asking_twice_does_not_wait():
    stop = Stop()

    class StoppingClock(FakeClock):
        def now_s(self):
            if self.time_s > 0.05 and not stop.requested:
                stop()
            return super().now_s()

    clock = StoppingClock()
    uno = Uno.from_hex(DATA / "pulses.hex")
    result = run_board(uno, FakeLine(clock, []), clock, stop, say=[].append)
    assert result.ended == "stopped"
    assert uno.time_s == pytest.approx(0.05, abs=0.01)
    with pytest.raises(KeyboardInterrupt):
        stop()


# --- over a real terminal ---


def test_the_terminal_is_announced_first_and_gone_at_the_end(tmp_path):
    events: list[str] = []

    def announce(path: str) -> None:
        assert Path(path).is_char_device()
        assert str((tmp_path / "uno").readlink()) == path
        events.append(path)

    result = emulate(
        DATA / "pulses.hex", link=tmp_path / "uno", speed="max", seconds=0.01, announce=announce, say=events.append
    )
    assert len(events) == 1
    assert result.ended == "time is up"
    assert not (tmp_path / "uno").is_symlink()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_at_any_moment_ends_it_cleanly(tmp_path, number):
    before = signal.getsignal(number)
    result = emulate(
        DATA / "pulses.hex",
        link=tmp_path / "uno",
        announce=lambda _path: signal.raise_signal(number),  # the earliest moment at which a host can know of it
        say=[].append,
    )
    assert result.ended == "stopped"
    assert not (tmp_path / "uno").is_symlink()
    assert signal.getsignal(number) == before


def test_a_bad_image_is_told_before_any_terminal_is_made(tmp_path):
    with pytest.raises(ImageError):
        emulate(tmp_path / "none.hex", link=tmp_path / "uno", announce=[].append, say=[].append)
    assert not (tmp_path / "uno").is_symlink()


@pytest.mark.parametrize("speed", ["real", "max"])
def test_pyserial_talks_to_the_program(tmp_path, speed):
    link, wave = tmp_path / "uno", tmp_path / "w.vcd"
    command = [sys.executable, "-m", "planarm_sim", str(DATA / "echo.hex"), "--link", str(link)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(str(ROOT / folder) for folder in ("hil_sim", "protocol")),
    }
    with subprocess.Popen(
        [*command, "--vcd", str(wave), "--speed", speed], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        path = process.stdout.readline().strip()
        try:
            for name in (path, str(link)):  # the second opening finds the board reset
                with serial.Serial(name, 250_000, timeout=LONG_S, write_timeout=LONG_S) as port:
                    greeting = port.read(2)  # after the reset by opening, and after pyserial has flushed its buffers
                    assert greeting in (b"R\x02", b"R\x03"), "EXTRF; PORF too when opened before it was cleared"
                    text = bytes(range(5, 250)) * 4
                    port.write(text)
                    assert port.read(len(text)) == bytes(byte + 1 for byte in text)
        finally:
            process.send_signal(signal.SIGTERM)
        last = process.stdout.read().splitlines()[-1]
        assert process.wait(LONG_S) == 0
    assert last.startswith("stopped; ")
    assert "serial: opened 2 x, 1960 bytes in" in last
    assert not link.is_symlink()
    assert read_vcd(wave).end_cycle > 0


# --- the front end ---


def test_front_end_prints_the_path_then_the_closing_line(capsys):
    assert main([str(DATA / "pulses.hex"), "--seconds", "0.01", "--speed", "max"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("/dev/")
    assert lines[-1].startswith("time is up; 1600")
    assert "rising edges: D9 100, D10 100" in lines[-1]


def test_front_end_keeps_notes_out_of_its_output(capsys):
    assert main([str(DATA / "unmodelled.hex"), "--seconds", "0.01", "--speed", "max"]) == 0
    captured = capsys.readouterr()
    assert len(captured.out.splitlines()) == 2
    assert "note: TWBR (0xB8) belongs to a part that is not modelled" in captured.err


def test_front_end_names_what_is_wrong(capsys, tmp_path):
    assert main([str(tmp_path / "none.hex")]) == 2
    assert "none.hex: cannot be read" in capsys.readouterr().err


def test_front_end_tells_of_a_failed_program(capsys, monkeypatch):
    monkeypatch.setattr(PtyLine, "is_open", lambda _self: True)
    monkeypatch.setattr(PtyLine, "read", lambda _self, _most: b"\x01")
    assert main([str(DATA / "echo.hex"), "--speed", "max", "--no-reset-on-open"]) == 6
    assert "undefined opcode" in capsys.readouterr().out
