"""What every transport keeps, whatever it is made of: run on each of them with a peer that sends back what it gets."""

import os
import pty
import socket
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from link_echo import write_echo_image
from link_model import ModelLine
from planarm.errors import LinkError
from planarm.link.transport import Transport, open_transport

EVERY_BYTE = bytes(range(256))
FOREVER_S = float("inf")


@dataclass
class Line:
    """A transport, and what makes its peer send back what it has received."""

    transport: Transport
    serve_peer: Callable[[], None] = lambda: None

    def write(self, data: bytes) -> None:
        self.transport.write(data)
        self.serve_peer()

    def read_all(self, count: int, max_bytes: int = 4096) -> bytes:
        data = b""
        while len(data) < count:
            piece = self.transport.read(max_bytes, FOREVER_S)
            assert 1 <= len(piece) <= max_bytes
            data += piece
        return data


def over_loop(_tmp_path) -> Iterator[Line]:
    yield Line(open_transport("loop://"))


def over_pty(_tmp_path) -> Iterator[Line]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    transport = open_transport(os.ttyname(slave))
    yield Line(transport, serve_peer=lambda: os.write(master, os.read(master, 4096)) and None)
    transport.close()
    os.close(slave)
    os.close(master)


def over_socket(_tmp_path) -> Iterator[Line]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(f"socket://127.0.0.1:{server.getsockname()[1]}")
        peer, _ = server.accept()
        with peer:
            yield Line(transport, serve_peer=lambda: peer.sendall(peer.recv(4096)))
            transport.close()


def over_emulator(tmp_path) -> Iterator[Line]:
    transport = open_transport(f"sim://?image={write_echo_image(tmp_path)}")
    transport.clock.wait_until(0.001)  # the program sets its baud rate first
    yield Line(transport)


def over_emulated_usb(tmp_path) -> Iterator[Line]:
    transport = open_transport(f"sim://?usb=16u2&image={write_echo_image(tmp_path)}")
    transport.clock.wait_until(0.001)
    yield Line(transport)


def over_memory(_tmp_path) -> Iterator[Line]:
    line = ModelLine()
    line.device.take_byte = lambda byte: line.from_device(bytes([byte])) and None
    yield Line(line)


@pytest.fixture(
    params=[over_loop, over_pty, over_socket, over_emulator, over_emulated_usb, over_memory],
    ids=lambda make: make.__name__,
)
def line(request, tmp_path) -> Iterator[Line]:
    yield from request.param(tmp_path)


def test_every_byte_value_comes_through_in_order(line):
    line.write(EVERY_BYTE)
    assert line.read_all(256) == EVERY_BYTE


def test_read_returns_without_waiting_for_more_than_there_is(line):
    """The deadline never comes, so waiting for the other 4095 bytes would never end."""
    line.write(b"\x7e")
    assert line.transport.read(4096, FOREVER_S) == b"\x7e"


def test_what_exceeds_max_bytes_stays_for_the_next_read(line):
    line.write(b"abcdef")
    assert line.read_all(6, max_bytes=2) == b"abcdef"


def test_silence_ends_at_the_deadline(line):
    clock = line.transport.clock
    deadline_s = clock.now_s() + 0.01
    assert line.transport.read(10, deadline_s) == b""
    assert clock.now_s() >= deadline_s


def test_a_deadline_in_the_past_does_not_wait(line):
    before_s = line.transport.clock.now_s()
    assert line.transport.read(10, before_s - 1e9) == b""


def test_a_deadline_in_the_past_still_takes_what_is_there(line):
    line.write(b"ab")
    first = line.transport.read(1, FOREVER_S)
    line.transport.clock.wait_until(line.transport.clock.now_s() + 0.005)
    assert first + line.transport.read(10, 0.0) == b"ab"


def test_writes_follow_one_another(line):
    for piece in (b"one ", b"two ", b"three"):
        line.write(piece)
    assert line.read_all(13) == b"one two three"


def test_the_clock_does_not_go_back(line):
    seen = [line.transport.clock.now_s()]
    for _ in range(5):
        line.write(b"x")
        line.read_all(1)
        seen.append(line.transport.clock.now_s())
    assert seen == sorted(seen)


def test_closed_is_closed(line):
    line.transport.close()
    line.transport.close()
    with pytest.raises(LinkError, match="closed"):
        line.transport.read(1, 0.0)
    with pytest.raises(LinkError, match="closed"):
        line.transport.write(b"x")


def test_only_an_emulated_board_shows_pins(line):
    pins = line.transport.pins
    assert pins is None or len(pins.edges("D9")) == 0
