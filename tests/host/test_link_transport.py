"""Opening lines: every failure is one sentence that says what to do."""

import array
import contextlib
import errno
import fcntl
import grp
import os
import pty
import re
import tty
from contextlib import closing
from pathlib import Path

import pytest
import serial

from link_echo import write_echo_image
from planarm.cli.main import main
from planarm.errors import LinkError
from planarm.link import released_image as images
from planarm.link import serial_transport
from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import open_session
from planarm.link.transport import open_transport
from planarm.scene import load_scene
from planarm_wire import messages
from planarm_wire.codec import decode, encode
from planarm_wire.framing import FrameDecoder, encode_frame

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TIOCGEXCL = 0x80045440  # Linux, asm-generic/ioctls.h: tells whether TIOCEXCL holds


@pytest.fixture
def ends():
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)


def test_an_unknown_scheme_names_the_known_ones():
    with pytest.raises(LinkError, match=r"unknown scheme 'usb'; give a device path or one of sim://, .*socket://"):
        open_transport("usb://1234")


@pytest.mark.parametrize(
    "url",
    [
        "sim://here",
        "sim:///x.hex",
        "sim://?hex=a",
        "sim://?image=a&speed=2",
        "sim://?usb=8u2",
        "sim://?isr=2",
        "sim://?board=mega",
    ],
)
def test_the_emulator_takes_an_image_and_a_bridge_and_nothing_else(url):
    with pytest.raises(LinkError, match=r"takes sim://, sim://\?image=PATH, sim://\?board=NAME with one of uno, "):
        open_transport(url)


def test_a_board_that_contradicts_the_scenes_is_refused():
    """The image would be one board's, drivers and pins another's: the arm would stand still without a word."""
    three = load_scene(EXAMPLES / "three_links.toml")
    words = r"the scene's arm needs the board uno_four; leave board=uno out, or change board\.wiring"
    for told in ({"board": three.board}, {"setup": ArmSetup(three, (0, 0, 0))}):
        with pytest.raises(LinkError, match=words):
            open_transport("sim://?board=uno", **told)
        with closing(open_transport("sim://?board=uno_four", **told)) as line:
            assert open_session(line).joints == 4


def test_jog_refuses_another_board_than_the_scenes(capsys):
    with pytest.raises(SystemExit):
        main(["jog", str(EXAMPLES / "three_links.toml"), "1", "1", "--port", "sim://?board=cnc_shield_four"])
    assert "needs the board uno_four" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["run"], ["replan", "--arrivals", "none.toml"]])
@pytest.mark.parametrize("port", ["sim://?board=uno", "spy+sim://?usb=16u2&board=uno#x.journal"])
def test_a_motion_for_another_board_is_refused_before_it_is_planned(words, port, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for planner in ("planarm.pipeline.find_route", "planarm.operations.replanning.first_plan"):
        monkeypatch.setattr(planner, lambda *_: pytest.fail("it was planned"))
    with pytest.raises(SystemExit) as left:
        main([words[0], str(EXAMPLES / "three_links.toml"), *words[1:], "--port", port])
    assert left.value.code == LinkError.exit_code
    assert "needs the board uno_four; leave board=uno out" in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())


def test_a_missing_or_damaged_image_is_named(tmp_path):
    with pytest.raises(LinkError, match=r"sim://: .*nothing\.hex"):
        open_transport(f"sim://?image={tmp_path / 'nothing.hex'}")
    damaged = write_echo_image(tmp_path)
    damaged.write_text(damaged.read_text().replace(":10", ":11", 1))
    with pytest.raises(LinkError, match=r"sim://: .*echo\.hex"):
        open_transport(f"sim://?image={damaged}")


def test_an_emulated_program_that_ends_is_a_broken_line(tmp_path):
    image = tmp_path / "stops.hex"
    image.write_text(":020000009895D1\n:00000001FF\n")  # BREAK
    line = open_transport(f"sim://?image={image}")
    with pytest.raises(LinkError, match=r"sim://: .*stops\.hex: the program ended at cycle"):
        line.read(1, 1.0)


def test_a_port_that_is_not_there():
    with pytest.raises(LinkError, match=r"^port /dev/ttyNONE9: not found; serial ports found here: "):
        open_transport("/dev/ttyNONE9")


def test_a_file_that_is_no_port(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(LinkError, match=r"file: is a file, no serial device; serial ports found here: "):
        open_transport(str(file))
    with pytest.raises(LinkError, match=r"is a folder, no serial device; serial ports found here: "):
        open_transport(str(tmp_path))


def test_a_forbidden_port_names_the_group_to_join(tmp_path, monkeypatch):
    """The tests may run as root, who may open anything; so the system's answer is given here."""
    device = tmp_path / "ttyACM0"
    device.write_text("")

    def refuse(*_args, **_options):
        raise serial.SerialException(errno.EACCES, f"could not open port {device}: Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    group = re.escape(grp.getgrgid(device.stat().st_gid).gr_name)
    words = rf"permission denied; join the group {group} \(sudo usermod -aG {group} \$USER\) and log in again"
    with pytest.raises(LinkError, match=words):
        open_transport(str(device))


def test_a_port_in_use_is_refused(ends):
    _, path = ends
    first = open_transport(path)
    with pytest.raises(LinkError, match=r"in use by another program; close that program first"):
        open_transport(path)
    first.close()
    open_transport(path).close()


def test_openers_that_ask_for_no_lock_are_kept_out_too(ends):
    _, path = ends
    line = open_transport(path)
    held = array.array("i", [0])
    with open(path, "rb", buffering=0, opener=lambda name, _: os.open(name, os.O_RDONLY | os.O_NOCTTY)) as other:
        fcntl.ioctl(other.fileno(), TIOCGEXCL, held)
    assert held[0] == 1
    line.close()


def test_a_pulled_cable_is_told(ends):
    master, path = ends
    line = open_transport(path)
    os.close(master)
    with pytest.raises(LinkError, match=r"the line is gone .*was the cable pulled"):
        line.read(10, float("inf"))
    line.close()


def test_a_line_that_takes_nothing_is_told(ends, monkeypatch):
    monkeypatch.setattr(serial_transport, "WRITE_TIMEOUT_S", 0.01)
    line = open_transport(ends[1])
    with pytest.raises(LinkError, match=r"took no bytes for 0\.01 s"):
        line.write(bytes(1_000_000))
    line.close()


def test_the_wheel_comes_before_the_checkout(tmp_path, monkeypatch):
    wheel, checkout = tmp_path / "wheel" / "uno.hex", tmp_path / "checkout" / "uno.hex"
    wheel.parent.mkdir()
    checkout.parent.mkdir()
    monkeypatch.setattr(images, "_FOLDERS", (wheel.parent, checkout.parent))
    with pytest.raises(LinkError, match=r"not found at .*wheel.uno\.hex or .*checkout.uno\.hex"):
        images.released_image()
    checkout.write_text("")
    assert images.released_image() == checkout
    wheel.write_text("")
    assert images.released_image() == wheel


def test_the_emulators_waveforms_tell_which_interrupt_runs_when_asked_to(tmp_path):
    """USART_RX is vector 18 (datasheet, table 12-6: 19, counted from RESET as 1)."""
    for query, asked in (("", False), ("?isr=1", True)):
        with contextlib.closing(open_transport(f"sim://{query}")) as line:
            line.clock.wait_until(0.02)
            line.write(encode_frame(0, *encode(messages.Hello(messages.PROTOCOL_VERSION, host_nonce=7))))
            line.read(100, 1.0)
            line.pins.write_vcd(tmp_path / "pins.vcd")
        text = (tmp_path / "pins.vcd").read_text()
        assert (" isr $end" in text, "\nb10010 " in text) == (asked, asked)


def test_the_emulators_bridge_passes_a_session_on():
    with contextlib.closing(open_transport("sim://?usb=16u2")) as line:
        line.clock.wait_until(0.02)  # the board listens
        line.write(encode_frame(0, *encode(messages.Hello(messages.PROTOCOL_VERSION, host_nonce=7))))
        answer = line.read(100, 1.0)
        assert line.clock.now_s() % 4.096e-3 < 0.5e-3, "it came with a tick of the bridge's timer"
        (frame,) = FrameDecoder().feed(answer)
        assert decode(frame.type_code, frame.payload).host_nonce == 7


@pytest.mark.parametrize(
    ("device", "why"), [("/dev/tty-none", "not found"), (str(EXAMPLES), "is a folder, no serial device")]
)
@pytest.mark.parametrize("command", ["run", "replan"])
def test_a_device_that_is_none_is_told_before_anything_is_planned(command, device, why, tmp_path, capsys):
    arrivals = tmp_path / "later.toml"
    arrivals.write_text('[[obstacles]]\nshape = "circle"\ncenter_cm = [0, 40]\ndiameter_cm = 2\nat_s = 0.5\n')
    more = ["--arrivals", str(arrivals)] if command == "replan" else []
    with pytest.raises(SystemExit) as left:
        main([command, str(EXAMPLES / "energy_two_links.toml"), *more, "--port", device])
    said = capsys.readouterr().err
    assert left.value.code == 5
    assert f"port {device}: {why}" in said
    assert "plan:" not in said and "kernels" not in said
