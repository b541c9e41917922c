"""The pseudo-terminal that hosts open: raw, reopenable, with a link that comes and goes with it."""

import os
import sys
import termios
from pathlib import Path

import pytest

from planarm_sim.bridge.pty_line import PtyLine
from planarm_sim.errors import BridgeError

LONG_S = 30.0  # a bound for what comes at once


def open_terminal(path: str | Path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def read_all(line: PtyLine, length: int) -> bytes:
    data = b""
    while len(data) < length:
        line.wait(LONG_S, for_bytes=True)
        more = line.read(length - len(data))
        assert more, f"only {data!r} came"
        data += more
    return data


def test_every_byte_passes_unchanged_both_ways():
    with PtyLine() as line:
        host = open_terminal(line.path)
        every = bytes(range(256))
        os.write(host, every)
        assert read_all(line, 256) == every
        assert line.write(every) == 256
        received = b""
        os.set_blocking(host, True)
        while len(received) < 256:
            received += os.read(host, 256)
        assert received == every
        os.close(host)


@pytest.fixture(params=["inotify", "hang-up state"])
def any_watch(request, monkeypatch):
    if request.param == "hang-up state":
        monkeypatch.setattr("planarm_sim.bridge.pty_line.watch_opening", lambda _path: None)
    elif sys.platform != "linux":
        pytest.skip("inotify is Linux' own")


@pytest.mark.usefixtures("any_watch")
def test_opening_and_closing_is_seen_again_and_again():
    with PtyLine() as line:
        assert not line.is_open()
        assert not line.opened()
        for _ in range(3):
            host = open_terminal(line.path)
            assert line.is_open()
            assert line.opened()
            assert not line.opened(), "told once"
            os.close(host)
            assert not line.is_open()
            assert not line.opened()
            assert line.read(10) == b""


@pytest.mark.skipif(sys.platform != "linux", reason="inotify is Linux' own")
def test_closing_and_opening_between_two_looks_is_seen():
    with PtyLine() as line:
        os.close(open_terminal(line.path))
        assert line.opened(), "even when it is closed again"
        host = open_terminal(line.path)
        assert line.opened()
        os.close(host)
        host = open_terminal(line.path)
        assert line.opened()
        second = open_terminal(line.path)
        assert not line.opened(), "somebody has it open already"
        os.close(host)
        os.close(second)


def test_the_last_bytes_of_a_host_are_there_after_it_has_closed():
    with PtyLine() as line:
        host = open_terminal(line.path)
        os.write(host, b"bye")
        line.wait(LONG_S, for_bytes=True)
        os.close(host)
        assert line.is_open(), "bytes are left to be read"
        assert line.read(2) == b"by"
        assert line.is_open()
        assert line.read(2) == b"e"
        assert not line.is_open()


def test_what_becomes_of_dtr_at_closing_is_a_setting_that_stays():
    with PtyLine() as line:
        for kept in (True, False):
            fd = os.open(line.path, os.O_RDWR | os.O_NOCTTY)
            settings = termios.tcgetattr(fd)
            settings[2] = settings[2] & ~termios.HUPCL if kept else settings[2] | termios.HUPCL
            termios.tcsetattr(fd, termios.TCSANOW, settings)
            os.close(fd)
            assert line.keeps_dtr() is kept


def test_nothing_to_read_is_no_bytes():
    with PtyLine() as line:
        host = open_terminal(line.path)
        assert line.read(10) == b""
        assert line.read(0) == b""
        os.close(host)


def test_a_host_that_reads_nothing_takes_so_much_and_no_more():
    with PtyLine() as line:
        host = open_terminal(line.path)
        taken = 0
        while more := line.write(bytes(1000)):
            taken += more
        assert taken > 1000
        os.close(host)


def test_waiting_on_a_closed_terminal_sleeps_instead_of_spinning(monkeypatch):
    with PtyLine() as line:
        watched = []

        def select(fds, *_):
            watched.append(list(fds))
            return [], [], []

        monkeypatch.setattr("select.select", select)
        line.wait(0.0, for_bytes=True)
        master = line._fd
        assert master not in watched[0]
        host = open_terminal(line.path)
        line.wait(0.0, for_bytes=True)
        line.wait(0.0, for_bytes=False)
        os.close(host)
        others = len(watched[0])  # the watch for openings, where there is one
        assert [len(fds) - others for fds in watched] == [0, 1, 0], "a hang-up would wake select at once, for ever"


def test_the_link_lives_as_long_as_the_terminal(tmp_path):
    link = tmp_path / "uno"
    with PtyLine(link) as line:
        assert str(link.readlink()) == line.path
        host = open_terminal(link)
        assert line.is_open()
        os.close(host)
    assert not link.is_symlink()


def test_a_leftover_link_is_replaced_and_anything_else_is_kept(tmp_path):
    link = tmp_path / "uno"
    link.symlink_to(tmp_path / "gone")
    with PtyLine(link) as line:
        assert str(link.readlink()) == line.path
        with pytest.raises(BridgeError, match=r"cannot link .*uno to .*File exists; give another --link"):
            PtyLine(link)
        assert str(link.readlink()) == line.path
    link.write_text("precious")
    with pytest.raises(BridgeError, match="File exists"):
        PtyLine(link)
    assert link.read_text() == "precious"


def test_a_leftover_link_to_a_terminal_of_the_same_number_is_replaced(tmp_path):
    """The system gives a killed emulator's pty number to the next one, and its link no longer dangles."""
    link = tmp_path / "uno"
    with PtyLine() as line:
        link.symlink_to(line.path)
        line._make_link(link)
        assert str(link.readlink()) == line.path


def test_a_link_that_became_someone_elses_is_not_removed(tmp_path):
    link = tmp_path / "uno"
    with PtyLine(link):
        link.unlink()
        link.symlink_to("/dev/null")
    assert str(link.readlink()) == "/dev/null"


def test_a_link_into_nowhere_is_refused(tmp_path):
    with pytest.raises(BridgeError, match="No such file or directory"):
        PtyLine(tmp_path / "no" / "uno")
