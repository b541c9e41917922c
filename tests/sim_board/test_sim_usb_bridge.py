"""The 16U2 between board and host, against the source of its firmware: rings, flushes, packets, rates."""

from pathlib import Path

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim import Uno
from planarm_sim.board.usb_bridge import FLUSH_CYCLES, PACKET_CYCLES, UsbBridge, bridge_bit_cycles
from planarm_sim.bridge import Bridge
from planarm_sim.errors import UsageError
from sim_board.fake_line import FakeClock, FakeLine

DATA = Path(__file__).parent / "data"
BYTE = 640  # cycles of a byte at 250,000 baud
GIVE_UP = 1_600_000  # 100 ms


def feed(bridge, count, start=0, spacing=BYTE, first=0):
    for n in range(count):
        bridge.receive(start + n * spacing, (first + n) & 0xFF)
    return start + (count - 1) * spacing


# --- the bridge alone ---


def test_few_bytes_wait_for_the_timer():
    # Timer 0 runs at clk/256 and overflows every 256 counts: 65,536 cycles, 4.096 ms.
    bridge = UsbBridge()
    feed(bridge, 10)
    assert bridge.fetch(FLUSH_CYCLES - 1) == b""
    assert bridge.fetch(FLUSH_CYCLES + PACKET_CYCLES - 1) == b"", "a packet of its own takes its time"
    assert bridge.fetch(FLUSH_CYCLES + PACKET_CYCLES) == bytes(range(10))
    assert FLUSH_CYCLES / 16e6 == 4.096e-3


@pytest.mark.parametrize("at", [0, 12 * BYTE, FLUSH_CYCLES, FLUSH_CYCLES + PACKET_CYCLES - 1, FLUSH_CYCLES + 20_000])
def test_what_is_thrown_away_does_not_come_later(at):
    bridge = UsbBridge()
    feed(bridge, 12)
    had = bridge.fetch(at) if at > 12 * BYTE else b""
    assert bridge.discard(max(at, 11 * BYTE)) == 12 - len(had)
    feed(bridge, 3, start=FLUSH_CYCLES + 30_000, first=100)
    assert bridge.fetch(3 * FLUSH_CYCLES) == bytes([100, 101, 102])


def test_more_than_96_bytes_do_not_wait():
    bridge = UsbBridge()
    at = feed(bridge, 96, spacing=100)
    assert bridge.fetch(at + 10 * PACKET_CYCLES) == b""
    bridge.receive(at + 10 * PACKET_CYCLES, 96)
    assert bridge.fetch(at + 11 * PACKET_CYCLES) == bytes(range(64)), "packets of 64 bytes, one after the other"
    assert bridge.fetch(at + 12 * PACKET_CYCLES) == bytes(range(64, 97))


@settings(deadline=None)
@given(st.lists(st.integers(80, 30_000), min_size=1, max_size=600))
def test_a_host_that_fetches_gets_every_byte_in_order_and_within_the_rule(spacings):
    bridge = UsbBridge()
    cycle, sent = 0, bytearray()
    got = bytearray()
    for n, spacing in enumerate(spacings):
        cycle += spacing
        bridge.receive(cycle, n & 0xFF)
        sent.append(n & 0xFF)
        got += bridge.fetch(cycle)
        assert sent.startswith(got)
        assert len(sent) - len(got) <= 97 + 64 + PACKET_CYCLES // 80 * 3
    assert got + bridge.fetch(cycle + FLUSH_CYCLES + 4 * PACKET_CYCLES) == sent
    assert bridge.overrun_bytes == 0


def test_a_host_that_does_not_fetch_loses_what_runs_over():
    bridge = UsbBridge()
    bridge.host_takes = False
    at = feed(bridge, 97)  # 64 go into the packet, and the main loop waits with the next one
    at = feed(bridge, 95, start=at + BYTE, first=97)
    assert bridge.overrun_bytes == 0, "33 and 95 are 128"
    feed(bridge, 2, start=at + BYTE, first=192)
    assert bridge.overrun_bytes == 2
    bridge.host_takes = True
    got = bridge.fetch(at + 100 * BYTE)
    # The two new bytes lie where the oldest two of the ring lay, and are read there, and again in their turn.
    assert got[:64] == bytes(range(64))
    assert got[64:66] == bytes([192, 193])
    assert got[66:192] == bytes(range(66, 192))
    assert got[192:] == bytes([192, 193])


def test_the_bridge_gives_up_a_byte_every_100_ms():
    bridge = UsbBridge()
    bridge.host_takes = False
    at = feed(bridge, 97)
    bridge.advance(at + 3 * GIVE_UP + 10)
    bridge.host_takes = True
    got = bridge.fetch(at + 3 * GIVE_UP + FLUSH_CYCLES)
    assert got == bytes(range(64)) + bytes(range(67, 97)), "bytes 64, 65 and 66 were given up"


def test_rates_are_those_of_its_divider():
    # 16 MHz / 8 / 17 at "115200"; 57,600 with sixteen samples: 16 MHz / 16 / 17 (Arduino-usbserial.c, "Special case").
    assert bridge_bit_cycles(115_200) == 136
    assert bridge_bit_cycles(57_600) == 272
    assert bridge_bit_cycles(250_000) == 64
    assert bridge_bit_cycles(9_600) == 1664
    with pytest.raises(UsageError, match="baud is 300; the Uno's USB bridge takes 489 and more"):
        Uno.from_hex(DATA / "echo.hex", usb="16u2", baud=300)


# --- on the board ---


def test_an_echo_comes_back_at_the_next_tick():
    uno = Uno.from_hex(DATA / "echo.hex", usb="16u2")
    uno.run(cycles=100_000)
    assert uno.serial.read() == b"R\x01"
    uno.serial.write(b"abc")
    uno.run(cycles=2 * FLUSH_CYCLES - uno.cycle)
    assert uno.serial.read() == b""
    kept = uno.snapshot()
    uno.run(cycles=PACKET_CYCLES + 10)
    assert uno.serial.read() == b"bcd"
    uno.restore(kept)
    uno.run(cycles=PACKET_CYCLES + 10)
    assert uno.serial.read() == b"bcd"
    with pytest.raises(UsageError, match="another usb="):
        Uno.from_hex(DATA / "echo.hex").restore(kept)
    with pytest.raises(UsageError, match="direct line"):
        Uno.from_hex(DATA / "echo.hex").serial.host_takes = False
    with pytest.raises(UsageError, match="usb is '8u2'"):
        Uno.from_hex(DATA / "echo.hex", usb="8u2")


@pytest.mark.parametrize("baud", [125_000, 200_000, 300_000])
def test_a_host_at_another_rate_gets_garbage_both_ways(baud):
    uno = Uno.from_hex(DATA / "echo.hex", usb="16u2", baud=baud)
    uno.run(seconds=0.01)
    assert uno.serial.read() != b"R\x01"
    uno.serial.write(b"\x55\x5a")
    uno.run(seconds=0.01)
    assert uno.serial.read() != b"\x56\x5b"
    if baud == 300_000:
        assert uno.serial.framing_errors > 0


# --- behind a line ---


class Rig:
    def __init__(self, acts, *, room=10**6, baud=250_000, baud_set=None):
        self.uno = Uno.from_hex(DATA / "echo.hex", usb="16u2", baud=baud)
        self.uno.run(seconds=0.02)
        self.uno.serial.read()
        self.clock = FakeClock()
        self.line = FakeLine(self.clock, acts, room)
        self.line.baud_set = baud_set
        self.said: list[str] = []
        self.bridge = Bridge(
            self.uno, self.line, self.clock, boot_s=None, follow_baud=True, say=self.said.append, after_run=lambda: None
        )


def test_the_line_follows_the_rate_that_the_host_sets():
    rig = Rig([(0.0, "open"), (0.02, b"hello")], baud=9_600, baud_set=250_000)
    rig.bridge.run(seconds=0.05)
    assert rig.line.text == b"ifmmp"
    rig = Rig([(0.0, "open"), (0.02, b"hello")], baud_set=110)
    rig.bridge.run(seconds=0.05)
    assert rig.line.text == b"ifmmp"
    (told,) = rig.said
    assert told.startswith("the host sets 110 baud, the line stays at 250000: baud is 110;")


def test_a_host_that_does_not_read_makes_the_bridge_run_over():
    rig = Rig([(0.0, "open"), (0.01, bytes(range(10, 210)) * 5)], room=100)  # 0 to 2 end the program
    rig.bridge.run(seconds=0.1)
    assert len(rig.line.text) == 100
    assert rig.line.text == bytes(range(11, 111))
    # 708 come too many; the firmware's count of the ring starts anew after 255, and half of these are below its size.
    assert 708 // 2 - 64 < rig.uno.serial.bridge.overrun_bytes <= 708
    rig.line.room = 10**6
    rig.bridge.run(seconds=0.1)
    assert len(rig.line.text) > 100 + 64, "what is left comes when the host reads again"


# --- over a real terminal ---


def test_a_hosts_rates_are_seen_on_a_terminal(tmp_path):
    pytest.importorskip("fcntl", reason="pseudo-terminals need POSIX")
    from planarm_sim.bridge.pty_line import PtyLine  # noqa: PLC0415 - POSIX only

    with PtyLine(tmp_path / "uno", 250_000) as line:
        if line.baud() is None:
            pytest.skip("this system does not tell a terminal's rate")
        assert line.baud() == 250_000
        for rate in (9_600, 115_200, 250_000, 500_000, 2_000_000):
            with serial.Serial(str(tmp_path / "uno"), rate):
                assert line.baud() == rate


# --- when the host has something to fetch ---


@settings(deadline=None)
@given(st.lists(st.integers(BYTE, 40_000), min_size=1, max_size=300))
def test_a_host_that_looks_only_when_told_misses_nothing(spacings):
    bridge = UsbBridge()
    cycle, got, told = 0, bytearray(), bridge.next_delivery_cycle(0, BYTE)

    def look_until(end):
        nonlocal told
        while told <= end:
            assert bridge.fetch(told - 1) == b"", "nothing comes before"
            got.extend(bridge.fetch(told))
            before, told = told, bridge.next_delivery_cycle(told, BYTE)
            assert told > before

    for n, spacing in enumerate(spacings):
        cycle += spacing
        look_until(cycle)
        bridge.receive(cycle, n & 0xFF)
    look_until(cycle + 2 * FLUSH_CYCLES)
    assert got == bytes(n & 0xFF for n in range(len(spacings)))


def test_the_next_delivery_is_a_ticks_or_a_nearly_full_rings():
    bridge = UsbBridge()
    assert bridge.next_delivery_cycle(0, BYTE) == 97 * BYTE + PACKET_CYCLES, "97 bytes come before the first tick"
    assert bridge.next_delivery_cycle(0, 2 * BYTE) == FLUSH_CYCLES + PACKET_CYCLES
    at = feed(bridge, 10)
    due = bridge.next_delivery_cycle(at, 2 * BYTE)
    assert (bridge.fetch(due - 1), bridge.fetch(due)) == (b"", bytes(range(10)))
    nearly = feed(bridge, 90, start=due)
    assert bridge.next_delivery_cycle(nearly, BYTE) == nearly + 7 * BYTE + PACKET_CYCLES, "seven more may come first"
