"""The board: named pins, a paced serial line, and a time that passes only when told to.

Programs: data/*.S; `make -C tests/sim_board/data` builds them with avr-gcc.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim import Uno
from planarm_sim.board import CLOCK_HZ, PINS
from planarm_sim.board.pins import pin_name, pin_place
from planarm_sim.errors import LimitError, PinError, StoppedError, UsageError
from planarm_sim.loader import load_hex
from planarm_sim.trace import read_vcd

DATA = Path(__file__).parent / "data"
BYTE_CYCLES = 640  # ten bits of 64 cycles at 250,000 baud
GREETING = b"R\x01"  # echo.S: MCUSR after power-up has PORF alone (ATmega328P datasheet, 11.9.1)


@pytest.fixture
def echo() -> Uno:
    uno = Uno.from_hex(DATA / "echo.hex")
    uno.run_until(GREETING, limit_s=0.001)
    assert uno.serial.read() == GREETING
    return uno


@pytest.fixture
def pulses() -> Uno:
    return Uno.from_hex(DATA / "pulses.hex")


# --- pins ---


def test_pin_table_is_the_boards():
    # Arduino Uno Rev3: D0-D7 are PD0-PD7, D8-D13 are PB0-PB5, A0-A5 are PC0-PC5.
    ports = {f"D{n}": f"D{n}" for n in range(8)}
    ports |= {f"D{n}": f"B{n - 8}" for n in range(8, 14)}
    ports |= {f"A{n}": f"C{n}" for n in range(6)}
    assert {pin.name: f"{pin.port}{pin.bit}" for pin in PINS} == ports
    assert all(pin_name(pin.index) == pin.name for pin in PINS)
    assert pin_name(6) is None, "PB6 carries the crystal"
    roles = {pin.role: pin.name for pin in PINS}
    assert (roles["OC1A"], roles["OC1B"], roles["INT0"], roles["LED"]) == ("D9", "D10", "D2", "D13")


@pytest.mark.parametrize(
    ("wrong", "closest"),
    [
        ("D14", "D13"),
        ("d9", "D9"),
        ("A6", "A5"),
        ("9", "D9"),
        (9, "D9"),
        ("PB1", "D9"),
        ("pc5", "A5"),
        ("D1O", "D1"),
        ("", ""),
    ],
)
def test_an_unknown_pin_names_the_closest(pulses, wrong, closest):
    for ask in (pulses.edges, pulses.pin, pin_place):
        with pytest.raises(PinError, match=f"no pin {wrong!r}.*Closest: {closest}"):
            ask(wrong)


def test_a_pin_is_driven_and_let_go(pulses):
    button, led = pulses.pin("D2"), pulses.pin("D13")
    button.drive(1)
    pulses.run(cycles=100)
    assert (button.level, led.level) == (1, 1)
    button.drive(0)
    pulses.run(cycles=100)
    assert (button.level, led.level) == (0, 0)
    button.drive(1)
    button.release()
    pulses.run(cycles=100)
    assert (button.level, led.level) == (0, 0), "a floating pin reads 0"
    assert pulses.edges("D13")["level"].tolist() == [1, 0]
    with pytest.raises(PinError, match="D2 cannot be driven to 2"):
        button.drive(2)


# --- edges and time ---


def test_compare_outputs_toggle_every_800_cycles(pulses):
    # CTC mode with OCR1A = 799 has a period of OCR1A + 1 timer clocks (ATmega328P datasheet, 16.9.2).
    pulses.run(seconds=0.01)
    one, two = pulses.edges("D9"), pulses.edges("D10")
    assert len(one) == 200 - (one["cycle"][0] > 800)
    assert set(np.diff(one["cycle"])) == {800}
    assert one["level"].tolist() == [(n + 1) % 2 for n in range(len(one))]
    # OCR1B = 0 matches one timer clock after OCR1A = TOP, when the counter is 0 again.
    assert set(np.diff(two["cycle"])) == {800}


def test_clearing_edges_forgets_them_of_all_pins(pulses):
    pulses.run(cycles=4000)
    before = pulses.edges("D9")
    pulses.clear_edges()
    assert len(pulses.edges("D9")) == len(pulses.edges("D10")) == 0
    pulses.run(cycles=1600)
    assert pulses.edges("D9")["cycle"][0] == before["cycle"][-1] + 800


@settings(deadline=None, max_examples=25)
@given(st.lists(st.integers(0, 5000), max_size=12))
def test_a_run_in_pieces_is_the_run_in_one(pieces):
    whole, split = (Uno.from_hex(DATA / "pulses.hex") for _ in range(2))
    for piece in pieces:
        split.run(cycles=piece)
    whole.run(cycles=split.cycle)
    assert whole.cycle == split.cycle
    for pin in ("D9", "D10"):
        np.testing.assert_array_equal(whole.edges(pin), split.edges(pin))


def test_seconds_are_cycles(pulses):
    pulses.run(seconds=0.001)
    assert 16_000 <= pulses.cycle < 16_000 + 8, "the last instruction is finished"
    assert pulses.time_s == pulses.cycle / CLOCK_HZ


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"cycles": 1, "seconds": 1.0},
        {"cycles": -1},
        {"seconds": -0.1},
        {"seconds": float("nan")},
        {"seconds": float("inf")},
    ],
)
def test_time_is_given_once_and_forward(pulses, arguments):
    with pytest.raises(UsageError):
        pulses.run(**arguments)


def test_waveform_file_holds_the_recorded_edges(pulses, tmp_path):
    pulses.run(cycles=5000)
    pulses.clear_edges()
    start, level = pulses.cycle, pulses.pin("D9").level
    pulses.run(cycles=5000)
    pulses.write_vcd(tmp_path / "w.vcd", ["D10", "D9", "A0"])
    vcd = read_vcd(tmp_path / "w.vcd")
    assert (vcd.start_cycle, vcd.end_cycle) == (start, pulses.cycle)
    assert vcd.edges["D9"][0].tolist() == (start, level)
    np.testing.assert_array_equal(vcd.edges["D9"][1:], pulses.edges("D9"))
    np.testing.assert_array_equal(vcd.edges["D10"][1:], pulses.edges("D10"))
    assert vcd.edges["A0"].tolist() == [(start, 0)]


# --- serial ---


def test_every_byte_goes_through_the_program(echo):
    sent = bytes(range(3, 255))
    echo.serial.write(sent)
    echo.run(seconds=0.02)
    assert echo.serial.read() == bytes(byte + 1 for byte in sent)
    assert echo.serial.read() == b""
    assert echo.serial.framing_errors == 0


def test_bytes_take_ten_bits_each_way(echo):
    start = echo.cycle
    echo.serial.write(b"abc")
    arrivals = []
    while len(arrivals) < 3:
        echo.run(cycles=1)
        arrivals += [echo.cycle] * len(echo.serial.read())
    # In: ten bits, of which the receiver is done within the stop bit; out: ten bits after that. Between them the
    # program polls: at most some 20 cycles.
    assert start + 2 * BYTE_CYCLES - 64 < arrivals[0] < start + 2 * BYTE_CYCLES + 64 + 20
    assert np.diff(arrivals) == pytest.approx([BYTE_CYCLES] * 2, abs=64 + 20)


@pytest.mark.parametrize("data", ["text", [1, 2], 5, None])
def test_a_line_takes_bytes_only(echo, data):
    with pytest.raises(UsageError, match="a serial line takes bytes, not"):
        echo.serial.write(data)
    assert echo.serial.pending == 0


def test_pending_counts_what_is_still_on_the_line(echo):
    echo.serial.write(bytes([7] * 10))
    assert echo.serial.pending == 10
    echo.run(cycles=BYTE_CYCLES * 4 + 10)
    assert echo.serial.pending == 6
    echo.run(cycles=BYTE_CYCLES * 6 + 10)
    assert echo.serial.pending == 0


def test_the_log_has_every_frame_both_ways_with_its_cycles(echo):
    echo.serial.clear_log()
    start = echo.cycle
    echo.serial.write(b"ab")
    kept = echo.snapshot()
    echo.run(seconds=0.001)
    log = echo.serial.log
    to_board, from_board = log[log["direction"] == 0], log[log["direction"] == 1]
    assert to_board.tolist() == [
        (start + n * BYTE_CYCLES, start + (n + 1) * BYTE_CYCLES, 0, b) for n, b in enumerate(b"ab")
    ]
    assert from_board["byte"].tolist() == list(b"bc"), "echo.S adds one"
    assert (from_board["end"] - from_board["start"]).tolist() == [BYTE_CYCLES] * 2
    assert np.all(np.diff(log["end"]) >= 0)
    echo.restore(kept)
    echo.run(seconds=0.001)
    assert echo.serial.log.tolist() == log.tolist()
    echo.serial.clear_log()
    assert len(echo.serial.log) == 0


@settings(deadline=None, max_examples=25)
@given(st.integers(9_600, 2_000_000), st.integers(1, 60), st.integers(1, 60))
def test_pacing_never_drifts(baud, first, second):
    uno = Uno.from_hex(DATA / "pulses.hex", baud=baud)
    uno.serial.write(bytes(first))
    uno.serial.write(bytes(second))
    end = 10 * CLOCK_HZ * (first + second) / baud
    uno.run(cycles=int(end) - 4)
    assert uno.serial.pending >= 1
    uno.run(cycles=8)
    assert uno.serial.pending == 0


def test_a_wrong_baud_rate_is_garbage_not_silence(echo):
    echo.serial.baud = 125_000  # twice too slow: the program sees other bytes, or framing errors
    echo.serial.write(b"UUU")
    echo.run(seconds=0.001)
    assert echo.serial.read() != b"VVV"


def test_baud_rates_within_tolerance_are_understood():
    # 2 % apart is inside what a receiver with 8N1 takes (ATmega328P datasheet, table 20-3).
    uno = Uno.from_hex(DATA / "echo.hex", baud=245_000)
    uno.run_until(GREETING, limit_s=0.001)
    uno.serial.write(b"Hello")
    uno.run(seconds=0.001)
    assert uno.serial.read() == GREETING + b"Ifmmp"
    assert uno.serial.framing_errors == 0


@pytest.mark.parametrize("baud", [9600, 57_600, 115_200, 250_000, 1_000_000, 1_999_999])
def test_what_is_not_sampled_would_have_been_heard_as_it_is(baud):
    """Frames of nearly the line's rate are passed on as they are, and no others: sampled bit by bit, all 256 agree."""
    serial = Uno.from_hex(DATA / "echo.hex", baud=baud).serial
    every = np.arange(256)
    cycles = CLOCK_HZ / baud
    for bit_cycles in sorted({max(1, round(cycles * share)) for share in np.linspace(0.85, 1.15, 121)}):
        errors = serial.framing_errors
        heard, data = serial._sample(every, np.full(256, bit_cycles))
        as_they_are = bool(heard.all()) and data.tolist() == every.tolist() and serial.framing_errors == errors
        assert serial._hears_every_bit(bit_cycles, bit_cycles) == as_they_are, (baud, bit_cycles)
    assert not serial._hears_every_bit(round(cycles), round(1.5 * cycles + 1))


@pytest.mark.parametrize("baud", [0, 299, 2_000_001])
def test_impossible_baud_rates_are_refused(echo, baud):
    with pytest.raises(UsageError, match=f"baud is {baud}; .* 300 to 2000000"):
        echo.serial.baud = baud


# --- waiting, stopping, snapshots, reset ---


def test_waiting_for_bytes_leaves_them_to_be_read(echo):
    echo.serial.write(b"abcdef")
    echo.run_until(b"de", limit_s=0.01)
    assert b"de" in echo.serial.peek()
    assert echo.serial.read().startswith(b"bcde")


def test_waiting_for_a_condition(pulses):
    def ten_edges(uno: Uno) -> bool:
        return len(uno.edges("D9")) >= 10

    pulses.run_until(ten_edges, limit_s=0.1, every_cycles=100)
    last = pulses.edges("D9")["cycle"][-1]
    assert len(pulses.edges("D9")) == 10
    assert last <= pulses.cycle < last + 110


def test_waiting_in_vain_says_for_what_and_how_long(echo):
    echo.serial.write(b"x")
    with pytest.raises(LimitError, match=r"waited 0\.002 s for b'never'.*not yet read from the board: b'y'") as caught:
        echo.run_until(b"never", limit_s=0.002)
    assert caught.value.cycle == echo.cycle
    with pytest.raises(LimitError, match="for impossible"):
        echo.run_until(lambda_named("impossible"), limit_s=0.0)


def lambda_named(name):
    def condition(_uno):
        return False

    condition.__name__ = name
    return condition


@pytest.mark.parametrize(
    ("byte", "cause", "words"),
    [(0, "BREAK", "BREAK"), (1, "BAD_OPCODE", "undefined opcode"), (2, "ASLEEP", "nothing can wake")],
)
def test_what_ends_a_program_is_a_typed_error(echo, byte, cause, words):
    echo.serial.write(bytes([byte]))
    with pytest.raises(StoppedError, match=rf"echo\.hex: the program ended at cycle \d+ .*{words}") as caught:
        echo.run(seconds=1)
    assert caught.value.cause == cause
    assert caught.value.cycle == echo.cycle < CLOCK_HZ // 100


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 6000), st.integers(1, 6000), st.binary(min_size=1, max_size=20))
def test_after_a_snapshot_the_same_run_follows(before, after, data):
    uno = Uno.from_hex(DATA / "echo.hex")
    uno.run(seconds=0.001)
    uno.serial.write(bytes(b % 250 + 3 for b in data))
    uno.run(cycles=before)
    snapshot = uno.snapshot()

    def rest():
        uno.run(cycles=after)
        uno.serial.write(b"more")
        pending = uno.serial.pending
        uno.run(seconds=0.003)
        return uno.cycle, pending, uno.serial.read(), uno.edges("D1").tolist()

    first = rest()
    uno.restore(snapshot)
    assert rest() == first
    assert uno.serial.peek() == b""
    assert first[2].endswith(b"npsf")


def test_a_snapshot_keeps_the_recorded_edges(pulses):
    pulses.run(cycles=5000)
    edges, snapshot = pulses.edges("D9"), pulses.snapshot()
    pulses.run(cycles=5000)
    pulses.clear_edges()
    pulses.restore(snapshot)
    np.testing.assert_array_equal(pulses.edges("D9"), edges)


def test_reset_button_starts_the_program_again_and_time_goes_on(echo):
    cycle = echo.cycle
    echo.reset()
    assert cycle <= echo.cycle
    echo.run(seconds=0.001)
    assert echo.serial.read() == b"R\x02", "MCUSR has EXTRF (ATmega328P datasheet, 11.9.1)"


def test_touching_a_part_that_is_not_modelled_is_told():
    uno = Uno.from_hex(DATA / "unmodelled.hex")
    uno.run(cycles=1)
    assert uno.warnings == ()
    uno.run(cycles=100)
    assert len(uno.warnings) == 2
    assert any("TWBR (0xB8)" in warning and "at 0x0002" in warning for warning in uno.warnings)


def test_an_elf_file_runs_as_its_hex_file(tmp_path):
    # An ELF made here around the same bytes; the ELF reader's own tests are in test_sim_loader.py.
    code = load_hex(DATA / "pulses.hex").flash[:64]
    header = (
        b"\x7fELF\x01\x01\x01"
        + bytes(9)
        + b"".join(
            value.to_bytes(size, "little")
            for value, size in zip(
                (2, 83, 1, 0, 52, 0, 5, 52, 32, 1, 40, 0, 0), (2, 2, 4, 4, 4, 4, 4, 2, 2, 2, 2, 2, 2), strict=True
            )
        )
    )
    program = b"".join(value.to_bytes(4, "little") for value in (1, 84, 0, 0, 64, 64, 5, 2))
    (tmp_path / "pulses.elf").write_bytes(header + program + code)
    boards = [Uno.from_elf(tmp_path / "pulses.elf"), Uno.from_hex(DATA / "pulses.hex")]
    for uno in boards:
        uno.run(cycles=8000)
    np.testing.assert_array_equal(boards[0].edges("D9"), boards[1].edges("D9"))
    assert len(boards[0].edges("D9")) >= 9


def test_analogue_inputs_have_the_boards_names():
    uno = Uno.from_hex(DATA / "pulses.hex")
    assert uno.analog("A0").volts is None
    uno.analog("A0").volts = 2.5
    uno.analog("AREF").volts = 3.3
    assert (uno.analog("A0").volts, uno.analog("A1").volts, uno.analog("AREF").volts) == (2.5, None, 3.3)
    uno.reset()
    assert uno.analog("A0").volts == 2.5
    uno.analog("A0").volts = None
    assert uno.analog("A0").volts is None
    with pytest.raises(PinError, match="D3 has no analogue input"):
        uno.analog("D3")
    with pytest.raises(PinError, match="0 to 5 V"):
        uno.analog("A5").volts = -0.1


# --- replies ---


def test_a_reply_is_waited_for_to_its_end_and_the_run_is_the_same(echo):
    whole = echo.fork(1)[0]
    for uno in (echo, whole):
        uno.serial.write(b"ABC")
    begin = echo.cycle
    assert echo.run_to_reply(cycles=100_000, quiet_cycles=800)
    assert echo.serial.peek() == b"BCD"
    ends = echo.serial.log["end"][echo.serial.log["direction"] == 1]
    assert 0 <= echo.cycle - (ends[-1] + 800) < 8  # the instruction is finished
    whole.run(cycles=echo.cycle - begin)
    assert (whole.serial.peek(), whole.cycle) == (echo.serial.peek(), echo.cycle)


def test_without_a_reply_the_wait_ends_in_time(echo):
    begin = echo.cycle
    assert not echo.run_to_reply(cycles=5000, quiet_cycles=800)
    assert 5000 <= echo.cycle - begin < 5008
    with pytest.raises(UsageError, match="0 and 1 or more"):
        echo.run_to_reply(cycles=100, quiet_cycles=0)
