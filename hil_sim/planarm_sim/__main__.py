"""`python -m planarm_sim IMAGE`: the emulated Uno on its own, behind a pseudo-terminal."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from planarm_sim.bench import BenchReport
from planarm_sim.emulate import Emulation, Watch, emulate
from planarm_sim.errors import SimError
from planarm_sim.insight import Insight

__all__ = ["add_watch_options", "main", "summary", "watch_of"]

SHOWN_FUNCTIONS = 10
EXIT_OK, EXIT_BAD_INPUT, EXIT_PROGRAM_FAILED = 0, 2, 6


def main(arguments: Sequence[str] | None = None) -> int:
    """Parse, emulate, print. Exit codes: 0 ended as asked, 2 bad input, 6 the program failed."""
    parser = argparse.ArgumentParser(
        prog="python -m planarm_sim",
        description="Run an ATmega328P program on an emulated Arduino Uno behind a pseudo-terminal. The terminal's "
        "path is printed first. Ctrl-C ends the emulation.",
    )
    parser.add_argument(
        "image", metavar="IMAGE", nargs="?", help="program: Intel HEX or ELF; may be left out with --bootloader"
    )
    parser.add_argument("--bootloader", metavar="FILE", help="boot loader to start at resets; it takes uploads")
    parser.add_argument("--link", metavar="PATH", help="make PATH a link to the terminal")
    add_watch_options(parser)
    parser.add_argument("--speed", choices=("real", "max"), default="real", help="default: %(default)s")
    parser.add_argument("--baud", type=int, help="of the serial line; default: what the host sets")
    parser.add_argument("--usb", choices=("16u2", "direct"), default="16u2", help="the board's USB bridge, or none")
    parser.add_argument("--seconds", type=float, help="emulated time to run; default: until stopped")
    parser.add_argument("--no-reset-on-open", action="store_true", help="opening the terminal does not reset the board")
    options = parser.parse_args(arguments)
    try:
        result = emulate(
            options.image,
            bootloader=options.bootloader,
            link=options.link,
            watch=watch_of(options),
            speed=options.speed,
            baud=options.baud,
            usb=options.usb,
            seconds=options.seconds,
            reset_on_open=not options.no_reset_on_open,
            announce=_print_line,
            say=_note,
        )
    except SimError as error:
        sys.stderr.write(f"error: {error}\n")
        return EXIT_BAD_INPUT
    for warning in result.warnings:
        _note(warning)
    _print_line(summary(result))
    return EXIT_PROGRAM_FAILED if result.program_failed else EXIT_OK


def add_watch_options(parser: argparse.ArgumentParser) -> None:
    """Add what `watch_of` reads; the same options wherever boards are emulated."""
    parser.add_argument("--vcd", metavar="FILE", help="write the pins' waveforms")
    parser.add_argument("--isr", action="store_true", help="with --vcd: also which interrupt runs; runs slower")
    parser.add_argument("--serial-log", metavar="FILE", help="write every byte on the serial line and its cycles")
    parser.add_argument(
        "--profile", metavar="FILE", help="write interrupts, load, stack and cycles per function (JSON); runs slower"
    )
    parser.add_argument("--symbols", metavar="ELF", help="where --profile finds the functions of an Intel HEX image")
    parser.add_argument("--gdb", type=int, metavar="PORT", help="let avr-gdb attach: target remote localhost:PORT")


def watch_of(options: argparse.Namespace) -> Watch:
    """What the options ask to be recorded."""
    return Watch(options.vcd, options.serial_log, options.profile, options.symbols, options.isr, options.gdb)


def summary(result: Emulation) -> str:
    """The closing lines."""
    edges = ", ".join(f"{name} {count}" for name, count in result.rising_edges.items()) or "none"
    told = (
        f"{result.ended}; {result.cycles} cycles in {result.clock_s:.2f} s ({result.ratio:.2f} x real time); "
        f"rising edges: {edges}; serial: opened {result.counts.opened} x, {result.counts.from_host_bytes} bytes in, "
        f"{result.counts.to_host_bytes} out, {result.counts.lost_bytes} lost"
    )
    if result.bench is not None:
        told += f"\n{bench_summary(result.bench)}"
    return told if result.insight is None else f"{told}\n{insight_summary(result.insight)}"


def bench_summary(report: BenchReport) -> str:
    """What the arm did, in a line, and what faults did to it."""
    if report.clean:
        steps = " / ".join(f"{count.made:+.0f}" for count in report.counts)
        told = f"arm: {steps} micro-steps, none lost, no rule broken, nothing touched"
    else:
        lost = " / ".join(map(str, report.lost_full_steps))
        rules = ", ".join(sorted({violation.rule for violation in report.violations})) or "none"
        told = (
            f"arm: full steps lost {lost} in {len(report.slips)} slips; rules broken: {rules} "
            f"({len(report.violations)} times); touches: {len(report.contacts)}; stops hit: {len(report.stop_hits)}"
        )
    return "\n".join([told, *(f"fault: {line}" for line in report.faults)])


def insight_summary(insight: Insight) -> str:
    """Load, stack, interrupts and the most expensive functions, a line each."""
    lines = [
        f"processor: {insight.load:.1%} awake, {insight.interrupt_share:.1%} in interrupts; "
        f"deepest stack {insight.deepest_stack_bytes} bytes"
    ]
    for figures in insight.interrupts:
        latency, duration = figures.latency_cycles, figures.duration_cycles
        lines.append(
            f"{figures.name}: {figures.count} x, latency {latency.mean:.1f} cycles (p99 {latency.p99}, most "
            f"{latency.most}), duration {duration.mean:.1f} (p99 {duration.p99}, most {duration.most})"
        )
    for function in insight.functions[:SHOWN_FUNCTIONS]:
        lines.append(
            f"{function.name}: {function.self_cycles / insight.cycles:.1%} by itself, "
            f"{function.inclusive_cycles / insight.cycles:.1%} with what it calls, {function.calls} calls"
        )
    return "\n".join(lines)


def _print_line(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _note(text: str) -> None:
    sys.stderr.write(f"note: {text}\n")


if __name__ == "__main__":
    sys.exit(main())
