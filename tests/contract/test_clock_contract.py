"""What every clock keeps: time does not go back, and waiting reaches its moment."""

import pytest

from link_echo import write_echo_image
from link_model import ModelLine
from planarm.link.clock import Clock, RealClock, VirtualClock
from planarm.link.transport import open_transport


@pytest.fixture(params=["real", "virtual", "emulator", "model line"])
def clock(request, tmp_path) -> Clock:
    match request.param:
        case "real":
            return RealClock()
        case "virtual":
            return VirtualClock()
        case "emulator":
            return open_transport(f"sim://?image={write_echo_image(tmp_path)}").clock
        case _:
            return ModelLine().clock


def test_waiting_reaches_the_moment(clock):
    for wait_s in (1e-6, 1e-3, 0.0123):
        t_s = clock.now_s() + wait_s
        clock.wait_until(t_s)
        assert clock.now_s() >= t_s


def test_time_does_not_go_back(clock):
    seen = []
    for wait_s in (0.001, -5.0, 0.0, 0.002):
        clock.wait_until(clock.now_s() + wait_s)
        seen.append(clock.now_s())
    assert seen == sorted(seen)


def test_the_past_is_not_waited_for(clock):
    """Were it, this would not end."""
    for t_s in (clock.now_s(), clock.now_s() - 1.0, -1e9):
        clock.wait_until(t_s)
