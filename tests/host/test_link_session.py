"""Sessions: opening, mismatches, restarts, refusals and silence, fed with bytes and times by hand."""

import pytest

from link_model import Device, Events
from planarm.errors import DeviceFault, LinkError
from planarm.link.session import Session, SessionLimits
from planarm_wire.codec import encode
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    PROTOCOL_VERSION,
    SPEC_HASH,
    Clear,
    Enable,
    Fault,
    Hello,
    Ledger,
    MessageType,
    Query,
    Reset,
    Result,
    State,
    Status,
    Welcome,
)

NONCE = 0x5EED0001


def welcome(**changed) -> Welcome:
    values = {
        "protocol_version": PROTOCOL_VERSION,
        "host_nonce": NONCE,
        "boot_nonce": 0xB0070001,
        "spec_hash": SPEC_HASH,
        "firmware_version": (1, 2, 3),
        "reset_cause": Reset.EXTERNAL,
        "interrupted": 0,
        "joints": 2,
        "ledger": Ledger(5, (100, -7)),
    }
    return Welcome(**values | changed)


def status(**changed) -> Status:
    values = {
        "state": State.IDLE,
        "fault": Fault.NONE,
        "refusal": Result.OK,
        "refusal_seq": 0,
        "detail": 0,
        "free_bytes": 895,
        "holds": 0,
        "inputs": 0,
        "override_percent": 100,
        "rate_percent": 100,
        "crc_errors": 0,
        "overruns": 0,
        "ring_full": 0,
        "mcu_ticks": 0,
        "ledger": Ledger(5, (100, -7)),
    }
    return Status(**values | changed)


def reply(message, ack: int = 1) -> bytes:
    return encode_frame(ack, *encode(message))


def frames(data: bytes) -> list[Frame]:
    found = FrameDecoder().feed(data)
    assert all(isinstance(frame, Frame) for frame in found)
    return found


def opened() -> Session:
    session = Session(NONCE, 0.0)
    session.on_time(0.0)
    session.take_output()
    session.receive(reply(welcome()), 0.01)
    assert session.is_open
    return session


def test_hello_opens_and_starts_the_sequence():
    session = Session(NONCE, 0.0)
    session.on_time(0.0)
    (hello,) = frames(session.take_output())
    assert (hello.type_code, hello.payload) == encode(Hello(PROTOCOL_VERSION, NONCE))
    assert not session.is_open
    session.receive(reply(welcome(), hello.seq + 1), 0.01)
    assert session.is_open
    session.send(Query(), 0.02)
    assert frames(session.take_output()) == [Frame(hello.seq + 1, MessageType.QUERY, b"")]
    assert session.take_output() == b""


def test_hello_is_repeated_with_pauses_that_let_a_bootloader_give_up():
    session, said = Session(NONCE, 10.0), []
    while session.deadline_s < 15.0:
        now_s = session.deadline_s
        session.on_time(now_s)
        if session.take_output():
            said.append(now_s - 10.0)
    assert said == pytest.approx([0.0, 0.25, 0.75, 2.0, 3.25, 4.5])
    with pytest.raises(LinkError, match=r"no answer to HELLO within 5 s \(6 tries\).*planarm flash"):
        session.on_time(15.0)


def test_an_old_welcome_noise_and_an_old_status_do_not_open():
    session = Session(NONCE, 0.0)
    session.receive(reply(welcome(host_nonce=NONCE - 1)), 0.01)
    session.receive(reply(status(refusal=Result.VERSION, refusal_seq=0), ack=77), 0.01)
    session.receive(b"\xff\x00AT\r\n\x7e", 0.01)
    assert not session.is_open
    session.receive(reply(welcome()), 0.02)
    assert session.is_open
    assert session.line.damaged_replies == 1


def test_another_protocol_version_says_what_to_flash():
    payload = bytes([PROTOCOL_VERSION + 1]) + encode(welcome())[1][1:] + b"more"
    session = Session(NONCE, 0.0)
    with pytest.raises(LinkError, match=r"speaks protocol version 3, this host speaks version 2; flash the released"):
        session.receive(encode_frame(1, MessageType.WELCOME, payload), 0.01)


def test_a_device_that_refuses_our_version_says_the_same():
    session = Session(NONCE, 0.0)
    session.on_time(0.0)
    with pytest.raises(LinkError, match=r"refused the host's protocol version.*planarm flash"):
        session.receive(reply(status(refusal=Result.VERSION, refusal_seq=0)), 0.01)


def test_another_specification_says_what_to_flash():
    session = Session(NONCE, 0.0)
    with pytest.raises(LinkError, match=r"firmware 1\.2\.3 made from another protocol description.*planarm flash"):
        session.receive(reply(welcome(spec_hash=SPEC_HASH ^ 1)), 0.01)


def test_a_late_copy_of_the_welcome_is_harmless():
    session = opened()
    session.receive(reply(welcome()), 0.02)


@pytest.mark.parametrize(
    ("answer", "ack", "words"),
    [
        (welcome(boot_nonce=0xB0070002), 1, "boot nonce went from 0xb0070001 to 0xb0070002"),
        (status(state=State.READY, ledger=Ledger(4, (0, 0))), 2, "executed segments fell from 5 to 4"),
        (status(state=State.IDLE), 2, "it reports idle"),
        (status(state=State.READY), 0, "it expects frame 0, the host is at 2"),
    ],
)
def test_a_restart_shows(answer, ack, words):
    session = opened()
    session.guarded = True
    session.send(Query(), 0.02)
    with pytest.raises(LinkError, match=words):
        session.receive(reply(answer, ack), 0.03)


def test_an_unguarded_session_takes_idle_and_an_old_fault_as_they_are():
    session = opened()
    session.send(Query(), 0.02)
    session.receive(reply(status(state=State.FAULT, fault=Fault.UNDERRUN), 2), 0.03)
    assert session.idle
    session.send(Clear(), 0.04)
    session.receive(reply(status(state=State.IDLE), 3), 0.05)
    assert session.status is not None
    assert session.status.state is State.IDLE


def test_a_fault_is_raised_with_the_words_of_the_specification():
    session = opened()
    session.guarded = True
    with pytest.raises(DeviceFault, match=r"the segment queue ran empty before the last segment; check the cable"):
        session.receive(reply(status(state=State.FAULT, fault=Fault.UNDERRUN), 1), 0.03)


def test_a_refusal_names_the_message():
    session = opened()
    session.send(Query(), 0.02)
    session.send(Enable(1), 0.02)
    with pytest.raises(
        DeviceFault, match=r"refused ENABLE \(frame 2, state fault\): the command does not fit the state; ask"
    ):
        session.receive(reply(status(state=State.FAULT, refusal=Result.WRONG_STATE, refusal_seq=2), 3), 0.03)


def test_the_device_counters_are_summed_across_their_wrap():
    session = opened()
    for crc_errors, overruns, ring_full in [(250, 3, 255), (255, 3, 255), (2, 4, 1)]:
        session.receive(reply(status(crc_errors=crc_errors, overruns=overruns, ring_full=ring_full), 1), 0.02)
    assert (session.line.crc_errors, session.line.overruns, session.line.ring_full) == (8, 1, 2)


def test_silence_is_an_error_only_while_something_is_waited_for():
    session = opened()
    assert session.deadline_s == float("inf")
    session.on_time(1e6)
    session.send(Query(), 1e6)
    session.on_time(1e6 + 0.999)
    with pytest.raises(LinkError, match=r"no reply for 1\.00 s; check the cable"):
        session.on_time(1e6 + 1.0)


def test_a_device_that_answers_but_takes_nothing_is_told_from_a_silent_one():
    session = Session(NONCE, 0.0, SessionLimits(silence_s=0.5))
    session.receive(reply(welcome()), 0.0)
    session.receive(reply(status()), 0.0)
    session.send(Query(), 0.0)
    session.receive(reply(status(crc_errors=9)), 0.4)
    with pytest.raises(LinkError, match=r"answers but took no frame for 0\.50 s \(9 frames damaged"):
        session.on_time(0.5)


def test_a_reply_that_passes_its_checks_but_has_another_form_is_an_error():
    session = opened()
    with pytest.raises(LinkError, match=r"cannot be read .*planarm flash"):
        session.receive(encode_frame(1, MessageType.STATUS, b"short"), 0.02)


def test_the_model_device_answers_hello_as_the_session_expects():
    """The two sides were written apart; this ties them together."""
    events = Events()
    out = bytearray()
    device = Device(events, send=lambda data: out.extend(data) or events.now_s)
    session = Session(NONCE, 0.0)
    session.on_time(0.0)
    for byte in session.take_output():
        device.take_byte(byte)
    while events.run_next(1.0):
        pass
    session.receive(bytes(out), 1.0)
    assert session.welcome is not None
    assert session.welcome.boot_nonce == device.boot_nonce
