"""The virtual clock: it jumps when everybody waits, and not before."""

import threading

import pytest

from planarm.link.clock import VirtualClock


def test_alone_it_jumps_to_the_very_moment():
    clock = VirtualClock(start_s=5.0)
    clock.wait_until(3605.25)
    assert clock.now_s() == 3605.25


def test_two_parties_take_turns_in_the_order_of_their_moments():
    clock, log = VirtualClock(parties=2), []

    def party(name: str, moments: list[float]) -> None:
        for t_s in moments:
            clock.wait_until(t_s)
            log.append((clock.now_s(), name))
        clock.leave()

    threads = [threading.Thread(target=party, args=a) for a in (("a", [1.0, 4.0, 5.0]), ("b", [2.0, 3.0, 7.0, 9.0]))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert log == [(1.0, "a"), (2.0, "b"), (3.0, "b"), (4.0, "a"), (5.0, "a"), (7.0, "b"), (9.0, "b")]


def test_it_stands_still_while_one_party_works():
    clock, woken_s = VirtualClock(parties=2), []

    def other() -> None:
        clock.wait_until(1.0)
        woken_s.append(clock.now_s())
        clock.leave()

    thread = threading.Thread(target=other)
    thread.start()
    assert clock.now_s() == 0.0
    clock.wait_until(2.0)  # now both wait
    thread.join()
    assert woken_s == [1.0]
    assert clock.now_s() == 2.0


def test_a_clock_for_nobody_is_a_mistake():
    with pytest.raises(ValueError, match="at least one party"):
        VirtualClock(parties=0)
