"""USART0 in time: ATmega328P datasheet, chapter 20.

UBRR0 = 3 and U2X0 = 0 make a divider period of 4 cycles and bits of 64 (250 kbaud at 16 MHz).
"""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.chip import Chip, Parity, StopCause
from planarm_sim.errors import UsageError
from sim_chip.avr_assembler import assemble

UCSR0A, UCSR0B, UCSR0C, UBRR0L, UDR0 = 0xC0, 0xC1, 0xC2, 0xC4, 0xC6
RXC, TXC, UDRE, FE, DOR, UPE = 0x80, 0x40, 0x20, 0x10, 0x08, 0x04
# UBRR0L is written at cycle 3: the divider's clocks, and with them the receiver's samples, are at 3 + 4 n.
SETUP = f"""
        ldi r16, 3
        sts {UBRR0L}, r16       ; at 3
        ldi r16, 0x18
        sts {UCSR0B}, r16       ; RXEN0, TXEN0, at 6
"""


def test_eight_bytes_nobody_reads_leave_three_and_an_overrun():
    # 115,200 baud (UBRR0 = 16 with U2X0, 136 cycles per bit), nothing read for 2 ms: the buffer holds two bytes, the
    # shift register one more; DOR0 tells of the loss and goes once the next byte has moved up (20.7.4, 20.11.2).
    source = f"""
        ldi r16, 2
        sts {UCSR0A}, r16
        ldi r16, 16
        sts {UBRR0L}, r16
        ldi r16, 0x10
        sts {UCSR0B}, r16
        ldi r26, 0
        ldi r27, 1
        ldi r24, 0x40           ; 32,000 cycles of waiting
        ldi r25, 0x1F
wait:   sbiw r24, 1
        brne wait
        ldi r18, 5
read:   lds r16, {UCSR0A}
        lds r17, {UDR0}
        st X+, r16
        st X+, r17
        dec r18
        brne read
        break
    """
    chip = Chip(assemble(source))
    for n in range(8):
        chip.push_rx(1000 + 1389 * n, 16e6 / 115200, ord("a") + n)
    assert chip.run_to(100_000) is StopCause.BREAK
    assert chip.cycle > 32_000
    pairs = chip.sram[:10].reshape(-1, 2)
    assert [bool(s & RXC) for s, _ in pairs] == [True, True, True, False, False]
    assert bytes(b for s, b in pairs if s & RXC) == b"abh"  # the last one took the shift register's place
    assert [bool(s & DOR) for s, _ in pairs] == [True, False, False, False, False]


def test_two_bytes_and_one_in_the_shift_register_are_no_overrun():
    source = SETUP + "loop: rjmp loop"
    chip = Chip(assemble(source))
    for n in range(3):
        chip.push_rx(100 + 640 * n, 64.0, n)
    chip.run_to(100 + 640 * 3 + 1000)
    assert status(chip) & (RXC | DOR) == RXC
    chip.push_rx(chip.cycle, 64.0, 9)  # its start bit overruns
    chip.run_to(chip.cycle + 10)
    assert status(chip) & DOR


def status(chip: Chip) -> int:
    """UCSR0A as the program would read it."""
    probe = chip.snapshot()
    return int(probe.state[UCSR0A])


@pytest.mark.parametrize("phase", range(4))
def test_a_byte_is_in_at_the_tenth_sample_of_its_stop_bit(phase):
    # Sample 1 is the divider's first clock (3 + 4 n) in the start bit; sample 10 of bit 9 is 9 * 16 + 9 clocks later.
    start = 203 + phase
    first_sample = 203 if phase == 0 else 207
    received = first_sample + (9 * 16 + 9) * 4
    chip = Chip(assemble(SETUP + "nop\n" * 1000))
    chip.push_rx(start, 64.0, 0x5A)
    chip.run_to(received - 1)
    assert not status(chip) & RXC
    chip.run_to(received)
    assert status(chip) & RXC


def test_the_receive_interrupt_comes_with_the_byte():
    # Sample 1 at 203, RXC0 at 203 + 612 = 815; NOPs end on every cycle: entry until 819, JMP 822, SBI 824.
    source = "jmp main\n.org 36\njmp handler\n.org 60\nmain:" + SETUP.replace("0x18", "0x98").replace(
        f"sts {UBRR0L}, r16       ; at 3", f"sts {UBRR0L}, r16"
    )
    source += "sbi 0x04, 5\nsei\n" + "nop\n" * 1000 + "handler: sbi 0x03, 5\nlds r20, 0xC6\nreti"
    chip = Chip(assemble(source))  # UBRR0L at 6: samples at 6 + 4 n, 202 is one of them
    chip.push_rx(199, 64.0, 0x5A)
    chip.run_to(1000)
    edges = [int(e["cycle"]) for e in chip.drain_edges() if e["pin"] == 5]
    assert edges == [202 + 612 + 4 + 3 + 2]
    assert chip.registers[20] == 0x5A


def test_frames_leave_without_a_gap_and_the_flags_follow():
    # Written at 10 (idle: the shift register takes it at once) and at 13 (the buffer keeps it). 8N1 is ten bits of 64:
    # the first frame ends at 650, where the second leaves the buffer (UDRE0), and the second at 1290 (TXC0).
    source = (
        SETUP
        + f"""
        ldi r17, 0x41
        ldi r18, 0x42
        sts {UDR0}, r17         ; at 10
        nop
        sts {UDR0}, r18         ; at 13
    """
        + "nop\n" * 2000
    )
    chip = Chip(assemble(source))
    for cycle, expected in ((10, UDRE), (13, 0), (649, 0), (650, UDRE), (1289, UDRE), (1290, UDRE | TXC)):
        chip.run_to(cycle)
        assert (chip.cycle, status(chip)) == (cycle, expected)
    assert chip.drain_tx().tolist() == [(650, 0x41, 64), (1290, 0x42, 64)]


def test_a_byte_written_while_the_buffer_is_full_is_lost():
    # 20.11.1: data written while UDRE0 is clear is ignored.
    source = SETUP + "".join(f"ldi r17, {n}\nsts {UDR0}, r17\n" for n in (1, 2, 3)) + "loop: rjmp loop"
    chip = Chip(assemble(source))
    chip.run_to(3000)
    assert chip.drain_tx()["byte"].tolist() == [1, 2]


def test_udre_and_txc_interrupts():
    # UDRE (vector 19) asks as long as the buffer is empty: it sends two bytes and turns itself off; TXC (20) comes
    # after the second, and is cleared by being taken.
    source = (
        f"""
        jmp main
        .org 38
        rjmp udre
        .org 40
        rjmp txc
        .org 60
udre:   inc r20
        sts {UDR0}, r20
        cpi r20, 2
        brne back
        ldi r16, 0x48
        sts {UCSR0B}, r16
back:   reti
txc:    lds r21, {UCSR0A}
        inc r22
        reti
main:   ldi r16, 3
        sts {UBRR0L}, r16
        ldi r16, 0x68
        sts {UCSR0B}, r16       ; at 9
        sei                     ; at 10, NOP, entry at 11
    """
        + "nop\n" * 3000
        + "break"
    )
    chip = Chip(assemble(source))
    assert chip.run_to(10_000) is StopCause.BREAK
    # Entry 4, RJMP 2, INC 1, STS 2: the first byte at 20.
    assert chip.drain_tx().tolist() == [(20 + 640, 1, 64), (20 + 1280, 2, 64)]
    assert (chip.registers[20], chip.registers[22]) == (2, 1)
    assert chip.registers[21] & TXC == 0


@pytest.mark.parametrize(
    ("control_c", "data_bits", "parity", "bits"),
    [
        (0x06, 8, Parity.NONE, 10),
        (0x0E, 8, Parity.NONE, 11),  # two stop bits
        (0x26, 8, Parity.EVEN, 11),
        (0x36, 8, Parity.ODD, 11),
        (0x04, 7, Parity.NONE, 9),
        (0x00, 5, Parity.NONE, 7),
        (0x24, 7, Parity.EVEN, 10),
    ],
)
def test_frame_formats(control_c, data_bits, parity, bits):
    # Sent: start bit, data, parity, stop bits of 64 cycles each. Received: the same frame gives its character and no
    # error flag; with the other parity UPE0 is set, with a low stop bit FE0.
    source = f"ldi r16, {control_c}\nsts {UCSR0C}, r16\n" + SETUP + f"ldi r17, 0x15\nsts {UDR0}, r17\nloop: rjmp loop"
    chip = Chip(assemble(source))
    chip.run_to(20)
    sent_at = 3 + 3 + 3 + 3
    assert chip.cycle <= 21
    chip.push_rx(200, 64.0, 0x15, data_bits=data_bits, parity=parity)
    chip.run_to(1200)
    assert chip.drain_tx().tolist() == [(sent_at + 64 * bits, 0x15, 64)]
    assert status(chip) & (RXC | FE | UPE) == RXC
    if parity is not Parity.NONE:
        other = Parity.ODD if parity is Parity.EVEN else Parity.EVEN
        chip = Chip(assemble(source))
        chip.push_rx(200, 64.0, 0x15, data_bits=data_bits, parity=other)
        chip.run_to(1200)
        assert status(chip) & (RXC | FE | UPE) == RXC | UPE
    chip = Chip(assemble(source))
    chip.push_rx(200, 64.0, 0x15, data_bits=data_bits, parity=parity, stop_level=0)
    chip.run_to(1200)
    assert status(chip) & (RXC | FE | UPE) == RXC | FE


def test_nine_bit_characters_both_ways():
    source = f"""
        ldi r16, 0x06
        sts {UCSR0C}, r16
        ldi r16, 3
        sts {UBRR0L}, r16
        ldi r16, 0x1D           ; RXEN0, TXEN0, UCSZ02, TXB80
        sts {UCSR0B}, r16
        ldi r17, 0x42
        sts {UDR0}, r17
wait:   lds r18, {UCSR0A}
        sbrs r18, 7
        rjmp wait
        lds r19, {UCSR0B}
        lds r20, {UDR0}
        break
    """
    chip = Chip(assemble(source))
    chip.push_rx(200, 64.0, 0x1A5, data_bits=9)
    assert chip.run_to(10_000) is StopCause.BREAK
    assert (chip.registers[19] & 2, chip.registers[20]) == (2, 0xA5)
    chip.run_to(chip.cycle)
    chip = Chip(assemble(source))
    chip.run_to(2000)
    assert chip.drain_tx()["byte"].tolist() == [0x142]


def echo_of(data: bytes, bit_cycles: float) -> tuple[list[int], int]:
    """Bytes that a polling receiver got, and the error flags it saw."""
    source = (
        SETUP
        + f"""
        ldi r26, 0
        ldi r27, 1
loop:   lds r16, {UCSR0A}
        sbrs r16, 7
        rjmp loop
        andi r16, 0x1C
        or r20, r16
        lds r17, {UDR0}
        st X+, r17
        rjmp loop
    """
    )
    chip = Chip(assemble(source))
    for n, byte in enumerate(data):
        chip.push_rx(100 + round(10 * bit_cycles * n), bit_cycles, byte)
    chip.run_to(100 + round(10 * bit_cycles * (len(data) + 2)))
    count = int(chip.registers[26]) | (int(chip.registers[27]) - 1) << 8
    return chip.sram[:count].tolist(), int(chip.registers[20])


@settings(max_examples=60, deadline=None)
@given(some.binary(min_size=1, max_size=40), some.floats(0.965, 1.035))
def test_far_ends_within_the_receivers_tolerance_are_understood(data, mismatch):
    # 20.8.3, table 20-2: with 10 bits a normal-speed receiver takes up to +3.92 / -3.83 % of total error.
    assert echo_of(data, 64.0 * mismatch) == (list(data), 0)


@pytest.mark.parametrize("mismatch", [0.8, 0.9, 1.1, 1.3])
def test_far_ends_beyond_it_are_not(mismatch):
    received, errors = echo_of(bytes(range(0x40, 0x60)), 64.0 * mismatch)
    assert received != list(range(0x40, 0x60)) or errors


def test_a_spike_is_no_start_bit():
    # A frame of the far end whose bits last 8 cycles: the start bit is over before samples 8 to 10.
    chip = Chip(assemble(SETUP + "loop: rjmp loop"))
    chip.push_rx(100, 8.0, 0xFF)
    chip.push_rx(400, 64.0, 0x33)
    chip.run_to(2000)
    snapshot = chip.snapshot().state
    assert snapshot[UCSR0A] & (RXC | FE) == RXC
    chip = Chip(assemble(SETUP + f"wait: lds r16, {UCSR0A}\nsbrs r16, 7\nrjmp wait\nlds r17, {UDR0}\nbreak"))
    chip.push_rx(100, 8.0, 0xFF)
    chip.push_rx(400, 64.0, 0x33)
    assert chip.run_to(2000) is StopCause.BREAK
    assert chip.registers[17] == 0x33


def test_switching_the_receiver_off_empties_its_buffer():
    # 20.7.6
    source = (
        SETUP
        + "nop\n" * 900
        + f"ldi r16, 8\nsts {UCSR0B}, r16\nldi r16, 0x18\nsts {UCSR0B}, r16\nlds r1, {UCSR0A}\nbreak"
    )
    chip = Chip(assemble(source))
    chip.push_rx(100, 64.0, 0x33)
    chip.run_to(900)
    assert status(chip) & RXC
    assert chip.run_to(5000) is StopCause.BREAK
    assert chip.registers[1] & RXC == 0


def test_the_transmitter_holds_its_pin_high_and_the_receiver_takes_its_own():
    # 14.3.3: TXEN0 makes PD1 an output whatever DDRD says, RXEN0 makes PD0 an input.
    chip = Chip(assemble("ldi r16, 3\nout 0x0A, r16\n" + SETUP + "loop: rjmp loop"))
    chip.run_to(100)
    assert chip.pin_level(17) == 1
    assert [(int(e["cycle"]), int(e["pin"]), int(e["level"])) for e in chip.drain_edges()] == [(8, 17, 1)]
    chip.drive_pin(16, 1)
    assert chip.pin_level(16) == 1


def test_frames_must_be_in_order_and_in_the_future():
    chip = Chip(assemble("loop: rjmp loop"))
    chip.run_to(1000)
    with pytest.raises(UsageError, match="earliest is 1000"):
        chip.push_rx(999, 64.0, 0)
    chip.push_rx(2000, 64.0, 0)
    with pytest.raises(UsageError, match="earliest is 2001"):
        chip.push_rx(1500, 64.0, 0)
    with pytest.raises(UsageError, match="character 256"):
        chip.push_rx(3000, 64.0, 256)


def test_thousands_of_queued_frames_arrive():
    source = (
        SETUP
        + f"loop: lds r16, {UCSR0A}\nsbrs r16, 7\nrjmp loop\nlds r17, {UDR0}\nadd r20, r17\nadiw r24, 1\nrjmp loop"
    )
    chip = Chip(assemble(source))
    for n in range(10_000):
        chip.push_rx(1000 + 640 * n, 64.0, n & 0xFF)
    chip.run_to(1000 + 640 * 10_001)
    assert chip.registers[24] | chip.registers[25] << 8 == 10_000
    assert chip.registers[20] == sum(n & 0xFF for n in range(10_000)) & 0xFF


def test_in_multi_processor_mode_only_addresses_come_in():
    # Nine data bits, the ninth tells addresses from data (20.9). MPCM0 is on; of four frames two are addresses.
    source = f"""
        ldi r16, 3
        sts {UBRR0L}, r16
        ldi r16, 1
        sts {UCSR0A}, r16       ; MPCM0
        ldi r16, 0x14
        sts {UCSR0B}, r16       ; RXEN0, UCSZ02
    wait: rjmp wait
    """
    chip = Chip(assemble(source))
    for n, character in enumerate((0x101, 0x002, 0x003, 0x104)):
        chip.push_rx(1000 + 1000 * n, 64, character, data_bits=9)
    chip.run_to(6000)
    state = chip.snapshot().state
    assert state[at.RX_COUNT] == 2
    assert [int(state[at.RX_ENTRY_0]), int(state[at.RX_ENTRY_1])] == [0x101, 0x104]
