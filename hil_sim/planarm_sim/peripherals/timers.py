"""Timers 0, 1 and 2: one design, three blocks of state.

ATmega328P datasheet, chapters 15, 16 and 18. A timer is worked out when somebody looks at it, or when
something that can be seen from outside (an enabled interrupt, a connected pin) is due. In between the counter
runs in straight legs to TOP, MAX or BOTTOM; everything happens on the timer clock that *leaves* a value: OCFnx
and the pin one timer clock after TCNT = OCRnx (figures 15-10, 15-11, 16-10), TOV and the reload likewise.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    AT_BOTTOM,
    AT_MAX,
    AT_ONCE,
    AT_TOP,
    BROKEN,
    F_BLOCKED,
    F_BUFFER_A,
    F_COM_A,
    F_COM_B,
    F_COUNT,
    F_DOWN,
    F_DUE,
    F_HELD,
    F_ICR,
    F_LATCH_A,
    F_LOAD_AT,
    F_MAX,
    F_OCR_A,
    F_OCR_B,
    F_OVERFLOW_AT,
    F_PIN_A,
    F_PRESCALER,
    F_SHIFT,
    F_SLOPE,
    F_SYNC,
    F_TIFR,
    F_TIMSK,
    F_TOP_FIXED,
    F_TOP_SOURCE,
    F_TRIGGERS,
    HORIZON,
    NEVER,
    OVERRIDE,
    RESET_REQUEST,
    SLOPE_COUNT,
    SLOPE_DUAL,
    SLOPE_FAST,
    TOP_FIXED,
    TOP_ICR,
    TOP_OCR_A,
    State,
)
from planarm_sim.peripherals.adc import trigger
from planarm_sim.peripherals.ports import set_override

TOV, OCF_A, OCF_B, ICF = 1 << 0, 1 << 1, 1 << 2, 1 << 5  # bits of TIFRn, and of TIMSKn
COM_TOGGLE, COM_CLEAR, COM_SET = 1, 2, 3


@inlined
def timer_top(st: State, t: int) -> int:
    """TOP of the timer at block `t`."""
    source = st[t + F_TOP_SOURCE]
    if source == TOP_OCR_A:
        return int(st[t + F_OCR_A])
    if source == TOP_ICR:
        return int(st[t + F_ICR])
    return int(st[t + F_TOP_FIXED])


@inlined
def clock_phase(st: State, t: int) -> int:
    """Number of the last timer clock up to F_SYNC, counted from the reset of the prescaler."""
    return int((st[t + F_SYNC] - st[st[t + F_PRESCALER]]) >> st[t + F_SHIFT])


@inlined
def clock_runs(st: State, t: int) -> bool:
    """Tell whether the timer counts by itself (not stopped, not on a pin, prescaler not held in reset)."""
    shift = st[t + F_SHIFT]
    return bool(shift == 0 or (shift > 0 and st[st[t + F_HELD]] == 0))


@inlined
def clocks_to_event(st: State, t: int, matches: int) -> int:
    """Timer clocks until the one that leaves the end of this leg, or earlier OCRnA/B when in `matches`."""
    count = st[t + F_COUNT]
    if st[t + F_BLOCKED]:
        return 1
    ocr_a = st[t + F_OCR_A]
    ocr_b = st[t + F_OCR_B]
    if st[t + F_DOWN]:
        clocks = count + 1
        if matches & OCF_A and ocr_a <= count:
            clocks = min(clocks, count - ocr_a + 1)
        if matches & OCF_B and ocr_b <= count:
            clocks = min(clocks, count - ocr_b + 1)
        return int(clocks)
    top = timer_top(st, t)
    end = top if count <= top else st[t + F_MAX]
    clocks = end - count + 1
    if matches & OCF_A and ocr_a >= count:
        clocks = min(clocks, ocr_a - count + 1)
    if matches & OCF_B and ocr_b >= count:
        clocks = min(clocks, ocr_b - count + 1)
    return int(clocks)


@inner
def advance_timer(st: State, t: int, cycle: int) -> None:
    """Work the timer out up to and including the timer clock at `cycle`."""
    if not clock_runs(st, t):
        st[t + F_SYNC] = cycle
        return
    shift = st[t + F_SHIFT]
    origin = st[st[t + F_PRESCALER]]
    done = clock_phase(st, t)
    last = (cycle - origin) >> shift
    while done < last:
        clocks = clocks_to_event(st, t, OCF_A | OCF_B)
        if clocks < 1:  # the counter is beyond its range: no write and no clock brings it there
            st[RESET_REQUEST] |= BROKEN
            done = last
        elif clocks > last - done:
            move = last - done
            st[t + F_COUNT] += -move if st[t + F_DOWN] else move
            done = last
        else:
            st[t + F_COUNT] += 1 - clocks if st[t + F_DOWN] else clocks - 1
            done += clocks
            clock_timer(st, t, origin + (done << shift))
    st[t + F_SYNC] = max(st[t + F_SYNC], origin + (last << shift))


@inner
def clock_timer(st: State, t: int, cycle: int) -> None:
    """One timer clock at `cycle`: leave the present count, with all that follows from it."""
    count = st[t + F_COUNT]
    blocked = st[t + F_BLOCKED]
    slope = st[t + F_SLOPE]
    top = timer_top(st, t)
    is_top = count == top and not (blocked and st[t + F_TOP_SOURCE] != TOP_FIXED)
    is_bottom = slope == SLOPE_DUAL and count == 0 and st[t + F_DOWN] == 1
    matched = 0
    if not blocked:
        matched = (OCF_A if count == st[t + F_OCR_A] else 0) | (OCF_B if count == st[t + F_OCR_B] else 0)
    st[t + F_BLOCKED] = 0

    wraps = step_count(st, t, count, is_top)
    flags = matched
    overflow_at = st[t + F_OVERFLOW_AT]
    if (
        (overflow_at == AT_TOP and is_top)
        or (overflow_at == AT_MAX and wraps and count == st[t + F_MAX])
        or (overflow_at == AT_BOTTOM and is_bottom)
    ):
        flags |= TOV
    if is_top and st[t + F_TOP_SOURCE] == TOP_ICR:
        flags |= ICF
    if flags & st[t + F_TRIGGERS] & ~st[st[t + F_TIFR]]:
        trigger(st, cycle)
    st[st[t + F_TIFR]] |= flags

    load_at = st[t + F_LOAD_AT]
    if (load_at == AT_TOP and is_top) or (load_at == AT_BOTTOM and (is_bottom or (wraps and slope == SLOPE_FAST))):
        st[t + F_OCR_A] = st[t + F_BUFFER_A]
        st[t + F_OCR_B] = st[t + F_BUFFER_A + 1]
    for channel in range(2):
        if st[t + F_COM_A + channel]:
            drive_output(st, t, channel, matched & (OCF_A << channel), wraps, is_top, is_bottom, cycle)


@inlined
def step_count(st: State, t: int, count: int, is_top: bool) -> bool:
    """Move the counter by one timer clock; tell whether it wrapped to 0."""
    if st[t + F_SLOPE] == SLOPE_DUAL:
        if is_top:
            st[t + F_DOWN] = 1
            st[t + F_COUNT] = max(count - 1, 0)
            return False
        if st[t + F_DOWN]:
            if count > 0:
                st[t + F_COUNT] = count - 1
                return False
            st[t + F_DOWN] = 0
    if is_top or count == st[t + F_MAX]:
        st[t + F_COUNT] = 0
        return True
    st[t + F_COUNT] = count + 1
    return False


@inner
def drive_output(
    st: State, t: int, channel: int, matched: int, wraps: bool, is_top: bool, is_bottom: bool, cycle: int
) -> None:
    """Change OCnx on a timer clock, as COMnx1:0 and the mode say (datasheet, tables 15-2 to 15-7 and 16-1 to 16-3).

    In dual-slope modes the level at the turning points is that of the match that lies on their side, whether
    it took place or not (15.7.4: symmetry around BOTTOM, OCRnx changed at TOP, counter started above OCRnx).
    """
    com = st[t + F_COM_A + channel]
    slope = st[t + F_SLOPE]
    action = com if matched else 0
    if com != COM_TOGGLE:
        if slope == SLOPE_FAST and wraps:
            action = COM_SET + COM_CLEAR - com
        elif slope == SLOPE_DUAL:
            down = st[t + F_DOWN] == 1
            compare = st[t + F_OCR_A + channel]
            if is_top:
                down = compare >= timer_top(st, t)
                action = com
            elif is_bottom:
                down = compare > 0
                action = com
            if action and down:
                action = COM_SET + COM_CLEAR - com
    if action:
        latch_output(st, t, channel, action, cycle)


@inner
def latch_output(st: State, t: int, channel: int, action: int, cycle: int) -> None:
    """Toggle, clear or set OCnx, and with it the pin."""
    before = st[t + F_LATCH_A + channel]
    after = 1 - before if action == COM_TOGGLE else action - COM_CLEAR
    if after != before:
        st[t + F_LATCH_A + channel] = after
        set_override(st, st[t + F_PIN_A + channel], True, after != 0, cycle)


@inner
def plan_timer(st: State, t: int) -> None:
    """Note when the CPU loop has to look at this timer next."""
    watched = st[st[t + F_TIMSK]] | st[t + F_TRIGGERS]
    if st[t + F_COM_A]:
        watched |= OCF_A
    if st[t + F_COM_B]:
        watched |= OCF_B
    due = NEVER
    if watched != 0 and clock_runs(st, t):
        clocks = clocks_to_event(st, t, watched)
        due = st[st[t + F_PRESCALER]] + ((clock_phase(st, t) + clocks) << st[t + F_SHIFT])
        st[HORIZON] = min(st[HORIZON], due)
    st[st[t + F_DUE]] = due


@inner
def set_outputs(st: State, t: int, com_a: int, com_b: int, cycle: int) -> None:
    """Take new effective COM values: connect or disconnect the two pins."""
    st[t + F_COM_A] = com_a
    st[t + F_COM_B] = com_b
    for channel in range(2):
        pin = st[t + F_PIN_A + channel]
        connected = st[t + F_COM_A + channel] != 0
        if connected != ((st[OVERRIDE + (pin >> 3)] >> (pin & 7)) & 1 != 0):
            set_override(st, pin, connected, st[t + F_LATCH_A + channel] != 0, cycle)


@kernel
def set_mode(st: State, t: int, slope: int, top_source: int, top_fixed: int, load_at: int, overflow_at: int) -> None:
    """Take a new waveform generation mode."""
    st[t + F_SLOPE] = slope
    st[t + F_TOP_SOURCE] = top_source
    st[t + F_TOP_FIXED] = top_fixed
    st[t + F_LOAD_AT] = load_at
    st[t + F_OVERFLOW_AT] = overflow_at
    if slope != SLOPE_DUAL:
        st[t + F_DOWN] = 0
    if load_at == AT_ONCE:
        st[t + F_OCR_A] = st[t + F_BUFFER_A]
        st[t + F_OCR_B] = st[t + F_BUFFER_A + 1]


@inner
def effective_com(com: int, slope: int, toggles: bool) -> int:
    """COMnx1:0 as it acts: in PWM modes 1 toggles only where the mode allows it, else the pin is not connected."""
    if com == COM_TOGGLE and slope != SLOPE_COUNT and not toggles:
        return 0
    return com


@inner
def write_count(st: State, t: int, value: int) -> None:
    """Write TCNTn: the match at the next timer clock is blocked (datasheet, 15.6.2)."""
    st[t + F_COUNT] = value
    st[t + F_BLOCKED] = 1


@inlined
def write_compare(st: State, t: int, channel: int, value: int) -> None:
    """Write OCRnx, at once or into its buffer."""
    st[t + F_BUFFER_A + channel] = value
    if st[t + F_LOAD_AT] == AT_ONCE:
        st[t + F_OCR_A + channel] = value


@inner
def force_compare(st: State, t: int, channels: int, cycle: int) -> None:
    """FOCnA (bit 7) and FOCnB (bit 6): act on the pins as a match would, in modes that are no PWM."""
    if st[t + F_SLOPE] != SLOPE_COUNT:
        return
    for channel in range(2):
        com = st[t + F_COM_A + channel]
        if channels & (0x80 >> channel) and com:
            latch_output(st, t, channel, com, cycle)
