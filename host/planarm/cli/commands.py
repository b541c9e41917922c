"""The whole command line: what each command takes."""

from __future__ import annotations

import argparse

import planarm
from planarm.cli.numbers import count, finite, positive, whole
from planarm.cli.parser import EXIT_CODES, Commands, Parser, add_command
from planarm_wire.messages import BOARDS

PLANNERS = ("a_star", "modified_a_star", "chaos_a_star", "chs", "taut", "theta_star", "lazy_theta_star", "any_angle")


def build_parser() -> Parser:
    """Return the whole command line's parser."""
    parser = Parser(
        prog="planarm",
        description="From a scene file to proven step pulses on an Arduino Uno.",
        epilog=EXIT_CODES,
    )
    parser.add_argument("--version", action="version", version=f"planarm {planarm.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_plan(commands)
    _add_run(commands)
    _add_replan(commands)
    _add_stream(commands)
    _add_resume(commands)
    _add_recorder(commands)
    _add_board(commands)
    _add_arm(commands)
    _add_envelope(commands)
    _add_emulate(commands)
    _add_compare(commands)
    _add_timing(commands)
    _add_campaign(commands, "sweep", "plan or search many scenes and settings")
    _add_campaign(commands, "campaign", "run many emulated boards with faults")
    _add_report(commands)
    _add_setup(commands)
    _add_calibrate(commands)
    _add_explain(commands)
    _add_completion(commands)
    return parser


def _add_plan(commands: Commands) -> None:
    command = add_command(commands, "plan", "plan a scene and write the certified plan")
    _add_scene(command)
    command.add_argument("-o", "--output", metavar="FILE.plan", help="where to write the plan")
    command.add_argument(
        "--alternatives", type=count, metavar="K", help="tell up to K distinct routes with length, time and clearance"
    )
    _add_json(command)


def _add_run(commands: Commands) -> None:
    command = add_command(commands, "run", "plan, stream, verify and report")
    _add_scene(command)
    _add_port(command)
    command.add_argument("--out", metavar="DIR", help="folder for report.html, plan, trace, summary and pictures")
    _add_at_start(command)
    command.add_argument("--faults", metavar="FILE", help="a schedule of what goes wrong around the emulated board")
    command.add_argument("--fault-seed", type=whole, metavar="N", help="in place of the schedule's own seed")
    command.add_argument(
        "--live",
        nargs="?",
        const="page",
        choices=("page", "terminal"),
        help="watch and steer it: a page on this computer alone, or keys in this terminal",
    )
    _add_json(command)


def _add_replan(commands: Commands) -> None:
    command = add_command(commands, "replan", "carry a scene out and plan again when obstacles appear")
    _add_scene(command)
    _add_port(command)
    command.add_argument("--arrivals", metavar="FILE", help="[[obstacles]] with at_s, seconds since the motion began")
    command.add_argument("--watch", metavar="FILE", help="[[obstacles]] that somebody adds to the file meanwhile")
    _add_json(command)


def _add_stream(commands: Commands) -> None:
    command = add_command(commands, "stream", "stream a certified plan")
    command.add_argument("plan", metavar="FILE.plan", help="what 'planarm plan' wrote")
    command.add_argument("--arm", metavar="SCENE", help="the arm that is connected: a plan for another one is refused")
    _add_port(command)
    _add_at_start(command)
    command.add_argument("--out", metavar="DIR", help="folder for plan and journal (out/NAME)")
    _add_json(command)


def _add_resume(commands: Commands) -> None:
    command = add_command(
        commands,
        "resume",
        "go on with a run that broke off",
        details="Tell how well the arm's position is known after a run that broke off: exact, bounded (+-n steps) "
        "or lost. From an exact position the rest of the path is executed, from a bounded one after a yes.",
    )
    command.add_argument("run", metavar="RUN", help="the run's folder")
    _add_port(command)
    command.add_argument("--check", action="store_true", help="only tell the verdict")
    command.add_argument("--yes", action="store_true", help="go on from a bounded position, too")
    _add_json(command)


def _add_recorder(commands: Commands) -> None:
    command = add_command(commands, "dump", "a run's journal, or a byte stream, as readable messages")
    command.add_argument("file", metavar="RUN|FILE", help="a run's folder, a journal, or bytes that a host sent")
    _add_json(command)
    command = add_command(commands, "replay", "play what a run sent into the emulated board")
    command.add_argument("run", metavar="RUN", help="the run's folder")
    command.add_argument("--firmware", metavar="HEX", help="the image to run (default: the released firmware)")
    command.add_argument("--vcd", metavar="FILE", help="write the pins' waveforms")
    _add_json(command)


def _add_board(commands: Commands) -> None:
    command = add_command(commands, "doctor", "ports with their lasting names, rights, other programs, tools, disk")
    command.add_argument("--port", metavar="URL", help="ask the board there, too")
    _add_json(command)
    command = add_command(commands, "flash", "write the released image to an Uno, and verify it")
    command.add_argument("--port", metavar="DEVICE", required=True, help="the board's device")
    command.add_argument("--board", choices=tuple(BOARDS), default="uno", help="whose released image (docs/wiring.md)")
    command.add_argument("--image", metavar="HEX", help="another image; it is not asked who it is")
    _add_json(command)
    command = add_command(
        commands,
        "stop",
        "stop the motion along its path, from any terminal",
        details="Slow down along the path and drop the rest; the position is kept. A program that has the port is "
        "asked to do it. --emergency ends all pulses at once: the position is lost. A real emergency stop cuts "
        "the motors' supply.",
    )
    command.add_argument("--port", metavar="URL", required=True, help="the board's device or URL")
    command.add_argument("--quick", action="store_true", help="as fast as the segments allow")
    command.add_argument("--emergency", action="store_true", help="end all pulses at once")
    _add_json(command)


def _add_arm(commands: Commands) -> None:
    """Add what needs the scene of the arm that is connected."""
    described = {
        "status": "what the board does, and where its arm stands",
        "zero": "tell the board where an arm without limit switches stands",
        "home": "move every joint to its limit switch",
        "jog": "turn one joint by an angle",
        "goto": "go to a point on a certified path",
    }
    parsers = {name: add_command(commands, name, text) for name, text in described.items()}
    for command in parsers.values():
        command.add_argument("scene", metavar="SCENE", help="scene file (TOML) of the arm that is connected")
    parsers["zero"].add_argument(
        "--at", nargs=2, type=finite, metavar=("X", "Y"), help="the tip's place in cm (default: the task's start)"
    )
    for name in ("zero", "goto"):
        parsers[name].add_argument(
            "--deg", nargs="+", type=finite, metavar="ANGLE", help="a place by joint angles, for any number of links"
        )
    parsers["home"].add_argument(
        "--prove",
        action="store_true",
        help="touch the switches again after a run and tell the steps lost since homing, a joint each",
    )
    parsers["jog"].add_argument("joint", type=count, metavar="JOINT", help="from 1")
    parsers["jog"].add_argument("degrees", type=finite, metavar="DEGREES", help="counter-clockwise above 0")
    parsers["goto"].add_argument("x_cm", type=finite, nargs="?", metavar="X", help="in cm")
    parsers["goto"].add_argument("y_cm", type=finite, nargs="?", metavar="Y", help="in cm")
    for command in parsers.values():
        _add_port(command)
        _add_json(command)


def _add_envelope(commands: Commands) -> None:
    command = add_command(commands, "envelope", "map accuracy and speed over the workspace; largest payload and feed")
    _add_scene(command)
    command.add_argument("--out", metavar="DIR", help="folder for envelope.json and envelope.png")
    command.add_argument("--maps-only", action="store_true", help="leave out payload and feed, which plan many times")
    _add_json(command)


def _add_emulate(commands: Commands) -> None:
    command = add_command(commands, "emulate", "run a flash image on the emulated Uno behind a virtual serial port")
    command.add_argument("--firmware", metavar="HEX|ELF", help="the image to run (default: the released firmware)")
    command.add_argument("--board", choices=tuple(BOARDS), help="whose released image (default: the scene's, or uno)")
    command.add_argument("--bootloader", metavar="HEX|ELF", help="a boot loader, so that avrdude can upload")
    command.add_argument(
        "--scene",
        metavar="SCENE",
        help="whose drivers, motors and arm stand around the board, at its task's start; default with the released "
        "firmware: a light arm on a desk",
    )
    command.add_argument("--bare", action="store_true", help="the board alone, without drivers and arm")
    command.add_argument("--faults", metavar="FILE", help="a schedule of what goes wrong (docs/faults.md)")
    command.add_argument("--fault-seed", type=whole, metavar="N", help="in place of the schedule's own seed")
    command.add_argument("--link", metavar="PATH", help="make PATH a link to the pty")
    command.add_argument("--vcd", metavar="FILE", help="write the pins' waveforms")
    command.add_argument("--isr", action="store_true", help="with --vcd: also which interrupt runs; runs slower")
    command.add_argument("--serial-log", metavar="FILE", help="write every byte on the serial line and its cycles")
    command.add_argument(
        "--profile", metavar="FILE", help="write interrupts, load, stack and cycles per function (JSON); runs slower"
    )
    command.add_argument("--symbols", metavar="ELF", help="where --profile finds the functions of an Intel HEX image")
    command.add_argument("--gdb", type=whole, metavar="PORT", help="let avr-gdb attach: target remote localhost:PORT")
    command.add_argument("--speed", choices=("real", "max"), default="real", help="pace of the chip's clock")
    command.add_argument("--seconds", type=positive, metavar="S", help="emulated time to run (default: until stopped)")
    command.add_argument("--usb", choices=("16u2", "direct"), default="16u2", help="the board's USB bridge, or none")
    _add_json(command)


def _add_compare(commands: Commands) -> None:
    command = add_command(commands, "compare", "compute a paper's table anew beside the published one")
    command.add_argument(
        "table",
        nargs="?",
        choices=("table2", "mpdstar", "moving"),
        help="table2: paper C's planners; mpdstar: paper A's; moving: paper B's obstacles that move",
    )
    command.add_argument("--external", metavar="CMD", help="score a planner of yours on the open benchmark instead")
    command.add_argument(
        "--scenes", type=count, metavar="N", help="scenes of the benchmark (all), or random ones of mpdstar (60)"
    )
    command.add_argument("--nodes", type=count, default=100_000, metavar="N", help="largest graph of mpdstar (100000)")
    command.add_argument("--timeout-s", type=positive, default=60.0, metavar="S", help="longest wait for an answer")
    command.add_argument("--out", metavar="DIR", help="folder for TABLE.json, TABLE.md and pictures")
    command.add_argument(
        "--as-printed", action="store_true", help="run the printed equations and pseudo-code, errors included, instead"
    )
    command.add_argument(
        "--random", type=count, metavar="N", help="with moving: N random scenes among moving obstacles instead"
    )
    command.add_argument("--seeds", type=count, default=200, metavar="N", help="draws of Chaos A* (default: 200)")
    _add_json(command)


def _add_timing(commands: Commands) -> None:
    command = add_command(
        commands,
        "timing",
        "judge a recording of the STEP and DIR lines",
        details="planarm timing CAPTURE: hold a VCD or CSV recording against a plan and a driver's rules.\n"
        "planarm timing diff A B: hold recording B against recording A.",
    )
    command.add_argument("captures", metavar="CAPTURE", nargs="+", help="VCD, or CSV of Saleae Logic 2 or sigrok")
    command.add_argument("--plan", metavar="FILE.plan", help="the plan that was executed")
    command.add_argument("--driver", metavar="NAME", help="whose rules hold (default: the plan's; a4988, drv8825 ...)")
    command.add_argument(
        "--map", metavar="LINE=CHANNEL", action="append", help="step1=..., dir1=...; default: pin names"
    )
    command.add_argument("--board", choices=tuple(BOARDS), help="whose pins' names count (default: the plan's, or uno)")
    command.add_argument("--tolerance-us", type=positive, default=1.0, metavar="US", help="off time beyond (1)")
    command.add_argument("--junit", metavar="FILE.xml", help="also write the verdict as JUnit XML")
    command.add_argument("--html", metavar="FILE.html", help="also write a page for people")
    _add_json(command)


def _add_campaign(commands: Commands, name: str, purpose: str) -> None:
    command = add_command(commands, name, purpose)
    command.add_argument("file", metavar=f"{name.upper()}.toml", help="what to run; see docs/scale.md")
    command.add_argument("--out", metavar="DIR", help="folder of the results (out/NAME)")
    command.add_argument("--resume", action="store_true", help="run only what is missing there")
    command.add_argument("--workers", type=count, metavar="N", help="processes on this machine (one a core)")
    command.add_argument(
        "--only", type=whole, metavar="N", help="repeat run N here and tell its row; nothing is written"
    )
    command.add_argument("--dask", metavar="tcp://HOST:PORT", help="a Dask scheduler, instead of this machine")
    _add_json(command)


def _add_report(commands: Commands) -> None:
    command = add_command(commands, "report", "the page of a run; tables and plots of a sweep's or campaign's results")
    command.add_argument("results", metavar="DIR", help="the folder of the run or of the results")
    command.add_argument("--out", metavar="DIR", help="folder for report.html (the run's own) or for the plots")
    _add_json(command)


def _add_setup(commands: Commands) -> None:
    command = add_command(commands, "setup", "ask for an arm, try its joints, and write its scene")
    command.add_argument("file", metavar="FILE.toml", help="the scene to write")
    command.add_argument("--force", action="store_true", help="write over a file that is there")
    _add_port(command)
    _add_json(command)


def _add_calibrate(commands: Commands) -> None:
    command = add_command(
        commands,
        "calibrate",
        "link lengths and zero angles from touched points",
        details="Fit link lengths and zero angles to points that the tip has touched, at least two more than "
        "there are links: read from a CSV file with the head motor1_usteps,motor2_usteps,x_cm,y_cm (as many "
        "motors as joints), or with --port touched now.\n"
        "Whether a run lost steps tells 'planarm home SCENE --prove', by the limit switches.",
    )
    command.add_argument("scene", metavar="SCENE", help="the arm as it is thought to be")
    command.add_argument("points", metavar="POINTS.csv", nargs="?", help="where motors and tip were")
    command.add_argument("-o", "--output", metavar="NEW.toml", help="the scene with what was found, all else kept")
    command.add_argument(
        "--count", type=count, metavar="N", help="points to touch with --port (two for each link, and two)"
    )
    _add_port(command)
    _add_json(command)


def _add_explain(commands: Commands) -> None:
    command = add_command(commands, "explain", "what an error's, check's or fault's code means, and what helps")
    command.add_argument(
        "code", metavar="CODE", nargs="?", help="such as E202, C12, F2 or R2; without it, all are listed"
    )
    _add_json(command)


def _add_completion(commands: Commands) -> None:
    command = add_command(
        commands,
        "completion",
        "print a completion script for a shell",
        details='For bash: eval "$(planarm completion bash)". For zsh the same. For fish:\n'
        "planarm completion fish | source",
    )
    command.add_argument("shell", choices=("bash", "zsh", "fish"), help="whose words they are")


def _add_scene(command: argparse.ArgumentParser) -> None:
    command.add_argument("scene", metavar="SCENE", help="scene file (TOML); see docs/scene.md")
    command.add_argument("--planner", choices=PLANNERS, help="overrides the scene's algorithm")
    command.add_argument("--neighbours", type=whole, metavar="N", help="overrides the scene's neighbourhood")
    command.add_argument("--seed", type=whole, metavar="N", help="overrides the scene's seed (Chaos A*)")
    command.add_argument("--space", choices=("tip", "joint"), help="plan the tip's way, or the joints' (both elbows)")


def _add_at_start(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--at-start", action="store_true", help="you say that the arm stands where the plan begins; the board is told"
    )


def _add_port(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--port", metavar="URL", help="sim:// (the emulator in this process), a device or pty path, a pyserial URL"
    )


def _add_json(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else on stdout")
