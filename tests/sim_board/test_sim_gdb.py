"""The debugger's port: packets as GDB's manual has them, and avr-gdb itself."""

import re
import shutil
import socket
import subprocess
import threading

import pytest

from planarm_sim import Uno
from planarm_sim.cpu.chip import StopCause
from planarm_sim.debug import GdbServer, Session
from planarm_sim.debug.packets import INTERRUPT, RESEND, PacketReader, packet
from planarm_sim.errors import BridgeError
from planarm_sim.loader import Image
from sim_chip.avr_assembler import assemble

FLASH = 32 * 1024
LONG_S = 60.0  # a bound for what takes a second


def board(source):
    program = assemble(source)
    return Uno(Image(program + bytes([0xFF]) * (FLASH - len(program)), len(program), "test"))


class Debugger:
    """Speaks the protocol to a session and lets the board run when it may."""

    def __init__(self, uno):
        self.uno = uno
        self.target = uno.debug_target()
        self.session = Session(self.target)

    def ask(self, payload):
        sent = self.session.receive(packet(payload))
        assert sent[:1] == b"+"
        if self.session.running and not self.session.ended:
            cause = self.uno._chip.run_to(self.uno.cycle + 1_000_000)
            sent += self.session.stopped(cause) if cause is not StopCause.REACHED else b""
        answer = sent[1:]
        assert answer == b"" or answer == packet(answer[1:-3])
        return answer[1:-3]


# --- packets ---


def test_packets_may_come_in_any_pieces():
    stream = b"+" + packet(b"g") + packet(b"m0,4") + INTERRUPT + packet(b"c")
    for size in range(1, 8):
        reader = PacketReader()
        events, answers = [], b""
        for at in range(0, len(stream), size):
            some, acknowledged = reader.feed(stream[at : at + size])
            events += some
            answers += acknowledged
        assert events == [b"$g", b"$m0,4", INTERRUPT, b"$c"]
        assert answers == b"+++"


def test_a_damaged_packet_is_asked_for_again():
    reader = PacketReader()
    assert reader.feed(b"$g#00") == ([], b"-")
    assert reader.feed(b"$g#67") == ([b"$g"], b"+")
    assert reader.feed(RESEND) == ([RESEND], b"")
    endless = PacketReader()
    assert endless.feed(b"$" + b"a" * 0x5000)[1] == b"-", "a packet without end does not fill the memory"


# --- a session, command by command ---

SOURCE = """
ldi r16, 0x12
ldi r17, 0x34
sts 0x200, r16
nop
sts 0x201, r17
loop: inc r18
rjmp loop
"""


def test_registers_and_memories():
    debugger = Debugger(board(SOURCE))
    assert debugger.ask(b"?") == b"S05"
    assert debugger.ask(b"s") == b"S05"
    registers = debugger.ask(b"g")
    # r0 to r31, SREG, SP (0x08FF) and PC (a byte address), low bytes first.
    assert registers == b"00" * 16 + b"12" + b"00" * 15 + b"00" + b"ff08" + b"02000000"
    assert debugger.ask(b"p22") == b"02000000"
    assert debugger.ask(b"P10=7f") == b"OK"
    assert debugger.ask(b"p10") == b"7f"
    assert debugger.ask(b"G" + registers) == b"OK"
    assert debugger.ask(b"g") == registers
    assert debugger.ask(b"G00") == b"E01"
    assert debugger.ask(b"m0,4") == SOURCE_BYTES[:4].hex().encode()
    assert debugger.ask(b"M800300,2:abcd") == b"OK"
    assert debugger.ask(b"m800300,2") == b"abcd"
    assert debugger.ask(b"m810000,2") == b"ffff"
    assert debugger.ask(b"M810001,1:11") == b"OK"
    assert debugger.ask(b"m810000,2") == b"ff11"
    assert debugger.ask(b"X800300,3:a}\x03}\x04") == b"OK"
    assert debugger.ask(b"m800300,3") == b"612324"
    assert debugger.ask(b"m8008ff,4") == b"00", "the memory ends there"
    assert debugger.ask(b"m800900,4") == b"E01"
    assert debugger.ask(b"M8008ff,2:0000") == b"E01"
    assert debugger.ask(b"mzz,4") == b"E01"
    assert debugger.ask(b"vMustReplyEmpty") == b""


SOURCE_BYTES = assemble(SOURCE)


def test_reading_a_register_does_not_do_what_reading_it_does():
    uno = board("ldi r16, 0x18\nsts 0xC1, r16\nldi r16, 3\nsts 0xC4, r16\nloop: rjmp loop")  # RXEN0, 250,000 baud
    uno.run(cycles=100)
    uno.serial.write(b"x")
    uno.run(cycles=1000)
    debugger = Debugger(uno)
    for _ in range(2):
        assert debugger.ask(b"m8000c6,1") == b"78", "UDR0 would be empty after a first read"
    assert int(debugger.ask(b"m8000c0,1"), 16) & 0x80, "RXC0 stands"


def test_breakpoints_stop_before_the_instruction_and_let_go_on():
    debugger = Debugger(board(SOURCE))
    assert debugger.ask(b"Z0,e,2") == b"OK"  # INC: five words and two of the STSs' before it
    cycles = []
    for _ in range(3):
        assert debugger.ask(b"c") == b"S05"
        assert debugger.ask(b"p22") == b"0e000000"
        cycles.append(debugger.uno.cycle)
    assert cycles == [7, 10, 13], "INC and RJMP take three cycles"
    assert debugger.ask(b"p12") == b"02"
    assert debugger.ask(b"z0,e,2") == b"OK"
    assert debugger.ask(b"c") == b"", "nothing stops it any more"
    assert debugger.session.receive(INTERRUPT) == packet(b"S02")


def test_watchpoints_stop_behind_the_change():
    debugger = Debugger(board(SOURCE))
    assert debugger.ask(b"Z2,800201,1") == b"OK"
    assert debugger.ask(b"Z3,800201,1") == b"", "reads cannot be watched"
    assert debugger.ask(b"c") == b"T05watch:800201;"
    assert debugger.ask(b"p22") == b"0e000000"
    assert debugger.ask(b"z2,800201,1") == b"OK"
    assert debugger.ask(b"Z2,800012,1") == b"OK"  # r18
    assert debugger.ask(b"c") == b"T05watch:800012;"
    assert debugger.ask(b"p12") == b"01"


def test_what_ends_a_program_is_a_signal():
    assert Debugger(board("nop\nbreak\nloop: rjmp loop")).ask(b"c") == b"S05"
    undefined = Debugger(board("nop"))
    assert undefined.ask(b"c") == b"S04"
    assert undefined.ask(b"p22") == b"02000000"


def test_monitor_commands():
    debugger = Debugger(board(SOURCE))
    debugger.ask(b"s")
    assert bytes.fromhex(debugger.ask(b"qRcmd," + b"cycle".hex().encode()).decode()) == b"1\n"
    assert debugger.ask(b"qRcmd," + b"reset".hex().encode()) == b"OK"
    assert debugger.ask(b"p22") == b"00000000"
    assert b"reset and cycle" in bytes.fromhex(debugger.ask(b"qRcmd," + b"help".hex().encode()).decode())


def test_after_detaching_the_board_runs_as_before():
    uno, plain = board(SOURCE), board(SOURCE)
    debugger = Debugger(uno)
    debugger.ask(b"Z0,e,2")
    debugger.ask(b"c")
    assert debugger.ask(b"D") == b"OK"
    assert debugger.session.ended
    uno.run(cycles=1000)
    plain.run(cycles=uno.cycle)
    assert uno._chip.registers.tolist() == plain._chip.registers.tolist()


def test_a_port_that_is_taken_and_one_that_does_not_exist_are_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        for port in (taken.getsockname()[1], 70_000):
            with pytest.raises(BridgeError, match=f"gdb port {port}: .*choose another"):
                GdbServer(port, board(SOURCE).debug_target)


# --- avr-gdb ---

PROGRAM = """
#include <avr/io.h>
volatile unsigned char counter, steps[4] = {1, 2, 3, 4};
__attribute__((noinline)) void bump(unsigned char by) { counter += by; }
int main(void) {
    DDRB = 0x20;
    for (unsigned char n = 0;; n++) {
        bump(steps[n & 3]);
        PINB = 0x20;
    }
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    for tool, package in (("avr-gcc", "gcc-avr, avr-libc"), ("avr-gdb", "gdb-avr")):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed (Debian: {package})")
    folder = tmp_path_factory.mktemp("gdb")
    (folder / "bump.c").write_text(PROGRAM)
    elf = folder / "bump.elf"
    subprocess.run(["avr-gcc", "-mmcu=atmega328p", "-Og", "-g", "-o", elf, folder / "bump.c"], check=True, timeout=60)
    return elf


def run_gdb(elf, port, *commands):
    lines = [f"target remote localhost:{port}", *commands]
    options = [part for line in lines for part in ("-ex", line)]
    shown = subprocess.run(
        ["avr-gdb", "-q", "-batch", "-nx", *options, elf], capture_output=True, text=True, timeout=LONG_S, check=False
    )
    return shown.stdout + shown.stderr


def served(uno):
    """Serve gdb in a thread; returns it and its port."""
    ports, there = [], threading.Event()

    def announce(port):
        ports.append(port)
        there.set()

    server = threading.Thread(target=lambda: uno.serve_gdb(0, announce=announce), daemon=True)
    server.start()
    assert there.wait(LONG_S)
    return server, ports[0]


@pytest.fixture
def gdb(program):
    """Run avr-gdb's commands on a new board; returns what it printed, and the board."""
    uno = Uno.from_elf(program)

    def run(*commands):
        server, port = served(uno)
        printed = run_gdb(program, port, *commands)
        server.join(LONG_S)
        assert not server.is_alive(), "it ends when the debugger has gone"
        return printed, uno

    return run


def test_avr_gdb_breaks_steps_and_looks_at_all_memories(gdb):
    printed, uno = gdb(
        "break bump",
        "continue",
        "print by",
        "backtrace 2",
        "finish",
        "print counter",
        "continue",
        "print/d by",
        "info registers r24",
        "set var counter = 40",
        "stepi",
        "x/4xb &steps",
        "x/2xh 0",
        "x/2xb 0x810000",
        "finish",
        "print counter",
        "monitor cycle",
        "detach",
    )
    assert re.search(r"Breakpoint 1, bump \(by=1 .*\)", printed), printed
    assert re.search(r"#1 +0x[0-9a-f]+ in main", printed)
    values = re.findall(r"^\$\d+ = (\d+)", printed, re.M)
    assert values == ["1", "1", "2", "42"], printed
    assert re.search(r"r24 +0x2", printed)
    assert re.search(r":\t0x01\t0x02\t0x03\t0x04", printed)
    assert re.search(r"0x810000:\t0xff\t0xff", printed)
    assert re.search(r"^\d{2,3}$", printed, re.M), "the cycle"
    before = len(uno.edges("D13"))
    uno.run(cycles=1000)
    assert len(uno.edges("D13")) > before, "after detaching the board is free"


def test_avr_gdb_watches_a_variable(gdb):
    printed, _ = gdb("watch counter", "continue", "continue", "kill")
    assert "Hardware watchpoint 1: counter" in printed, printed
    assert re.findall(r"New value = (\d+)", printed) == ["1", "3"]


def test_ctrl_c_stops_a_running_board(program):
    uno = Uno.from_elf(program)
    server, port = served(uno)
    with socket.create_connection(("127.0.0.1", port), timeout=LONG_S) as debugger:
        debugger.sendall(packet(b"c") + INTERRUPT)
        assert debugger.recv(1) == b"+"
        answer = b""
        while len(answer) < len(packet(b"S02")):
            answer += debugger.recv(100)
        assert answer == packet(b"S02")
    server.join(LONG_S)
    assert not server.is_alive(), "a debugger that just goes is gone, too"
