"""The ATmega328P as one object: arrays in, compiled kernel, logs out.

`Chip` is the whole interface between the chip and the board around it. Time is counted in clock cycles since
power-up and never goes back, not even over a reset. A chip starts with its first instruction at cycle 0: the
start-up delay that the fuses select is not part of the count.
"""

from __future__ import annotations

import copy
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu import queues, service
from planarm_sim.cpu import registers as reg
from planarm_sim.cpu.decode import FLASH_BYTES
from planarm_sim.cpu.dispatch import run
from planarm_sim.cpu.interrupts import note_raised
from planarm_sim.cpu.logs import Logs
from planarm_sim.cpu.program import Program
from planarm_sim.cpu.service import stand_still
from planarm_sim.cpu.values import (
    EDGE_DTYPE,
    TX_DTYPE,
    FirstTouch,
    Parity,
    ResetCause,
    Snapshot,
    StopCause,
    Watcher,
)
from planarm_sim.cpu.views import ChipViews
from planarm_sim.errors import DefectError, ImageError, PinError, UsageError
from planarm_sim.peripherals.adc import NOT_DRIVEN, SUPPLY_UV
from planarm_sim.peripherals.ports import drive_from_outside, refresh_port
from planarm_sim.peripherals.self_programming import RWWSB, erase_buffer, execute_spm
from planarm_sim.peripherals.timer_registers import power_up_timers
from planarm_sim.peripherals.usart import RXEN, UDRE, plan_receiver
from planarm_sim.peripherals.watchdog import WDE, plan_watchdog

__all__ = [
    "BOOT_WORDS",
    "EDGE_DTYPE",
    "PINS",
    "SRAM_BYTES",
    "TX_DTYPE",
    "Chip",
    "FirstTouch",
    "Parity",
    "ResetCause",
    "Snapshot",
    "StopCause",
    "Watcher",
]

PINS: Final = 24
SRAM_BYTES: Final = reg.SRAM_END - reg.SRAM_START
BOOT_WORDS: Final = (256, 512, 1024, 2048)
"""Sizes of the boot section that the fuses BOOTSZ choose from (datasheet, table 27-13)."""
_FLASH_WORDS = FLASH_BYTES // 2
_STOPS = {
    service.REACHED: StopCause.REACHED,
    service.AT_BREAK: StopCause.BREAK,
    service.AT_BAD_OPCODE: StopCause.BAD_OPCODE,
    service.ASLEEP_FOR_EVER: StopCause.ASLEEP,
    service.TRAPPED: StopCause.BREAKPOINT,
}


class Chip(ChipViews):
    """ATmega328P. Pins are numbered port * 8 + bit with B = 0, C = 1, D = 2 (PB1 is 1, PD1 is 17)."""

    def __init__(self, flash: bytes, *, boot_words: int = BOOT_WORDS[0], boot_reset: bool = False) -> None:
        """Load a program image of up to 32 KiB and power up; the rest of the flash is erased (0xFF).

        Args:
            flash: the image, from address 0 on.
            boot_words: size of the boot section at the end of the flash (fuses BOOTSZ), one of BOOT_WORDS.
            boot_reset: every reset leads to the boot section (fuse BOOTRST programmed); erased words then run as
                `Program.erased_runs` tells.

        Raises:
            ImageError: the image is larger than the flash.
            UsageError: the fuses know no such boot section.
        """
        if boot_words not in BOOT_WORDS:
            raise UsageError(f"a boot section of {boot_words} words: the fuses BOOTSZ choose from {BOOT_WORDS}")
        if len(flash) > FLASH_BYTES:
            raise ImageError(f"the program has {len(flash)} bytes, the ATmega328P's flash {FLASH_BYTES}")
        whole = np.full(FLASH_BYTES, 0xFF, dtype=np.uint8)
        whole[: len(flash)] = np.frombuffer(flash, dtype=np.uint8)
        self._program = self._seen = Program.of(whole, erased_runs=boot_reset)  # _seen: by the CPU, now
        self._memory = np.full(SRAM_BYTES + reg.EEPROM_BYTES, 0xFF, dtype=np.uint8)
        self._words = self._memory.view(np.int64)
        self._sram, self._eeprom = self._memory[:SRAM_BYTES], self._memory[SRAM_BYTES:]
        state = np.zeros(at.QUEUES, dtype=np.int64)
        state[at.BOOT_START] = _FLASH_WORDS - boot_words
        state[at.BOOT_RESET] = boot_reset
        state[at.ADC_INPUT : at.ADC_INPUT + at.ADC_INPUTS] = NOT_DRIVEN
        nothing = np.empty(0, dtype=np.int64)
        self._state = queues.allocate(state, (nothing,) * len(queues.ALL))
        self._logs = Logs()
        self._watcher: Watcher | None = None
        self.reset(ResetCause.POWER_ON)

    # --- Time ----------------------------------------------------------------------------------------------

    @property
    def cycle(self) -> int:
        """Clock cycles since power-up."""
        return int(self._state[at.CYCLE])

    @property
    def passed_over(self) -> int:
        """Cycles of waiting that were not executed one by one (see `idle`), since this object was made."""
        return int(self._state[at.PASSED_OVER])

    def run_to(self, cycle: int, *, tx_quiet: int = 0) -> StopCause:
        """Run whole instructions until `self.cycle >= cycle`, or until the program stops earlier.

        After BREAK a further call goes on behind it; at an undefined opcode it stops again, with `pc` on it.

        Args:
            cycle: where to stop.
            tx_quiet: stop as well (REACHED) once a frame was sent and none has ended for so many cycles; 0: do not.
        """
        self._state[at.TX_QUIET], self._state[at.STOP_AT] = tx_quiet, at.NEVER
        while True:
            stop = self._see_to(self._advance(cycle))
            if stop is not None:
                return stop

    def _see_to(self, cause: int) -> StopCause | None:
        """Do what one of `service`'s stops asks for; None when the run goes on."""
        if cause in _STOPS:
            return _STOPS[cause]
        if cause == service.LOG_FULL:
            self._logs.set_aside(self._state)
        elif cause == service.RESET_WANTED:
            self._reset_as_asked()
        else:
            self._program = execute_spm(self._state, self._program)
            self._look_at_flash()
        return None

    def _reset_as_asked(self) -> None:
        request = int(self._state[at.RESET_REQUEST])
        if request & at.BROKEN:
            raise DefectError(
                f"the chip's state contradicts itself at cycle {self.cycle}, pc 0x{2 * self.pc:04X}: a defect, or "
                "compiled code of two versions of planarm_sim mixed; empty the folder that PLANARM_CACHE_DIR names "
                "(or the user's cache folder of planarm), and report it if it comes again"
            )
        self.reset(ResetCause(request))

    def _advance(self, target: int) -> int:
        """Run, first without the CPU while it stands still; returns one of `service`'s stops."""
        halted_until = int(self._state[at.SPM_HALT_UNTIL])
        if halted_until > self.cycle:
            cause = int(stand_still(self._state, self._memory, min(halted_until, target)))
            if cause != service.REACHED or self.cycle >= target:
                return cause
        if self._watcher is not None:
            return self._watcher.advance(self._state, self._memory, self._words, self._seen, target)
        return int(run(self._state, self._memory, self._words, self._seen.fused, self._seen.flash, target))

    def watch(self, watcher: Watcher | None) -> None:
        """Have the chip run by `watcher`, or as usual again. Interrupts already pending count as raised now."""
        self._watcher = watcher
        self._state[at.WATCH] = watcher is not None
        note_raised(self._state, 0, self.cycle)

    def _look_at_flash(self) -> None:
        """Let the CPU see the flash as it is now, without the RWW section while that is blocked."""
        blocked = self._state[reg.SPMCSR] & RWWSB
        self._seen = self._program.rww_blocked() if blocked else self._program

    def reset(self, cause: ResetCause = ResetCause.POWER_ON) -> None:
        """Reset the chip now. SRAM keeps its contents except at power-on; queued serial input stays queued.

        What drives pins from outside goes on driving them, edges of pins that the reset lets go of are logged.
        """
        old = self._state
        now = int(old[at.CYCLE])
        causes = 0 if cause == ResetCause.POWER_ON else int(old[reg.MCUSR])
        st = np.zeros_like(old)
        st[at.CONSTANTS :] = old[at.CONSTANTS :]
        kept = [at.CYCLE, *range(at.TX_COUNT, at.IN_TAIL + 1), at.BOOT_START, at.BOOT_RESET, at.WATCH]
        kept += [at.OUTSIDE_ADDRESS, at.OUTSIDE_PC, *range(at.LEVEL, at.PIPE), *range(at.TOUCHED, at.TOUCHED + 256)]
        kept += range(at.ADC_INPUT, at.ADC_INPUT + at.ADC_INPUTS)
        st[kept] = old[kept]
        st[at.OVERRIDE : at.EXTERNAL] = 0
        st[at.DUE : at.DUE + at.DUE_SOURCES] = at.NEVER
        st[at.DUE_INPUT] = old[at.DUE_INPUT] if st[at.IN_HEAD] < st[at.IN_TAIL] else at.NEVER
        st[at.SP] = reg.SRAM_END - 1
        st[at.PC] = st[at.BOOT_START] if st[at.BOOT_RESET] else 0
        st[reg.MCUSR] = causes | int(cause)
        st[reg.UCSR0A] = UDRE
        st[reg.UCSR0C] = 0x06
        st[[at.PRESCALER_01, at.PRESCALER_2, at.BAUD_ORIGIN, at.RX_READY, at.WDT_ORIGIN]] = now
        self._state = st
        power_up_timers(st)
        erase_buffer(st)
        self._look_at_flash()
        if cause == ResetCause.POWER_ON:
            self._sram[:] = 0
        if st[reg.MCUSR] & ResetCause.WATCHDOG:
            st[reg.WDTCSR] = WDE
            plan_watchdog(st, now)
        for port in range(3):
            refresh_port(st, port, now)
        if self._watcher is not None:
            self._watcher.restart(now)

    # --- Serial line -----------------------------------------------------------------------------------------

    def push_rx(
        self,
        start_cycle: int,
        bit_cycles: float,
        byte: int,
        *,
        data_bits: int = 8,
        parity: Parity = Parity.NONE,
        stop_level: int = 1,
    ) -> None:
        """Queue a serial frame whose start bit falls on RXD at `start_cycle`.

        Args:
            start_cycle: not before now and not before the start of the last queued frame.
            bit_cycles: cycles per bit of the far end's own clock.
            byte: the character, least significant bit first on the line.
            data_bits: 5 to 9.
            parity: of the far end's frame.
            stop_level: 0 makes a broken frame.

        Raises:
            UsageError: the start lies in the past, or a value is out of its range.
        """
        if not 5 <= data_bits <= 9 or not 0 <= byte < 1 << data_bits or not bit_cycles >= 1:
            raise UsageError(
                f"no serial frame: character {byte} in {data_bits} bits (5 to 9) "
                f"at {bit_cycles} cycles per bit (1 or more)"
            )
        st = self._state
        tail = int(st[at.RX_TAIL])
        earliest = self.cycle
        if tail > st[at.RX_HEAD]:
            earliest = max(earliest, int(st[st[at.RX_BASE] + (tail - 1) * at.RX_WIDTH]) + 1)
        if start_cycle < earliest:
            raise UsageError(f"a serial frame cannot start at cycle {start_cycle}: the earliest is {earliest}")
        bits = byte << 1
        count = data_bits + 1
        if parity is not Parity.NONE:
            bits |= (byte.bit_count() + (parity is Parity.ODD)) % 2 << count
            count += 1
        bits |= stop_level << count
        entry = (start_cycle, round(bit_cycles * (1 << at.BIT_FRACTION)), bits, count + 1)
        self._state = st = queues.append(st, queues.RX, entry)
        if st[reg.UCSR0B] & RXEN and not st[at.RX_ACTIVE] and st[at.DUE_RX] == at.NEVER:
            plan_receiver(st)

    def drain_tx(self) -> NDArray[Any]:
        """Return and forget the frames that ended on TXD, TX_DTYPE in order of time."""
        return self._logs.take_frames(self._state)

    # --- Pins ------------------------------------------------------------------------------------------------

    def drain_edges(self) -> NDArray[Any]:
        """Return and forget every edge of an output pin, EDGE_DTYPE in order of time.

        The bits of a frame on TXD are not among them; `drain_tx` tells them all by cycle and bit time.
        """
        return self._logs.take_edges(self._state)

    def drive_pin(self, pin: int, level: int | None, cycle: int | None = None) -> None:
        """Drive a pin from outside at `cycle` (None: now); `level` None lets go of it.

        Raises:
            PinError: no such pin, or a level other than 0 and 1.
            UsageError: `cycle` lies in the past, or before a drive already queued.
        """
        self._check_pin(pin)
        if level not in (None, 0, 1):
            raise PinError(f"level {level} of pin {pin}: only 0, 1 and None (let go) can be driven")
        kind = 2 if level is None else level
        st = self._state
        queued = int(st[at.IN_TAIL]) > int(st[at.IN_HEAD])
        if cycle is None and not queued:
            drive_from_outside(st, pin, kind, self.cycle)
            return
        moment = self.cycle if cycle is None else cycle
        last = int(st[st[at.IN_BASE] + st[at.IN_TAIL] - 1]) >> 8 if queued else self.cycle
        if moment < last:
            raise UsageError(f"pin {pin} cannot be driven at cycle {moment}: the earliest is {last}")
        self._state = queues.append(st, queues.DRIVES, ((moment << 8) | (pin << 2) | kind,))
        if not queued:
            self._state[at.DUE_INPUT] = moment

    def pin_level(self, pin: int) -> int:
        """Return the electrical level of a pin now, 0 or 1; a floating pin reads 0."""
        self._check_pin(pin)
        return int(self._state[at.LEVEL + (pin >> 3)] >> (pin & 7)) & 1

    def drive_analog(self, channel: int, volts: float | None) -> None:
        """Put a voltage on an ADC channel, 0 to 7, or on AREF (8), from now on; None lets go of it.

        Raises:
            PinError: no such channel, or volts outside the supply's 0 to 5.
        """
        if not 0 <= channel < at.ADC_INPUTS:
            raise PinError(f"ADC channel {channel}: the ATmega328P has 0 to 7, and AREF is 8")
        if volts is not None and not 0 <= volts <= SUPPLY_UV / 1e6:
            raise PinError(f"{volts} V on ADC channel {channel}: inputs take 0 to {SUPPLY_UV / 1e6:g} V")
        self._state[at.ADC_INPUT + channel] = NOT_DRIVEN if volts is None else round(volts * 1e6)

    def analog_volts(self, channel: int) -> float | None:
        """Return the voltage that `drive_analog` put there, None without one."""
        microvolts = int(self._state[at.ADC_INPUT + channel])
        return None if microvolts == NOT_DRIVEN else microvolts / 1e6

    # --- Whole state -------------------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """Copy everything that decides the further run, logs not yet drained included."""
        st = self._state = self._logs.put_back(self._state)
        entries = queues.contents(st) if queues.in_use(st) else ()
        return Snapshot(st[: at.STATE_WORDS].copy(), self._memory.copy(), self._program, entries)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to `snapshot`, of this chip or of another with any program; the same run follows."""
        self._logs.forget()
        self._state = queues.refill(self._state, snapshot.state, snapshot.queues)
        self._memory[:] = snapshot.memory
        self._program = snapshot.program
        self._state[at.WATCH] = self._watcher is not None
        self._look_at_flash()

    def fork(self) -> Chip:
        """Make a chip that goes on from here on its own; nothing watches it."""
        twin = copy.copy(self)
        self._state, twin._logs = self._logs.put_back(self._state), Logs()
        twin._state, twin._memory = self._state.copy(), self._memory.copy()
        twin._words = twin._memory.view(np.int64)
        twin._sram, twin._eeprom = twin._memory[:SRAM_BYTES], twin._memory[SRAM_BYTES:]
        twin.watch(None)
        return twin

    def unmodelled(self) -> tuple[FirstTouch, ...]:
        """Return the registers of parts that are not modelled which the program touched, by address."""
        st = self._state
        touched = np.nonzero(st[at.TOUCHED : at.TOUCHED + 256])[0]
        touches = [
            FirstTouch(int(a), reg.NAMES.get(int(a), f"0x{a:02X}"), int(st[at.TOUCHED + a]) - 1) for a in touched
        ]
        if st[at.OUTSIDE_ADDRESS]:
            outside = int(st[at.OUTSIDE_ADDRESS]) - 1
            touches.append(FirstTouch(outside, f"0x{outside:04X}", int(st[at.OUTSIDE_PC])))
        return tuple(touches)

    def poke_flash(self, address: int, data: bytes) -> None:
        """Replace bytes of the flash, as a programmer does."""
        self._program = self._program.with_bytes(address, data)
        self._look_at_flash()

    def _check_pin(self, pin: int) -> None:
        if not 0 <= pin < PINS:
            raise PinError(f"pin {pin}: the ATmega328P's pins are numbered 0 to {PINS - 1} (port * 8 + bit)")
