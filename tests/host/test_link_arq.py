"""Go-back-N: exactly once, in order, within the window, whatever is lost; times by RFC 6298."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm.link.arq import BACK_OFF, INITIAL_TIMEOUT_S, MAX_TIMEOUT_S, MIN_TIMEOUT_S, Ack, GoBackN
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import DELIMITER, HOST_WINDOW_BYTES, Query

FREE = 32


def frame_of(arq: GoBackN, payload: bytes = b"") -> bytes:
    return encode_frame(arq.next_seq, Query.TYPE, payload)


def send(arq: GoBackN, now_s: float = 0.0, payload: bytes = b"", room: int = 0) -> bytes:
    return arq.send(frame_of(arq, payload), room, now_s)


class Receiver:
    """The device's rule: the frame with the expected number is carried out, any other changes nothing."""

    def __init__(self) -> None:
        self.expected = 0
        self.carried_out: list[bytes] = []
        self.decoder = FrameDecoder()

    def take(self, data: bytes) -> None:
        for frame in self.decoder.feed(data):
            if isinstance(frame, Frame) and frame.seq == self.expected:
                self.carried_out.append(frame.payload)
                self.expected = (self.expected + 1) % 256


@given(
    st.lists(st.binary(min_size=2, max_size=48), min_size=1, max_size=60),
    st.integers(0, 255),
    st.floats(0.0, 0.5),
    st.randoms(use_true_random=False),
)
@settings(max_examples=60, deadline=None)
def test_everything_arrives_once_and_in_order_within_the_window(payloads, first_seq, loss, chance):
    arq, receiver, now_s = GoBackN(first_seq), Receiver(), 0.0
    receiver.expected = first_seq
    waiting = list(payloads)

    def pass_on(data: bytes) -> None:
        for piece in data.split(bytes([DELIMITER])):
            if piece and chance.random() >= loss:
                receiver.take(piece + bytes([DELIMITER]))

    while waiting or not arq.idle:
        while waiting and arq.fits(frame_of(arq, waiting[0])):
            pass_on(send(arq, now_s, waiting.pop(0)))
            assert arq.bytes_in_flight <= HOST_WINDOW_BYTES
        now_s = max(now_s + 0.001, arq.deadline_s) if chance.random() < 0.5 else now_s + 0.003
        if chance.random() >= loss:
            verdict, again = arq.on_ack(receiver.expected, FREE, now_s)
            assert verdict is not Ack.STRAY
            pass_on(again)
        pass_on(arq.on_time(now_s))
    assert receiver.carried_out == payloads
    assert arq.bytes_in_flight == arq.room_in_flight == 0
    assert arq.counters.frames_sent == len(payloads)


def test_the_sequence_wraps_many_times():
    arq, receiver = GoBackN(250), Receiver()
    receiver.expected = 250
    chance = random.Random(5)
    for number in range(1000):
        receiver.take(send(arq, number * 0.01, number.to_bytes(2, "little")))
        if not arq.fits(bytes(20)) or chance.random() < 0.3:
            assert arq.on_ack(receiver.expected, FREE, number * 0.01 + 0.005)[0] is Ack.ADVANCED
    assert receiver.carried_out == [number.to_bytes(2, "little") for number in range(1000)]
    assert arq.counters.retransmissions == 0


def test_a_frame_beyond_the_window_is_a_mistake_of_the_caller():
    arq = GoBackN(0)
    send(arq, payload=bytes(range(1, 49)))
    send(arq, payload=bytes(range(1, 40)))
    big = frame_of(arq, bytes(range(1, 49)))
    assert not arq.fits(big)
    with pytest.raises(ValueError, match=r"do not fit: \d+ of 112 in flight"):
        arq.send(big, 1, 0.0)


def test_a_repeated_acknowledgement_sends_all_again_once_per_time_out():
    arq = GoBackN(7)
    frames = [send(arq, 0.0), send(arq, 0.0), send(arq, 0.0)]
    verdict, again = arq.on_ack(7, FREE, 0.01)
    assert verdict is Ack.REPEATED
    assert again == bytes([DELIMITER]) + b"".join(frames)
    assert arq.on_ack(7, FREE, 0.02) == (Ack.REPEATED, b"")
    assert arq.on_ack(7, FREE, 0.01 + INITIAL_TIMEOUT_S)[1] == again
    assert arq.counters.retransmissions == 6
    assert arq.counters.repeated_acks == 3


def test_answers_to_superfluous_copies_do_not_cause_new_copies():
    """The sorcerer's apprentice, RFC 1123, 4.2.3.1: every copy is answered, no answer may be a cause."""
    arq = GoBackN(0)
    send(arq, 0.0)
    assert arq.on_ack(0, FREE, 0.010)[1] != b""  # answer to line noise: a copy that nobody needed
    assert arq.on_ack(1, FREE, 0.011)[0] is Ack.ADVANCED
    send(arq, 0.012)
    assert arq.on_ack(1, FREE, 0.013) == (Ack.REPEATED, b"")  # the copy's answer


def test_a_repeated_acknowledgement_with_nothing_in_flight_means_nothing():
    assert GoBackN(3).on_ack(3, FREE, 1.0) == (Ack.REPEATED, b"")


def test_busy_is_asked_again_at_the_time_out_only():
    arq = GoBackN(0)
    frame = send(arq, 0.0, b"segments", room=3)
    assert arq.room_in_flight == 3
    assert arq.on_ack(0, 2, 0.01) == (Ack.REPEATED, b"")
    assert arq.counters.busy_replies == 1
    assert arq.on_time(INITIAL_TIMEOUT_S) == bytes([DELIMITER]) + frame
    assert arq.on_ack(1, 0, 0.06)[0] is Ack.ADVANCED
    assert arq.room_in_flight == 0


@pytest.mark.parametrize("ack", [9, 13, 200])
def test_an_acknowledgement_of_what_was_never_sent_is_stray(ack):
    arq = GoBackN(10)
    send(arq)
    send(arq)
    assert arq.on_ack(ack, FREE, 0.01) == (Ack.STRAY, b"")
    assert arq.on_ack(12, FREE, 0.01)[0] is Ack.ADVANCED


def test_time_outs_in_a_row_grow_to_the_bound():
    arq = GoBackN(0)
    frame = send(arq, 0.0)
    wait_s, now_s = INITIAL_TIMEOUT_S, 0.0
    for _ in range(6):
        assert arq.deadline_s == pytest.approx(now_s + wait_s)
        assert arq.on_time(arq.deadline_s - 1e-6) == b""
        now_s = arq.deadline_s
        assert arq.on_time(now_s) == bytes([DELIMITER]) + frame
        wait_s = min(wait_s * BACK_OFF, MAX_TIMEOUT_S)
    assert wait_s == MAX_TIMEOUT_S


def test_the_time_out_follows_the_round_trip():
    """RFC 6298, 2.2 and 2.3: 3 R after the first measurement R; then SRTT + 4 RTTVAR with gains 1/8 and 1/4."""
    arq = GoBackN(0)
    send(arq, 0.0)
    arq.on_ack(1, FREE, 0.030)
    send(arq, 1.0)
    assert arq.deadline_s - 1.0 == pytest.approx(3 * 0.030)
    arq.on_ack(2, FREE, 1.050)
    send(arq, 2.0)
    deviation_s = 0.75 * 0.015 + 0.25 * 0.020
    smoothed_s = 0.875 * 0.030 + 0.125 * 0.050
    assert arq.deadline_s - 2.0 == pytest.approx(smoothed_s + 4 * deviation_s)


def test_a_fast_line_does_not_bring_the_time_out_below_what_the_usb_bridge_needs():
    arq = GoBackN(0)
    for number in range(50):
        send(arq, number, bytes(40))
        arq.on_ack(number + 1, FREE, number + 0.001)
    send(arq, 100.0)
    assert arq.deadline_s == pytest.approx(100.0 + MIN_TIMEOUT_S)


def test_short_frames_do_not_tell_how_long_a_full_window_takes():
    arq = GoBackN(0)
    for number in range(50):
        send(arq, number)
        arq.on_ack(number + 1, FREE, number + 0.001)
    send(arq, 100.0, bytes(40))
    assert arq.deadline_s == pytest.approx(100.0 + INITIAL_TIMEOUT_S)


def test_the_round_trip_of_a_copy_is_not_measured():
    """Karn's rule, RFC 6298, section 3: nobody knows which of the two was answered; the grown time-out stays."""
    arq = GoBackN(0)
    send(arq, 0.0)
    arq.on_time(0.05)
    arq.on_ack(1, FREE, 0.051)
    send(arq, 1.0)
    assert arq.deadline_s - 1.0 == pytest.approx(INITIAL_TIMEOUT_S * BACK_OFF)
    arq.on_ack(2, FREE, 1.02)
    send(arq, 2.0)
    assert arq.deadline_s - 2.0 == pytest.approx(3 * 0.02)


def test_an_advance_restarts_the_timer_for_what_is_left():
    """RFC 6298, 5.3."""
    arq = GoBackN(0)
    send(arq, 0.0)
    send(arq, 0.0)
    arq.on_ack(1, FREE, 0.040)
    assert arq.deadline_s == pytest.approx(0.040 + 3 * 0.040)
    arq.on_ack(2, FREE, 0.050)
    assert arq.deadline_s == float("inf")
    assert arq.on_time(1e9) == b""


def test_a_reply_that_was_under_way_before_the_frame_arrived_is_not_a_sign_of_loss():
    arq = GoBackN(0)
    send(arq, 0.0)
    arq.on_ack(1, FREE, 0.005)
    send(arq, 1.0)
    assert arq.on_ack(1, FREE, 1.004) == (Ack.REPEATED, b"")
    assert arq.on_ack(1, FREE, 1.006)[1] != b""
