"""The same image and the same timed inputs give the same run, however it is sliced, forked or taken up again."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim import Uno
from planarm_sim.errors import UsageError
from planarm_wire import messages
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame

IMAGE = Path(__file__).parents[2] / "firmware" / "release" / "uno.hex"
HELLO = encode_frame(0, *encode(messages.Hello(messages.PROTOCOL_VERSION, host_nonce=7)))
ENABLE = encode_frame(1, *encode(messages.Enable(on=1)))
END = 1_200_000  # 75 ms

# What the outside does, and at which cycle: frames, noise, pins, voltages, the reset button.
INPUTS = st.lists(
    st.tuples(
        st.integers(0, END - 1),
        st.sampled_from([HELLO, ENABLE, b"\x00\xff\x55noise", ("D12", 1), ("D12", 0), ("D2", 1), ("A0", 3.3), "reset"]),
    ),
    max_size=8,
)
SLICES = st.lists(st.integers(0, END), max_size=25)


def act(uno, what):
    if isinstance(what, bytes):
        uno.serial.write(what)
    elif what == "reset":
        uno.reset()
    elif what[0] == "A0":
        uno.analog("A0").volts = what[1]
    else:
        uno.pin(what[0]).drive(what[1])


def play(uno, inputs, slices=(), until=END):
    """Run to `until` in slices that end at the cycles `slices`, and do at each of the inputs' cycles what they say."""
    moments = [(cycle, None) for cycle in slices] + sorted(inputs, key=lambda i: i[0])
    for cycle, what in [*sorted(moments, key=lambda m: (m[0], m[1] is not None)), (until, None)]:
        if cycle <= until:
            uno.run(cycles=max(0, cycle - uno.cycle))
            if what is not None:
                act(uno, what)
    return uno


def state_of(uno):
    edges = [(pin, *edge) for pin in ("D2", "D8", "D9", "D10", "D12", "D13") for edge in uno.edges(pin).tolist()]
    return (
        uno.cycle,
        edges,
        uno.serial.log.tolist(),
        uno.serial.peek(),
        uno._chip.registers.tolist(),
        uno._chip.sram.tobytes(),
    )


@pytest.mark.parametrize("usb", ["direct", "16u2"])
def test_slices_do_not_matter(usb, sized):
    fresh = Uno.from_hex(IMAGE, usb=usb).fork

    @settings(deadline=None, max_examples=sized(25, 500))
    @given(INPUTS, SLICES)
    def check(inputs, slices):
        whole, sliced = fresh(2)
        assert state_of(play(sliced, inputs, slices)) == state_of(play(whole, inputs))

    check()


def test_forks_go_on_as_the_board_itself_would(sized):
    @settings(deadline=None, max_examples=sized(15, 300))
    @given(INPUTS, st.integers(0, END), st.integers(0, 3))
    def check(inputs, at, others):
        before, after = [i for i in inputs if i[0] < at], [i for i in inputs if i[0] >= at]
        trunk = play(Uno.from_hex(IMAGE, usb="16u2"), before, until=at)
        kept = state_of(trunk)
        *bystanders, chosen = trunk.fork(others + 1)
        for bystander in bystanders:
            play(bystander, [(at, ("D2", 1)), (at + 1, HELLO)])
        forked = state_of(play(chosen, after))
        assert state_of(trunk) == kept, "the board itself has not moved"
        assert state_of(play(trunk, after)) == forked

    check()


def test_a_fork_has_its_own_memory_flash_and_watch():
    trunk = Uno.from_hex(IMAGE)
    trunk.observe()
    trunk.run(cycles=10_000)
    (fork,) = trunk.fork(1)
    fork._chip.sram[:] = 0
    assert np.any(trunk._chip.sram)
    fork._chip.poke_flash(0, b"\0\0")
    assert trunk.flash != fork.flash
    with pytest.raises(UsageError, match="nobody has watched"):
        fork.insight()
    assert trunk.insight().cycles >= 10_000
    with pytest.raises(UsageError, match="forked into -1"):
        trunk.fork(-1)
