"""What watching a program tells, against cycles counted by hand (AVR Instruction Set Manual) and other witnesses."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim import Uno
from planarm_sim.emulate import TRACED_PINS, Stop, Watch, run_board
from planarm_sim.errors import UsageError
from planarm_sim.insight import INTERVAL, Spread
from planarm_sim.insight.figures import running_interrupts
from planarm_sim.loader import Image, Symbol, load_elf
from sim_board.fake_line import FakeClock, FakeLine
from sim_chip.avr_assembler import assemble

DATA = Path(__file__).parent / "data"
FLASH, RAM_END = 32 * 1024, 0x8FF
ENTRY = 4  # cycles from an interrupt's acknowledgement to the vector's first instruction (datasheet, 7.7.1)


def board(source, **symbols):
    """A board with an assembled program; symbols by word address."""
    program = assemble(source)
    functions = tuple(Symbol(name, 2 * word, 0) for name, word in sorted(symbols.items(), key=lambda s: s[1]))
    return Uno(Image(program + bytes([0xFF]) * (FLASH - len(program)), len(program), "test", functions))


# Timer 1 in CTC mode without prescaler: its flag OCF1A rises every OCR1A + 1 = 1000 cycles.
TIMER = """
jmp main
.org 22
jmp isr
.org 0x40
main:
ldi r16, 3
sts 0x89, r16   ; OCR1AH
ldi r16, 0xE7
sts 0x88, r16   ; OCR1AL: 999
ldi r16, 2
sts 0x6F, r16   ; TIMSK1: OCIE1A
ldi r16, 9
sts 0x81, r16   ; TCCR1B: CTC, clk/1
sei
{loop}
isr:
push r16
call sub
pop r16
reti
.org 0x100
sub:
sbi 3, 5        ; toggles D13
ret
"""
# jmp 3, push 2, call 4, sbi 2, ret 4, pop 2, reti 4
ISR_CYCLES = 3 + 2 + 4 + 2 + 4 + 2 + 4


def test_interrupts_by_flag_entry_and_exit():
    uno = board(TIMER.format(loop="loop: rjmp loop"))
    uno.observe()
    uno.run(cycles=100_050)
    intervals = uno.interrupt_intervals()
    assert set(intervals["vector"]) == {11}
    assert len(intervals) == 100
    assert set(np.diff(intervals["flag"])) == {1000}
    assert set(intervals["exit"] - intervals["entry"]) == {ISR_CYCLES}
    # RJMP takes two cycles; handler and entry take 25, so the flag finds its first half once, and its second half next.
    latencies = (intervals["entry"] - intervals["flag"]).tolist()
    assert sorted(latencies[:2]) == [ENTRY, ENTRY + 1]
    assert latencies == latencies[:2] * 50
    assert set(intervals["nested_in"]) == {0}
    figures = uno.insight().interrupt("TIMER1_COMPA")
    assert figures.count == 100
    assert figures.latency_cycles == Spread(ENTRY, ENTRY + 0.5, ENTRY + 1, ENTRY + 1)
    assert figures.duration_cycles.mean == ISR_CYCLES
    assert uno.insight().interrupt("INT0") is None
    assert uno.insight().interrupt_cycles == 100 * (ENTRY + ISR_CYCLES)
    assert uno.insight().load == 1.0


def test_time_with_interrupts_switched_off_is_latency():
    # CLI for some 3 x 256 cycles of 1000: the requests that fall into it wait.
    uno = board(TIMER.format(loop="loop: cli\nldi r17, 0\nwait: dec r17\nbrne wait\nsei\nnop\nrjmp loop"))
    uno.observe()
    uno.run(cycles=2_000_000)
    latencies = uno.interrupt_intervals()["entry"] - uno.interrupt_intervals()["flag"]
    figures = uno.insight().interrupt("TIMER1_COMPA").latency_cycles
    assert (figures.least, figures.most) == (latencies.min(), latencies.max())
    assert figures.mean == pytest.approx(latencies.mean())
    assert figures.p99 == np.sort(latencies)[-(-99 * len(latencies) // 100) - 1]
    # At most: CLI itself, LDI, 256 DEC, 255 BRNE taken, one not, SEI, and the instruction that follows it.
    assert 700 < figures.most <= 1 + 1 + 256 + 2 * 255 + 1 + 1 + 1 + ENTRY
    assert figures.least >= ENTRY
    assert set(uno.interrupt_intervals()["exit"] - uno.interrupt_intervals()["entry"]) == {ISR_CYCLES}


def test_sleep_is_no_load():
    uno = board(TIMER.format(loop="ldi r16, 1\nout 0x33, r16\nloop: sleep\nrjmp loop"))
    uno.run(cycles=5_000)
    uno.observe()
    uno.run(cycles=100_000)
    insight = uno.insight()
    # Each 1000 cycles: 4 to wake, 4 to enter, the handler, RJMP and SLEEP itself; the rest is sleep.
    awake = 4 + ENTRY + ISR_CYCLES + 2 + 1
    assert insight.asleep_cycles == pytest.approx(100 * (1000 - awake), abs=1000)
    assert insight.load == pytest.approx(awake / 1000, rel=0.02)
    assert insight.interrupt_cycles == pytest.approx(100 * (4 + ENTRY + ISR_CYCLES), abs=50)
    latencies = uno.interrupt_intervals()["entry"] - uno.interrupt_intervals()["flag"]
    assert set(latencies.tolist()) == {4 + ENTRY}


def test_stack_in_the_interrupt_of_an_interrupt_free_program():
    uno = board(TIMER.format(loop="loop: rjmp loop"))
    uno.observe()
    uno.run(cycles=900)
    assert uno.insight().deepest_stack_bytes == 0
    uno.run(cycles=1000)
    assert uno.insight().deepest_stack_bytes == 2 + 1 + 2, "return address, PUSH, return address of sub"


CALLS = """
main: ldi r20, 10
again: call outer
dec r20
brne again
stop: rjmp stop
.org 0x80
outer: nop
rcall inner
nop
jmp tail        ; returns for outer
.org 0x90
inner: nop
nop
ret
.org 0xA0
tail: dec r21
ret
"""


def test_cycles_per_function_self_and_with_what_they_call():
    uno = board(CALLS, main=0, outer=0x80, inner=0x90, tail=0xA0)
    uno.observe()
    uno.run(cycles=1000)
    insight = uno.insight()
    # inner: NOP, NOP, RET; outer: NOP, RCALL, NOP, JMP; tail: DEC, RET.
    figures = {f.name: (f.calls, f.inclusive_cycles, f.self_cycles) for f in insight.functions}
    assert figures["inner"] == (10, 10 * 6, 10 * 6)
    assert figures["outer"] == (10, 10 * (1 + 3 + 6 + 1 + 3), 10 * (1 + 3 + 1 + 3))
    assert figures["tail"] == (10, 10 * 5, 10 * 5)
    assert figures["main"][:2] == (1, insight.cycles), "it has not returned, and counts up to now"
    assert sum(f.self_cycles for f in insight.functions) == insight.cycles
    assert insight.function("outer").address == 0x100
    assert insight.function("nothing") is None


def test_interrupts_are_apart_from_the_functions_that_they_interrupt():
    uno = board(TIMER.format(loop="loop: rjmp loop"), main=0x40, isr=0x40 + 14, sub=0x100)
    uno.observe()
    uno.run(cycles=10_100)
    insight = uno.insight()
    count = insight.interrupt("TIMER1_COMPA").count
    assert insight.function("sub").inclusive_cycles == count * 6
    # The handler's function begins after the table's JMP; its last cycles are those of RETI.
    assert insight.function("isr").calls == count
    assert insight.function("isr").inclusive_cycles == count * (ISR_CYCLES - 3)
    assert insight.function("isr").self_cycles == count * (ISR_CYCLES - 3 - 6)
    assert insight.function("main").inclusive_cycles == insight.cycles - insight.interrupt_cycles - 3, "less JMP main"


def test_a_function_that_calls_itself_counts_once():
    source = "ldi r16, 5\ncall down\nstop: rjmp stop\n.org 0x40\ndown: dec r16\nbreq done\ncall down\ndone: ret"
    uno = board(source, down=0x40)
    uno.observe()
    uno.run(cycles=500)
    down = uno.insight().function("down")
    # Four times DEC, BREQ not taken, CALL; once DEC and BREQ taken; five RETs.
    assert (down.calls, down.inclusive_cycles, down.self_cycles) == (5, 4 * 6 + 3 + 5 * 4, 4 * 6 + 3 + 5 * 4)


def test_a_reset_ends_what_ran():
    uno = board(CALLS, main=0, outer=0x80, inner=0x90, tail=0xA0)
    uno.observe()
    uno.run(cycles=16)  # LDI, CALL, NOP, RCALL: in inner
    uno.reset()
    uno.run(cycles=1000)
    insight = uno.insight()
    assert insight.function("main").calls == 2
    assert sum(f.self_cycles for f in insight.functions) == insight.cycles


def test_watching_changes_nothing_and_slices_do_not_matter():
    source = TIMER.format(loop="ldi r16, 1\nout 0x33, r16\nloop: sleep\ncall sub\nrjmp loop")
    plain = board(source)
    plain.run(cycles=60_000)

    @settings(deadline=None, max_examples=20)
    @given(st.lists(st.integers(1, 9_000), max_size=12))
    def check(slices):
        watched = board(source, main=0x40, sub=0x100)
        watched.observe()
        for cycles in slices:
            watched.run(cycles=min(cycles, 60_000 - watched.cycle) if watched.cycle < 60_000 else 0)
        watched.run(cycles=max(0, 60_000 - watched.cycle))
        assert watched.edges("D13").tolist() == plain.edges("D13").tolist()
        whole.append((watched.insight(), watched.interrupt_intervals().tolist()))
        assert whole[-1] == whole[0]

    whole = []
    check()


def test_a_restored_board_is_watched_anew():
    uno = board(TIMER.format(loop="loop: rjmp loop"))
    kept = uno.snapshot()
    uno.observe()
    uno.run(cycles=5_000)
    first = (uno.insight(), uno.interrupt_intervals().tolist())
    uno.restore(kept)
    uno.run(cycles=5_000)
    assert (uno.insight(), uno.interrupt_intervals().tolist()) == first


@pytest.mark.parametrize("slice_s", [0.000_013, 0.000_25, 0.002])
def test_waveforms_with_interrupts_written_piece_by_piece_are_those_written_at_once(tmp_path, slice_s, monkeypatch):
    """Interrupts within an interrupt, edges within both, and slices that end in the midst of them."""
    monkeypatch.setattr("planarm_sim.bridge.bridge.QUIET_SLICE_S", slice_s)
    nested = TIMER.replace("isr:\n", "isr:\nsei\nnop\n").replace("0xE7", "0x20").replace("ldi r16, 3", "ldi r16, 0")
    pieces, whole = (board(nested.format(loop="loop: rjmp loop")) for _ in range(2))
    clock = FakeClock()
    watch = Watch(vcd=tmp_path / "pieces.vcd", interrupts=True)
    run_board(pieces, FakeLine(clock, []), clock, Stop(), watch=watch, seconds=0.01, say=print)
    whole.observe()
    whole.run(cycles=1)
    whole.clear_edges()
    whole.run(cycles=pieces.cycle - whole.cycle)
    whole.write_vcd(tmp_path / "whole.vcd", TRACED_PINS)
    text = (tmp_path / "pieces.vcd").read_text()
    assert text == (tmp_path / "whole.vcd").read_text()
    assert text.count("b1011 ") > 1000, "TIMER1_COMPA, vector 11"


def test_interrupts_have_no_place_without_waveforms():
    with pytest.raises(UsageError, match="give --vcd FILE as well"):
        Watch(interrupts=True)


def test_it_must_be_asked_for_before():
    with pytest.raises(UsageError, match=r"call observe\(\) before"):
        board(CALLS).insight()


def test_standing_requests_count_from_the_handlers_return():
    # UDRE asks as long as its enable stands; the handler is entered again and again.
    source = """
    jmp main
    .org 38
    jmp isr
    .org 0x40
    main: ldi r16, 0x28    ; UDRIE0, TXEN0
    sts 0xC1, r16
    sei
    loop: rjmp loop
    isr: reti
    """
    uno = board(source)
    uno.observe()
    uno.run(cycles=1_000)
    intervals = uno.interrupt_intervals()
    assert set(intervals["vector"]) == {19}
    # The enabling STS ends at cycle 3 + 1 + 2; SEI, one RJMP after it, four cycles of entry.
    assert (intervals["flag"][0], intervals["entry"][0]) == (6, 6 + 1 + 2 + ENTRY)
    assert intervals["flag"][1:].tolist() == intervals["exit"][:-1].tolist()
    # One RJMP between the interrupts, as the datasheet wants (7.7): one more instruction is executed.
    assert set(intervals["entry"][1:] - intervals["flag"][1:]) == {2 + ENTRY}


PROGRAM = r"""
#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>
volatile unsigned char sink;
__attribute__((noinline)) unsigned sum(const unsigned char *data, unsigned char n) {
    unsigned s = 0;
    while (n--) s += *data++;
    return s;
}
__attribute__((noinline)) unsigned deep(unsigned char n) {
    unsigned char local[40];
    memset(local, n, sizeof local);
    unsigned below = n ? deep(n - 1) : 0;
    return sum(local, sizeof local) + below;
}
ISR(TIMER0_COMPA_vect) { sink += deep(2); }
int main(void) {
    OCR0A = 249; TCCR0A = _BV(WGM01); TCCR0B = _BV(CS01) | _BV(CS00); TIMSK0 = _BV(OCIE0A);
    sei();
    for (;;) sink += deep(5);
}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed (Debian: gcc-avr, avr-libc)")
    folder = tmp_path_factory.mktemp("insight")
    (folder / "deep.c").write_text(PROGRAM)
    elf = folder / "deep.elf"
    subprocess.run(
        ["avr-gcc", "-mmcu=atmega328p", "-Os", "-fno-inline", "-o", elf, folder / "deep.c"], check=True, timeout=60
    )
    return elf


def test_deepest_stack_as_a_painted_sram_shows_it(compiled):
    uno = Uno.from_elf(compiled)
    uno.run(cycles=100)  # the start-up code has cleared .bss
    painted = uno._chip.sram
    painted[0x100 : uno._chip.sp - 0xFF] = 0xA5
    uno.observe()
    uno.run(seconds=0.5)
    lowest = 0x100 + 0x100 + int(np.nonzero(painted[0x100:] != 0xA5)[0][0])
    deepest = RAM_END - uno.insight().deepest_stack_bytes
    # A local array's last bytes may never be written; the stack pointer is at or below what was.
    assert 0 <= lowest - 1 - deepest <= 2
    assert uno.insight().deepest_stack_bytes > 6 * 42 + 3 * 42, "deep(5), and deep(2) in an interrupt"


def test_a_compiled_programs_functions_add_up(compiled):
    names = {symbol.name for symbol in load_elf(compiled).symbols}
    assert {"main", "deep", "sum", "__vector_14"} <= names
    uno = Uno.from_elf(compiled)
    uno.observe()
    uno.run(seconds=0.2)
    insight = uno.insight()
    figures = {f.name: f for f in insight.functions}
    interrupts = insight.interrupt("TIMER0_COMPA").count
    # OCR0A + 1 = 250 counts of 64 cycles: 1 kHz.
    assert interrupts == 199
    assert figures["__vector_14"].calls == interrupts
    assert figures["sum"].calls == pytest.approx(figures["deep"].calls, abs=9)
    # sum's loop takes the same time for each of its 40 bytes: every call costs the same.
    assert figures["sum"].self_cycles == figures["sum"].inclusive_cycles
    assert figures["sum"].inclusive_cycles / figures["sum"].calls == pytest.approx(
        figures["sum"].inclusive_cycles // figures["sum"].calls, abs=1
    )
    # All cycles are somebody's: functions by themselves, entries and table jumps of interrupts, the start-up code.
    rest = insight.cycles - sum(f.self_cycles for f in insight.functions) - interrupts * (ENTRY + 3)
    assert 0 <= rest < 200
    hex_file = compiled.with_suffix(".hex")
    subprocess.run(
        ["avr-objcopy", "-O", "ihex", "-j", ".text", "-j", ".data", compiled, hex_file], check=True, timeout=60
    )
    again = Uno.from_hex(hex_file)
    again.observe(symbols=compiled)
    again.run(seconds=0.2)
    assert again.insight() == insight


def test_the_figures_go_into_json(compiled):
    uno = Uno.from_elf(compiled)
    uno.observe(keep_intervals=False)
    uno.run(seconds=0.01)
    written = uno.insight().as_dict()
    assert written["load"] == 1.0
    assert written["interrupts"][0]["name"] == "TIMER0_COMPA"
    assert set(written["interrupts"][0]["latency_cycles"]) == {"least", "mean", "p99", "most"}
    assert len(uno.interrupt_intervals()) == 0


def test_an_interrupt_within_another_runs_alone_and_the_other_goes_on():
    rows = [(16, 0, 10, 100, 0), (18, 0, 30, 50, 1), (7, 0, 40, 45, 2), (16, 0, 100, 120, 0)]
    told = running_interrupts(np.array(rows, dtype=INTERVAL))
    assert told == [(10, 16), (30, 18), (40, 7), (45, 18), (50, 16), (100, 0), (100, 16), (120, 0)]
