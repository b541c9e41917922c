"""A run that is watched: the page's server and its locks, orders, the pace of an emulator."""

import http.client
import json
import threading
from urllib.parse import urlsplit

import pytest

from planarm.live.live_run import LiveRun
from planarm.live.server import LiveServer

PAGE = "<!doctype html><title>x</title>"


class FakeStream:
    def __init__(self):
        self.told = []

    def __getattr__(self, name):
        return lambda *words: self.told.append((name, *words))


@pytest.fixture
def served():
    live = LiveRun()
    with LiveServer(live, PAGE) as server:
        yield live, server


def ask(server, method, path, body=None, host=None):
    address = urlsplit(server.url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=5)
    connection.request(method, path, body, {"Host": host or address.netloc})
    answer = connection.getresponse()
    return answer.status, answer.read(), answer


def test_the_page_and_its_state_are_there_for_who_has_the_token(served):
    _, server = served
    assert urlsplit(server.url).hostname == "127.0.0.1"
    status, body, answer = ask(server, "GET", f"/{server.token}/")
    assert (status, body) == (200, PAGE.encode())
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    status, body, _ = ask(server, "GET", f"/{server.token}/state")
    assert json.loads(body) == {"state": "waiting for the start", "over": False}


@pytest.mark.parametrize(
    ("method", "path", "host"),
    [
        ("GET", "/", None),
        ("GET", "/state", None),
        ("GET", "/wrong-token-of-some-length/", None),
        ("POST", "/wrong-token-of-some-length/order", None),
        ("GET", "/{token}/", "planarm.example"),
        ("POST", "/{token}/order", "planarm.example"),
        ("GET", "/{token}/../etc/passwd", None),
    ],
)
def test_nothing_is_there_for_anybody_else(served, method, path, host):
    live, server = served
    status, body, _ = ask(server, method, path.format(token=server.token), b'{"order": "stop"}', host)
    assert (status, body) == (404, b"")
    live.steer(stream := FakeStream())
    assert stream.told == []


@pytest.mark.parametrize(
    "body", [b"", b"x", b"{}", b'{"order": "fly"}', b'{"order": "override", "percent": 0}', b"[1]", b"1" * 1000]
)
def test_what_is_no_order_is_refused(served, body):
    live, server = served
    assert ask(server, "POST", f"/{server.token}/order", body)[0] == 400
    live.steer(stream := FakeStream())
    assert stream.told == []


def test_orders_reach_the_stream_in_their_order(served):
    live, server = served
    for order in ({"order": "hold"}, {"order": "override", "percent": 40}, {"order": "resume"}, {"order": "stop"}):
        assert ask(server, "POST", f"/{server.token}/order", json.dumps(order))[0] == 204
    live.steer(stream := FakeStream())
    assert stream.told == [("hold",), ("override", 40), ("resume",), ("stop",)]


def test_after_the_end_no_order_is_kept():
    live = LiveRun()
    live.end("done")
    live.order("stop")
    live.steer(stream := FakeStream())
    assert stream.told == [] and live.state["over"]


def test_two_runs_have_two_tokens():
    live = LiveRun()
    with LiveServer(live, PAGE) as one, LiveServer(live, PAGE) as other:
        assert one.token != other.token and len(one.token) >= 20


class FakeTime:
    """A clock on the wall, and an emulator's that jumps ahead at each look."""

    def __init__(self):
        self.wall_s, self.emulated_s, self.naps = 100.0, 7.0, []

    def now_s(self):
        return self.emulated_s

    def nap(self, seconds):
        self.naps.append(seconds)
        self.wall_s += seconds


def test_an_emulated_board_is_held_to_the_clock_on_the_wall():
    times = FakeTime()
    live = LiveRun(now_s=lambda: times.wall_s, nap=times.nap)
    live._paced = times
    live.steer(FakeStream())
    assert times.naps == [], "where it starts from is no lead"
    times.emulated_s += 0.03
    live.steer(FakeStream())
    assert times.naps == [pytest.approx(0.03)]
    times.emulated_s += 10.0
    live.steer(FakeStream())
    assert times.naps[-1] <= 0.05, "orders are looked at again soon, whatever the lead"


def test_begin_waits_for_the_start():
    live, begun = LiveRun(), threading.Event()
    waiter = threading.Thread(target=lambda: (live._started.wait(), begun.set()))
    waiter.start()
    assert not begun.wait(0.05)
    live.order("start")
    assert begun.wait(5.0)
    waiter.join()
