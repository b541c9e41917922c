"""USART0 in asynchronous mode: transmitter, sampling receiver, two-byte buffer and overrun.

ATmega328P datasheet, chapter 20. A bit lasts 16 (or with U2X 8) periods of the baud rate divider, and the
divider runs freely from the last write to UBRR0L. The receiver samples the line on the divider's clock: sample
1 is the first low one, a bit is the majority of its three middle samples, and the frame is in when the last
of these is taken in the first stop bit (20.8.2), half a bit before the far end has finished sending.

Not settled by the datasheet, and decided here: a byte written to an idle transmitter starts its start bit at
the end of the writing instruction (on the chip it may wait for the divider), and a byte that overruns takes the
shift register's place (20.7.4: DOR is set when its start bit is found, so the older byte is the one destroyed).
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import constant, inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    BAUD_ORIGIN,
    BIT_FRACTION,
    DUE_RX,
    DUE_TX,
    FORCE_IN,
    FORCE_OUT,
    HORIZON,
    NEVER,
    RX_ACTIVE,
    RX_BASE,
    RX_COUNT,
    RX_ENTRY_0,
    RX_ENTRY_1,
    RX_ENTRY_SHIFT,
    RX_FIRST_SAMPLE,
    RX_HEAD,
    RX_LAST,
    RX_OVERRUN,
    RX_READY,
    RX_TAIL,
    RX_WAITING,
    RX_WIDTH,
    SOMETHING_CHANGED,
    STOP_AT,
    TX_BASE,
    TX_BIT_CYCLES,
    TX_BUFFER,
    TX_BUSY,
    TX_COUNT,
    TX_LIMIT,
    TX_QUIET,
    TX_SHIFT,
    TX_WIDTH,
    State,
)
from planarm_sim.cpu.registers import UBRR0H, UBRR0L, UCSR0A, UCSR0B, UCSR0C
from planarm_sim.peripherals.ports import PORT_D, refresh_port, set_override

RXC, TXC, UDRE, FE, DOR, UPE, U2X, MPCM = (1 << bit for bit in range(7, -1, -1))  # UCSR0A
RXEN, TXEN, UCSZ2, RXB8, TXB8 = 1 << 4, 1 << 3, 1 << 2, 1 << 1, 1 << 0  # UCSR0B
RXD, TXD = 1 << 0, 1 << 1  # PD0, PD1
TXD_PIN = constant(2 * 8 + 1)
ENTRY_DATA, ENTRY_FE, ENTRY_UPE = 0x1FF, 1 << 9, 1 << 10
USBS, UPM1, UPM0 = 1 << 3, 1 << 5, 1 << 4  # UCSR0C


@inner
def divider_cycles(st: State) -> int:
    """Period of the baud rate divider: UBRR0 + 1 cycles."""
    return int(((st[UBRR0H] << 8) | st[UBRR0L]) + 1)


@inner
def samples_per_bit(st: State) -> int:
    """Divider periods per bit."""
    return 8 if st[UCSR0A] & U2X else 16


@inner
def data_bits(st: State) -> int:
    """Data bits per frame, 5 to 9 (datasheet, table 20-11)."""
    size = ((st[UCSR0C] >> 1) & 3) | (st[UCSR0B] & UCSZ2)
    return 9 if size == 7 else 5 + int(size & 3)


# --- Transmitter ---------------------------------------------------------------------------------------------


@inner
def start_frame(st: State, data: int, cycle: int) -> None:
    """Put a character into the transmit shift register; its start bit begins at `cycle`."""
    bits = 2 + data_bits(st) + (1 if st[UCSR0C] & UPM1 else 0) + (1 if st[UCSR0C] & USBS else 0)
    st[TX_BUSY] = 1
    st[TX_SHIFT] = data
    st[TX_BIT_CYCLES] = divider_cycles(st) * samples_per_bit(st)
    st[DUE_TX] = cycle + bits * st[TX_BIT_CYCLES]
    st[HORIZON] = min(st[HORIZON], st[DUE_TX])


@inner
def end_frame(st: State, cycle: int) -> None:
    """The last stop bit is out: log the frame, go on with the buffered character or report completion."""
    count = st[TX_COUNT]
    entry = st[TX_BASE] + TX_WIDTH * count
    st[entry] = cycle
    st[entry + 1] = st[TX_SHIFT]
    st[entry + 2] = st[TX_BIT_CYCLES]
    st[TX_COUNT] = count + 1
    if count + 1 >= st[TX_LIMIT]:
        st[HORIZON] = SOMETHING_CHANGED
    if st[TX_QUIET]:
        st[STOP_AT] = cycle + st[TX_QUIET]
    if st[UCSR0A] & UDRE:
        st[TX_BUSY] = 0
        st[DUE_TX] = NEVER
        st[UCSR0A] |= TXC
        if st[UCSR0B] & TXEN == 0:
            release_transmit_pin(st, cycle)
    else:
        st[UCSR0A] |= UDRE
        start_frame(st, st[TX_BUFFER], cycle)


@inner
def release_transmit_pin(st: State, cycle: int) -> None:
    """Give TXD back to the port."""
    st[FORCE_OUT + PORT_D] &= ~TXD
    set_override(st, TXD_PIN, False, True, cycle)


@inlined
def write_data(st: State, value: int, cycle: int) -> None:
    """Write UDR0; ignored while UDRE0 is clear or the transmitter is off (datasheet, 20.11.1)."""
    if st[UCSR0B] & TXEN == 0 or st[UCSR0A] & UDRE == 0:
        return
    data = value | ((st[UCSR0B] & TXB8) << 8)
    if st[TX_BUSY]:
        st[TX_BUFFER] = data
        st[UCSR0A] &= ~UDRE
    else:
        start_frame(st, data, cycle)


# --- Receiver ------------------------------------------------------------------------------------------------


@inlined
def line_level(st: State, cycle: int) -> int:
    """Level that the far end puts on RXD at `cycle`; idle is 1."""
    for index in range(st[RX_HEAD], st[RX_TAIL]):
        entry = st[RX_BASE] + RX_WIDTH * index
        if cycle < st[entry]:
            return 1
        bit = ((cycle - st[entry]) << BIT_FRACTION) // st[entry + 1]
        if bit < st[entry + 3]:
            return int((st[entry + 2] >> bit) & 1)
    return 1


@inner
def next_falling_edge(st: State, earliest: int) -> int:
    """First cycle from `earliest` on at which the line falls; frames that are over are dropped."""
    while st[RX_HEAD] < st[RX_TAIL]:
        entry = st[RX_BASE] + RX_WIDTH * st[RX_HEAD]
        start = st[entry]
        if start >= earliest:
            return int(start)
        previous = 1
        for index in range(st[entry + 3]):
            bit = (st[entry + 2] >> index) & 1
            begin = start + ((index * st[entry + 1]) >> BIT_FRACTION)
            if previous == 1 and bit == 0 and begin >= earliest:
                return int(begin)
            previous = bit
        st[RX_HEAD] += 1
    return NEVER


@kernel
def plan_receiver(st: State) -> None:
    """Find when the receiver, when idle, sees the next start bit on its sampling clock."""
    due = NEVER
    if st[UCSR0B] & RXEN:
        edge = next_falling_edge(st, st[RX_READY])
        if edge != NEVER:
            period = divider_cycles(st)
            origin = st[BAUD_ORIGIN]
            due = origin - ((origin - edge) // period) * period  # the divider's first clock from the edge on
            st[HORIZON] = min(st[HORIZON], due)
    st[DUE_RX] = due


@inner
def receive_event(st: State, cycle: int) -> None:
    """A start bit is seen (sample 1), or the middle of the stop bit is reached."""
    if st[RX_ACTIVE]:
        finish_frame(st, cycle)
        return
    period = divider_cycles(st)
    samples = samples_per_bit(st)
    if majority(st, cycle, samples // 2 * period, period):  # a spike: look for the next edge
        st[RX_READY] = cycle + (samples // 2 + 1) * period
        plan_receiver(st)
        return
    if st[RX_WAITING]:
        st[RX_OVERRUN] = 1
        st[RX_WAITING] = 0
        update_receive_flags(st)
    bits = 2 + data_bits(st) + (1 if st[UCSR0C] & UPM1 else 0)
    st[RX_ACTIVE] = bits
    st[RX_FIRST_SAMPLE] = cycle
    st[DUE_RX] = cycle + ((bits - 1) * samples + samples // 2 + 1) * period
    st[HORIZON] = min(st[HORIZON], st[DUE_RX])


@inlined
def majority(st: State, first: int, offset: int, period: int) -> int:
    """Level of a bit as the majority of three samples, the middle one `offset` after sample 1 of the frame."""
    middle = first + offset
    ones = line_level(st, middle - period) + line_level(st, middle) + line_level(st, middle + period)
    return 1 if ones >= 2 else 0


@inner
def sampled_bits(st: State) -> int:
    """All bits of the frame being received, start bit first in bit 0."""
    first = st[RX_FIRST_SAMPLE]
    count = st[RX_ACTIVE]
    period = divider_cycles(st)
    samples = samples_per_bit(st)
    entry = st[RX_BASE] + RX_WIDTH * st[RX_HEAD]
    lag = first - st[entry]
    last = lag + ((count - 1) * samples + samples // 2) * period
    if (
        st[entry + 3] >= count
        and 0 <= lag <= period
        and (last - period) << BIT_FRACTION >= (count - 1) * st[entry + 1]
        and (last + period) << BIT_FRACTION < count * st[entry + 1]
    ):  # every sample falls into its own bit: no need to look at each
        return int(st[entry + 2] & ((1 << count) - 1))
    bits = 0
    for bit in range(count):
        bits |= majority(st, first, (bit * samples + samples // 2) * period, period) << bit
    return bits


@inner
def finish_frame(st: State, cycle: int) -> None:
    """Take the frame apart, and move it on to the receive buffer unless that is full."""
    size = data_bits(st)
    bits = sampled_bits(st)
    data = (bits >> 1) & ((1 << size) - 1)
    entry = data
    if (bits >> (st[RX_ACTIVE] - 1)) & 1 == 0:
        entry |= ENTRY_FE
    if st[UCSR0C] & UPM1:
        parity = 1 if st[UCSR0C] & UPM0 else 0
        for bit in range(size + 1):
            parity ^= (bits >> (bit + 1)) & 1
        if parity:
            entry |= ENTRY_UPE
    st[RX_ACTIVE] = 0
    st[RX_READY] = cycle
    if not (st[UCSR0A] & MPCM and is_data_frame(size, data, bits)):
        st[RX_ENTRY_SHIFT] = entry
        st[RX_WAITING] = 1
        move_to_buffer(st)
    plan_receiver(st)


@inner
def is_data_frame(size: int, data: int, bits: int) -> bool:
    """In multi-processor mode: tell data from address by the ninth bit, or by the stop bit (datasheet, 20.9)."""
    if size == 9:
        return data & 0x100 == 0
    return (bits >> (size + 1)) & 1 == 0


@inner
def move_to_buffer(st: State) -> None:
    """Move the frame that waits in the shift register to the buffer if there is room; that clears DOR0."""
    if st[RX_WAITING] and st[RX_COUNT] < 2:
        st[RX_ENTRY_0 + st[RX_COUNT]] = st[RX_ENTRY_SHIFT]
        st[RX_COUNT] += 1
        st[RX_WAITING] = 0
        st[RX_OVERRUN] = 0
    update_receive_flags(st)


@inner
def update_receive_flags(st: State) -> None:
    """RXC0, FE0, UPE0 and RXB80 belong to the oldest byte of the buffer; DOR0 stands until the next byte moves in."""
    flags = st[UCSR0A] & (TXC | UDRE | U2X | MPCM)
    ninth = 0
    if st[RX_COUNT]:
        entry = st[RX_ENTRY_0]
        flags |= RXC | (FE if entry & ENTRY_FE else 0) | (UPE if entry & ENTRY_UPE else 0)
        ninth = RXB8 if entry & 0x100 else 0
    if st[RX_OVERRUN]:
        flags |= DOR
    st[UCSR0A] = flags
    st[UCSR0B] = (st[UCSR0B] & ~RXB8) | ninth


@inlined
def read_data(st: State) -> int:
    """Read UDR0: the oldest byte of the buffer, or the last one again when the buffer is empty."""
    if st[RX_COUNT]:
        st[RX_LAST] = st[RX_ENTRY_0] & 0xFF
        st[RX_ENTRY_0] = st[RX_ENTRY_1]
        st[RX_COUNT] -= 1
        move_to_buffer(st)
    return int(st[RX_LAST])


# --- Control -------------------------------------------------------------------------------------------------


@inner
def write_usart(st: State, address: int, value: int, cycle: int) -> None:
    """Write UCSR0A, UCSR0B, UCSR0C or UBRR0; a frame under way keeps the rate it began with."""
    if address == UCSR0A:
        st[UCSR0A] = (st[UCSR0A] & ~(U2X | MPCM) & ~(value & TXC)) | (value & (U2X | MPCM))
    elif address == UCSR0B:
        write_enables(st, value, cycle)
    elif address == UCSR0C:
        st[UCSR0C] = value
    elif address == UBRR0H:
        st[UBRR0H] = value & 0x0F
    else:
        st[UBRR0L] = value
        st[BAUD_ORIGIN] = cycle
    if not st[RX_ACTIVE]:
        plan_receiver(st)


@inner
def write_enables(st: State, value: int, cycle: int) -> None:
    """Write UCSR0B: switch receiver and transmitter, and with them the pins."""
    changed = st[UCSR0B] ^ value
    st[UCSR0B] = (st[UCSR0B] & RXB8) | (value & ~RXB8)
    if changed & RXEN:
        st[RX_COUNT] = 0  # switching the receiver off empties its buffer (datasheet, 20.7.6)
        st[RX_WAITING] = 0
        st[RX_OVERRUN] = 0
        st[RX_ACTIVE] = 0
        st[RX_READY] = cycle
        update_receive_flags(st)
        if value & RXEN:
            st[FORCE_IN + PORT_D] |= RXD
        else:
            st[FORCE_IN + PORT_D] &= ~RXD
        refresh_port(st, PORT_D, cycle)
    if changed & TXEN:
        if value & TXEN:
            st[FORCE_OUT + PORT_D] |= TXD
            set_override(st, TXD_PIN, True, True, cycle)
        elif not st[TX_BUSY]:
            release_transmit_pin(st, cycle)
