"""Timers against a clock-by-clock model written from the ATmega328P datasheet, chapters 15, 16 and 18.

The model below does one timer clock at a time and knows nothing of legs, horizons and lazy evaluation, which
is what the emulator's timers consist of. Absolute times are tested separately with numbers of their own.
"""

from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from planarm_sim.cpu.chip import Chip, StopCause
from sim_chip.avr_assembler import assemble

NORMAL, CTC, FAST, CORRECT, FREQUENCY_CORRECT = range(5)
# WGM -> kind, TOP (number, "a" OCRnA, "i" ICR1): table 16-4 and table 15-8.
MODES_16 = {
    0: (NORMAL, 0xFFFF), 1: (CORRECT, 0xFF), 2: (CORRECT, 0x1FF), 3: (CORRECT, 0x3FF), 4: (CTC, "a"), 5: (FAST, 0xFF),
    6: (FAST, 0x1FF), 7: (FAST, 0x3FF), 8: (FREQUENCY_CORRECT, "i"), 9: (FREQUENCY_CORRECT, "a"), 10: (CORRECT, "i"),
    11: (CORRECT, "a"), 12: (CTC, "i"), 14: (FAST, "i"), 15: (FAST, "a"),
}  # fmt: skip
MODES_8 = {0: (NORMAL, 0xFF), 1: (CORRECT, 0xFF), 2: (CTC, "a"), 3: (FAST, 0xFF), 5: (CORRECT, "a"), 7: (FAST, "a")}


@dataclass
class Model:
    """One timer, clock by clock."""

    kind: int
    top_source: int | str
    maximum: int
    com: tuple[int, int]
    icr: int
    count: int = 0
    up: bool = True
    blocked: bool = False
    flags: int = 0
    ocr: list[int] = field(default_factory=lambda: [0, 0])
    buffer: list[int] = field(default_factory=lambda: [0, 0])
    pins: list[int] = field(default_factory=lambda: [0, 0])

    def top(self) -> int:
        return {"a": self.ocr[0], "i": self.icr}.get(self.top_source, self.top_source)

    def write(self, channel: int, value: int) -> None:
        self.buffer[channel] = value
        if self.kind in (NORMAL, CTC):
            self.ocr[channel] = value

    def clock(self) -> None:
        at_top = self.count == self.top() and not (self.blocked and isinstance(self.top_source, str))
        matches = [self.count == self.ocr[c] and not self.blocked for c in (0, 1)]
        at_bottom = self.count == 0 and not self.up
        self.blocked = False
        dual = self.kind in (CORRECT, FREQUENCY_CORRECT)
        wrapped = False
        if dual and at_top:
            self.up = False
        elif dual and at_bottom:
            self.up = True
        old = self.count
        if self.up:
            wrapped = old == self.maximum or (at_top and not dual)
            self.count = 0 if wrapped else old + 1
        else:
            self.count = max(old - 1, 0)
        overflow = {NORMAL: old == self.maximum, CTC: wrapped and old == self.maximum, FAST: at_top}
        self.flags |= overflow.get(self.kind, at_bottom) | matches[0] << 1 | matches[1] << 2
        self.flags |= (at_top and self.top_source == "i") << 5
        if (
            (self.kind == FAST and wrapped)
            or (self.kind == CORRECT and at_top)
            or (self.kind == FREQUENCY_CORRECT and at_bottom)
        ):
            self.ocr = list(self.buffer)
        for channel in (0, 1):
            self.drive(channel, matches[channel], wrapped, at_top, at_bottom, dual)

    def drive(self, channel: int, match: bool, wrapped: bool, at_top: bool, at_bottom: bool, dual: bool) -> None:
        com = self.com[channel]
        if com == 0:
            return
        if com == 1:
            self.pins[channel] ^= match
        elif self.kind in (NORMAL, CTC):
            self.pins[channel] = com - 2 if match else self.pins[channel]
        else:
            high = None  # in terms of COM = 2, the non-inverting mode
            if self.kind == FAST:
                high = True if wrapped else False if match else None
            elif dual and at_top:
                high = self.ocr[channel] >= self.top()
            elif dual and at_bottom:
                high = self.ocr[channel] > 0
            elif match:
                high = not self.up
            if high is not None:
                self.pins[channel] = int(high) if com == 2 else int(not high)


def program(steps: list[tuple[int, int, int]]) -> tuple[str, list[int]]:
    """LDI and STS per (NOPs before, address, value); returns the source and the cycle at which each write acts."""
    lines, ends, cycle = [], [], 0
    for delay, address, value in steps:
        lines += ["nop"] * delay + [f"ldi r16, {value}", f"sts {address}, r16"]
        cycle += delay + 3
        ends.append(cycle)
    return "\n".join(lines), ends


def toggles(com: int, kind: int, channel: int, wgm: int, wide: bool) -> int:
    """COM = 1 toggles OCnA in some PWM modes only, and leaves the pin to the port in the others."""
    if com == 1 and kind not in (NORMAL, CTC):
        return 1 if channel == 0 and (wgm in (9, 11, 14, 15) if wide else wgm in (5, 7)) else 0
    return com


def watch(chip: Chip, pins: dict[int, int]) -> list[tuple[int, int, int]]:
    return [
        (int(e["cycle"]), pins[int(e["pin"])], int(e["level"])) for e in chip.drain_edges() if int(e["pin"]) in pins
    ]


def compare(wide: bool, addresses: dict[str, int], pins: dict[int, int], case: dict) -> None:
    """Run the same set-up and later writes on the chip and on the model; same edges and same flags."""
    kind, top_source = (MODES_16 if wide else MODES_8)[case["wgm"]]
    com_a, com_b = case["com"]
    control_a = com_a << 6 | com_b << 4 | (case["wgm"] & 3)
    control_b = (case["wgm"] >> 2) << 3 | (1 if case["shift"] == 0 else 2)
    word = [("high", 8), ("low", 0)] if wide else [("low", 0)]
    steps = [(0, a, m) for a, m in case["ddr"]]
    steps.append((0, addresses["a"], control_a))  # the mode first: OCRnx is buffered or not
    steps.append((0, addresses["b"], control_b & ~7))
    for name, value in (("icr", case["icr"]), ("ocr0", case["ocr"][0]), ("ocr1", case["ocr"][1])):
        if name != "icr" or wide:
            steps += [(0, addresses[name] + (part == "high"), value >> shift & 0xFF) for part, shift in word]
    start = len(steps)
    steps.append((0, addresses["b"], control_b))
    later = []
    for delay, channel, value in case["writes"]:
        for part, shift in word:
            steps.append(
                (
                    delay if part == word[0][0] else 0,
                    addresses[f"ocr{channel}"] + (part == "high"),
                    value >> shift & 0xFF,
                )
            )
        later.append((len(steps) - 1, channel, value))
    source, ends = program(steps)
    chip = Chip(assemble(source + "\nloop: nop\ncall sub\nrjmp loop\nsub: ret"))
    end = ends[-1] + case["length"]
    chip.run_to(end)
    end = chip.cycle

    effective = tuple(toggles(c, kind, n, case["wgm"], wide) for n, c in enumerate((com_a, com_b)))
    model = Model(kind, top_source, 0xFFFF if wide else 0xFF, effective, case["icr"] if top_source == "i" else 0)
    for channel in (0, 1):
        model.write(channel, case["ocr"][channel])
    writes = {ends[i]: (channel, value) for i, channel, value in later}
    expected = []
    for cycle in range(ends[start] + 1, end + 1):
        if cycle % (1 << case["shift"]) == 0:  # the prescaler runs from power-up
            before = list(model.pins)
            model.clock()
            expected += [(cycle, c, model.pins[c]) for c in (0, 1) if model.pins[c] != before[c]]
        if cycle in writes:
            model.write(*writes[cycle])
    assert watch(chip, pins) == expected
    chip.run_to(end)
    assert read_io(chip, addresses["tifr"]) == model.flags


def read_io(chip: Chip, address: int) -> int:
    """What the program would read now: run one IN in place of its next instruction, on a copy of the chip."""
    probe = Chip(assemble(f"nop\nin r0, {address - 0x20}"))
    snapshot = chip.snapshot()
    program = probe.snapshot().program
    probe.restore(replace(snapshot, program=program))
    probe.pc = 1
    probe.run_to(chip.cycle + 1)
    return int(probe.registers[0])


OCRS_16 = some.one_of(some.integers(0, 40), some.sampled_from([0xFE, 0xFF, 0x100, 0x1FF, 0x3FF, 700, 0xFFFF]))
OCRS_8 = some.one_of(some.integers(0, 40), some.sampled_from([100, 0xFE, 0xFF]))
COMS = some.tuples(some.integers(0, 3), some.integers(0, 3))


def cases(modes: dict, ocrs) -> some.SearchStrategy[dict]:
    return some.fixed_dictionaries(
        {
            "wgm": some.sampled_from(sorted(modes)),
            "com": COMS,
            "ocr": some.tuples(ocrs, ocrs),
            "icr": some.one_of(some.integers(1, 60), some.sampled_from([0xFF, 700])),
            "shift": some.sampled_from([0, 0, 3]),
            "writes": some.lists(some.tuples(some.integers(0, 150), some.integers(0, 1), ocrs), max_size=6),
            "length": some.integers(0, 4000),
        }
    )


TIMER1 = {"a": 0x80, "b": 0x81, "icr": 0x86, "ocr0": 0x88, "ocr1": 0x8A, "tifr": 0x36}
TIMER0 = {"a": 0x44, "b": 0x45, "ocr0": 0x47, "ocr1": 0x48, "tifr": 0x35}
TIMER2 = {"a": 0xB0, "b": 0xB1, "ocr0": 0xB3, "ocr1": 0xB4, "tifr": 0x37}


@settings(max_examples=250, deadline=None)
@given(cases(MODES_16, OCRS_16))
def test_timer_1_does_what_the_datasheet_says_clock_by_clock(case):
    compare(True, TIMER1, {1: 0, 2: 1}, case | {"ddr": [(0x24, 0x06)]})


@settings(max_examples=120, deadline=None)
@given(cases(MODES_8, OCRS_8))
def test_timer_0_does_what_the_datasheet_says_clock_by_clock(case):
    compare(False, TIMER0, {22: 0, 21: 1}, case | {"ddr": [(0x2A, 0x60)]})


@settings(max_examples=120, deadline=None)
@given(cases(MODES_8, OCRS_8))
def test_timer_2_does_what_the_datasheet_says_clock_by_clock(case):
    compare(False, TIMER2, {3: 0, 19: 1}, case | {"ddr": [(0x24, 0x08), (0x2A, 0x08)]})


# --- Absolute times ------------------------------------------------------------------------------------------------


def level_changes(source: str, pin: int, until: int) -> list[tuple[int, int]]:
    chip = Chip(assemble(source))
    assert chip.run_to(until) is StopCause.REACHED
    return [(int(e["cycle"]), int(e["level"])) for e in chip.drain_edges() if e["pin"] == pin]


CTC_799 = """
        ldi r16, 2
        out 0x04, r16       ; DDRB: PB1
        ldi r16, 0x40
        sts 0x80, r16       ; TCCR1A: toggle OC1A
        ldi r16, 3
        sts 0x89, r16
        ldi r16, 0x1F
        sts 0x88, r16       ; OCR1A = 799
        ldi r16, 9
        sts 0x81, r16       ; TCCR1B: CTC, clk/1, from cycle 14 on
"""


def test_oc1a_toggles_every_800_cycles_whatever_the_cpu_does():
    # CTC with OCR1A = 799: one period is 800 clocks (16.9.2), the first ends 800 clocks after the timer starts at 14.
    # CALL and RET of 4 cycles, LDS of 2, in a loop of 15 cycles, which shares no phase with 800.
    body = "loop: call sub\nlds r1, 0x100\nnop\nnop\nnop\nrjmp loop\nsub: ret"
    edges = level_changes(CTC_799 + body, 1, 80_000)
    assert [e[0] for e in edges] == [14 + 800 * n for n in range(1, len(edges) + 1)]
    assert len(edges) == 99
    assert [e[1] for e in edges] == [n % 2 for n in range(1, len(edges) + 1)]


def test_the_counter_reads_as_it_stood_in_the_last_cycle_of_the_instruction():
    # TCNT1 is 0 at the end of the STS that starts the timer. IN-like reads see it at the start of their last cycle:
    # LDS (2 cycles) right behind reads 1; the next LDS, after one NOP, ends 5 cycles in and reads 4.
    source = "ldi r16, 1\nsts 0x81, r16\nlds r1, 0x84\nnop\nlds r2, 0x84\nbreak"
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert list(chip.registers[1:3]) == [1, 4]


def test_sixteen_bit_registers_go_through_temp():
    # Writing TCNT1H only fills TEMP, writing TCNT1L takes both; reading TCNT1L keeps the high byte of that moment.
    source = """
        ldi r16, 0x12
        sts 0x85, r16
        lds r1, 0x84        ; still 0, and reading it puts 0 into TEMP
        lds r2, 0x85
        ldi r16, 0x12
        sts 0x85, r16
        ldi r16, 0xFD
        sts 0x84, r16       ; TCNT1 = 0x12FD
        ldi r16, 1
        sts 0x81, r16
        lds r3, 0x84        ; 0x12FE: low byte, TEMP = 0x12
        nop
        nop
        nop
        lds r4, 0x85        ; 0x12 from TEMP although the counter has passed 0x1300
        lds r5, 0x84
        lds r6, 0x85        ; 0x13
        break
    """
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert list(chip.registers[1:5]) == [0, 0, 0xFE, 0x12]
    assert chip.registers[6] == 0x13


def test_reading_ocr1a_leaves_temp_alone():
    # 16.3: reading OCR1A/B does not involve TEMP.
    source = """
        ldi r16, 0x55
        sts 0x89, r16
        sts 0x88, r16       ; OCR1A = 0x5555
        ldi r17, 0x77
        sts 0x85, r17       ; TEMP = 0x77
        lds r1, 0x89
        lds r2, 0x88
        sts 0x84, r16       ; TCNT1 = 0x7755
        lds r3, 0x84
        lds r4, 0x85
        break
    """
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert list(chip.registers[1:5]) == [0x55, 0x55, 0x55, 0x77]


@pytest.mark.parametrize("shift", [0, 3])
def test_a_write_to_the_counter_blocks_the_match_at_the_next_timer_clock(shift):
    # 15.7.2: TCNT0 = OCR0A written while stopped; the match is lost, and the counter goes past it.
    source = (
        f"""
        ldi r16, 77
        out 0x27, r16       ; OCR0A
        out 0x26, r16       ; TCNT0 = OCR0A
        ldi r16, {2 if shift else 1}
        out 0x25, r16
    """
        + "nop\n" * 40
        + "in r1, 0x15\nbreak"
    )
    chip = Chip(assemble(source))
    chip.run_to(1000)
    assert chip.registers[1] & 2 == 0
    moved = Chip(
        assemble(source.replace("out 0x26, r16", "nop"))
    )  # the same without the write, OCR0A = 77: no match yet
    moved.run_to(1000)
    assert moved.registers[1] & 2 == 0
    later = Chip(assemble(source.replace("out 0x26, r16", "subi r16, 1\nout 0x26, r16")))  # one clock before the match
    later.run_to(1000)
    assert later.registers[1] & 2 == 2


def test_a_write_to_one_compare_register_does_not_touch_the_other():
    # OCR1B = 60 matches once, at 61 clocks; OCR1A is rewritten all the time and never reached.
    source = (
        """
        ldi r16, 6
        out 0x04, r16
        ldi r16, 0x50
        sts 0x80, r16       ; toggle both
        ldi r16, 60
        sts 0x8A, r16
        ldi r17, 200
        sts 0x88, r17
        ldi r16, 1
        sts 0x81, r16       ; from cycle 14 on
    """
        + "inc r17\nsts 0x88, r17\n" * 30
        + "break"
    )
    chip = Chip(assemble(source))
    chip.run_to(1000)
    assert [(int(e["cycle"]), int(e["pin"])) for e in chip.drain_edges()] == [(14 + 61, 2)]


def test_a_forced_compare_acts_on_the_pin_but_sets_no_flag():
    # 16.11.3: FOC1A with COM1A = 3 sets OC1A at the end of the STS; no OCF1A, no clear in CTC mode.
    source = """
        ldi r16, 2
        out 0x04, r16
        ldi r16, 0xC0
        sts 0x80, r16       ; COM1A = 3: set
        ldi r16, 0x80
        sts 0x82, r16       ; FOC1A, ends at 8
        ldi r17, 0x80
        sts 0x80, r17       ; COM1A = 2: clear
        sts 0x82, r16       ; ends at 13
        in r1, 0x16
        lds r2, 0x82        ; FOC1x read as zero
        break
    """
    chip = Chip(assemble(source))
    chip.run_to(1000)
    assert [(int(e["cycle"]), int(e["level"])) for e in chip.drain_edges()] == [(8, 1), (13, 0)]
    assert list(chip.registers[1:3]) == [0, 0]


def test_the_output_compare_register_survives_disconnection():
    # OC1A is set by FOC1A while connected; with COM1A = 0 the pin follows PORTB1 = 0, connected again it is high.
    source = """
        ldi r16, 2
        out 0x04, r16
        ldi r17, 0xC0
        sts 0x80, r17
        ldi r16, 0x80
        sts 0x82, r16       ; high at 8
        ldi r16, 0
        sts 0x80, r16       ; low at 11
        sts 0x80, r17       ; high at 13
        break
    """
    assert level_changes(source.replace("break", "loop: rjmp loop"), 1, 100) == [(8, 1), (11, 0), (13, 1)]


def test_the_prescaler_runs_on_and_can_be_reset():
    # clk/8 counts at multiples of 8 from power-up: started at 3 (LDI 1, STS 2), TCNT1 is 1 at 8, 2 at 16. PSRSYNC
    # (17.4.1) at 21 moves the clocks to 29, 37, ...
    source = """
        ldi r16, 2
        sts 0x81, r16       ; at 3
        lds r1, 0x84        ; reads at 4: 0
        nop
        nop
        lds r2, 0x84        ; reads at 8: 1
        ldi r17, 1
        nop
        nop
        nop
        nop
        lds r3, 0x84        ; reads at 15: 1
        nop
        nop
        nop
        out 0x23, r17       ; GTCCR at 20
        lds r4, 0x84        ; reads at 21: 2
        nop
        nop
        nop
        nop
        lds r5, 0x84        ; reads at 27: 2
        lds r6, 0x84        ; reads at 29: 3
        break
    """
    chip = Chip(assemble(source))
    chip.run_to(1000)
    assert list(chip.registers[1:7]) == [0, 1, 1, 2, 2, 3]


def test_icr1_can_be_written_only_where_it_is_top():
    # 16.6.3: in the other modes it belongs to the capture unit.
    def icr_after(control_b: int) -> int:
        source = (
            f"ldi r16, {control_b}\nsts 0x81, r16\nldi r16, 0x33\nsts 0x87, r16\nsts 0x86, r16\nlds r1, 0x86\nbreak"
        )
        chip = Chip(assemble(source))
        chip.run_to(100)
        return int(chip.registers[1])

    assert icr_after(0x18) == 0x33  # mode 12, CTC with ICR1
    assert icr_after(0x00) == 0
    assert icr_after(0x08) == 0  # mode 4, CTC with OCR1A


def test_input_capture_copies_the_counter():
    # ICP1 (PB0) rises at cycle 100; synchroniser and edge detector take 3 cycles (16.6.2, 17.2): the counter, 0 at
    # cycle 3, is captured at 103 as 100. With the noise canceller 4 cycles later.
    for control, expected in ((0x41, 100), (0xC1, 104)):
        chip = Chip(
            assemble(f"ldi r16, {control}\nsts 0x81, r16\n" + "nop\n" * 200 + "lds r1, 0x86\nin r2, 0x16\nbreak")
        )
        chip.drive_pin(0, 0)
        chip.drive_pin(0, 1, 100)
        assert chip.run_to(10_000) is StopCause.BREAK
        assert chip.registers[1] == expected
        assert chip.registers[2] & 0x20  # ICF1


def test_the_noise_canceller_ignores_a_short_pulse():
    chip = Chip(assemble("ldi r16, 0xC1\nsts 0x81, r16\n" + "nop\n" * 200 + "in r2, 0x16\nbreak"))
    chip.drive_pin(0, 0)
    chip.drive_pin(0, 1, 100)
    chip.drive_pin(0, 0, 102)
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.registers[2] & 0x20 == 0


def test_timer_0_counts_edges_of_its_pin():
    # CS0 = 7: rising edges of T0 (PD4); 5 of them, the last at cycle 140 counted at 143.
    chip = Chip(assemble("ldi r16, 7\nout 0x25, r16\n" + "nop\n" * 140 + "in r1, 0x26\nin r2, 0x26\nbreak"))
    for n in range(5):
        chip.drive_pin(20, 1, 60 + 20 * n)
        chip.drive_pin(20, 0, 70 + 20 * n)
    chip.run_to(10_000)
    assert list(chip.registers[1:3]) == [4, 5]
