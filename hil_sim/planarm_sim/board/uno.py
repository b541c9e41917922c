"""An Arduino Uno: an ATmega328P at 16 MHz with named pins and a serial line.

Time is the chip's: clock cycles of 62.5 ns since power-up. It passes in `run` and `run_until` only, so that a test
says exactly when what happens, and two runs with the same calls are the same to the last edge.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import NDArray

from planarm_sim.board.edge_log import EdgeLog, EdgeLogState
from planarm_sim.board.inputs import AnalogInput, Pin
from planarm_sim.board.pins import pin_place
from planarm_sim.board.serial import CLOCK_HZ, FRAME_BITS, SerialPort, SerialState, Usb
from planarm_sim.board.watched import WatchedBoard
from planarm_sim.cpu.chip import Chip, ResetCause, Snapshot, StopCause
from planarm_sim.cpu.layout import NEVER
from planarm_sim.errors import LimitError, PinError, StoppedError, UsageError
from planarm_sim.loader import Image, join_bootloader, load_elf, load_hex, load_image
from planarm_sim.peripherals.adc import AREF
from planarm_wire import messages

if TYPE_CHECKING:
    from planarm_sim.insight import Observer

__all__ = ["CLOCK_HZ", "Pin", "Uno", "UnoSnapshot"]

DEFAULT_BAUD = messages.BAUD


@dataclass(frozen=True, slots=True)
class UnoSnapshot:
    """Everything that decides the further run, recorded edges and serial bytes included; opaque."""

    chip: Snapshot
    serial: SerialState
    edges: EdgeLogState


class Uno(WatchedBoard):
    """The board with a program in its flash, at power-up.

    Args:
        image: the program.
        baud: the host's rate on the serial line; see `serial`.
        usb: "direct": bytes reach the host when their stop bit has passed; "16u2": by way of the board's USB bridge,
            with its delays and limits (see `board.usb_bridge`).
        bootloader: what is in the boot section, and where resets lead then (fuses as its size asks; BOOTRST). It may
            stand alone: None as `image` is a board to which nothing was uploaded yet.

    Attributes:
        serial: the host's end of the serial line.
    """

    def __init__(
        self,
        image: Image | None,
        *,
        baud: int = DEFAULT_BAUD,
        usb: Usb = "direct",
        bootloader: Image | None = None,
    ) -> None:
        if bootloader is not None:
            boot = join_bootloader(image, bootloader)
            image = boot.image
            self._chip = Chip(image.flash, boot_words=boot.section_bytes // 2, boot_reset=True)
        elif image is not None:
            self._chip = Chip(image.flash)
        else:
            raise UsageError("a board with neither program nor boot loader does nothing; give one of them")
        self._source = image.source
        self._symbols = image.symbols
        self._observer: Observer | None = None
        self.serial = SerialPort(self._chip, baud, usb)
        self._edges = EdgeLog(self._chip)

    @classmethod
    def from_hex(
        cls,
        path: str | Path,
        *,
        baud: int = DEFAULT_BAUD,
        usb: Usb = "direct",
        bootloader: str | Path | None = None,
    ) -> Self:
        """Power up with the program of an Intel HEX file, and a boot loader (either kind of file) if one is given.

        Raises:
            ImageError: the file cannot be loaded.
        """
        return cls(load_hex(path), baud=baud, usb=usb, bootloader=_load_optional(bootloader))

    @classmethod
    def from_elf(
        cls,
        path: str | Path,
        *,
        baud: int = DEFAULT_BAUD,
        usb: Usb = "direct",
        bootloader: str | Path | None = None,
    ) -> Self:
        """Power up with the program of an ELF executable, as avr-gcc links it.

        Raises:
            ImageError: the file cannot be loaded.
        """
        return cls(load_elf(path), baud=baud, usb=usb, bootloader=_load_optional(bootloader))

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        *,
        baud: int = DEFAULT_BAUD,
        usb: Usb = "direct",
        bootloader: str | Path | None = None,
    ) -> Self:
        """Power up with the program of a file of either kind.

        Raises:
            ImageError: the file cannot be loaded.
        """
        return cls(load_image(path), baud=baud, usb=usb, bootloader=_load_optional(bootloader))

    @classmethod
    def from_bootloader(cls, path: str | Path, *, baud: int = DEFAULT_BAUD, usb: Usb = "direct") -> Self:
        """Power up with a boot loader in an otherwise empty flash.

        Raises:
            ImageError: the file cannot be loaded, or no boot section holds it.
        """
        return cls(None, baud=baud, usb=usb, bootloader=load_image(path))

    @property
    def cycle(self) -> int:
        """Clock cycles of 62.5 ns since power-up; a reset does not set them back."""
        return self._chip.cycle

    @property
    def time_s(self) -> float:
        """Seconds since power-up."""
        return self._chip.cycle / CLOCK_HZ

    @property
    def flash(self) -> bytes:
        """The whole program memory as it is now."""
        return self._chip.flash.tobytes()

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each register of a part that is not modelled which the program touched."""
        return tuple(
            f"{touch.register} (0x{touch.address:02X}) belongs to a part that is not modelled; "
            f"the program touched it first at 0x{2 * touch.pc:04X}"
            for touch in self._chip.unmodelled()
        )

    def run(self, *, cycles: int | None = None, seconds: float | None = None) -> None:
        """Let time pass, by a number of cycles or of seconds; the last instruction is finished.

        Raises:
            UsageError: not exactly one of the two, or negative.
            StoppedError: the program came to an end before: undefined opcode, BREAK, asleep for ever.
        """
        if (cycles is None) == (seconds is None):
            raise UsageError("run takes either cycles or seconds")
        asked = seconds * CLOCK_HZ if seconds is not None else cycles or 0
        if not 0 <= asked < NEVER:
            raise UsageError(f"run was asked for {asked} cycles; time runs forward only, and comes to an end")
        length = round(asked)
        self._run_to(self._chip.cycle + length)

    def run_to_reply(self, *, cycles: int, quiet_cycles: int) -> bool:
        """Let time pass until the board has sent something and been quiet since, but no more than so many cycles.

        Args:
            cycles: the longest time to wait.
            quiet_cycles: how long no stop bit has ended on the line, 1 or more.

        Returns:
            Whether something was sent. A USB bridge may still hold it back; see `serial`.

        Raises:
            UsageError: a number out of its range.
            StoppedError: the program came to an end before.
        """
        if cycles < 0 or quiet_cycles < 1:
            raise UsageError(f"run_to_reply was asked for {cycles} cycles, quiet for {quiet_cycles}; 0 and 1 or more")
        return self._run_to(self._chip.cycle + cycles, tx_quiet=quiet_cycles)

    def run_until(
        self, awaited: bytes | Callable[[Uno], bool], *, limit_s: float, every_cycles: int | None = None
    ) -> None:
        """Let time pass until the board has sent certain bytes, or until a condition holds.

        Args:
            awaited: bytes that must turn up among those not yet read (they stay there), or a function of the
                board that tells whether to stop.
            limit_s: longest time to wait, seconds.
            every_cycles: how often to look; None means the time of one byte on the serial line.

        Raises:
            LimitError: it did not come in time.
            StoppedError: the program came to an end before.
        """
        step = every_cycles or FRAME_BITS * CLOCK_HZ // self.serial.baud
        end = self._chip.cycle + round(limit_s * CLOCK_HZ)
        while not (awaited in self.serial.peek() if isinstance(awaited, bytes) else awaited(self)):
            if self._chip.cycle >= end:
                what = repr(awaited) if isinstance(awaited, bytes) else getattr(awaited, "__name__", "the condition")
                raise LimitError(
                    f"{self._source}: waited {limit_s} s for {what}, until {self.time_s:.6f} s; "
                    f"not yet read from the board: {self.serial.peek()!r}",
                    self._chip.cycle,
                )
            self._run_to(min(self._chip.cycle + step, end))

    def reset(self, cause: ResetCause = ResetCause.EXTERNAL) -> None:
        """Press the reset button: an external reset, now. SRAM and the bytes on the serial line stay.

        It is what a host does to a real Uno by DTR when it opens the port; a boot loader starts. MCUSR tells the
        program of another `cause`.
        """
        self._chip.reset(cause)
        self._collect()

    def pin(self, name: str) -> Pin:
        """A pin by its name on the board: "D0" to "D13", "A0" to "A5".

        Raises:
            PinError: the board has no such pin; the message names the closest.
        """
        return Pin(self._chip, pin_place(name))

    def analog(self, name: str) -> AnalogInput:
        """An analogue input by its name on the board: "A0" to "A5", or the reference "AREF".

        Raises:
            PinError: the board has no such input.
        """
        if name == "AREF":
            return AnalogInput(self._chip, AREF)
        place = pin_place(name)
        if place.port != "C":
            raise PinError(f"pin {name} has no analogue input; A0 to A5 and AREF have")
        return AnalogInput(self._chip, place.bit)

    def edges(self, name: str) -> NDArray[Any]:
        """Level changes that the program made on a pin since power-up, or since `clear_edges`.

        Returns:
            Structured array in order of time, fields cycle (int64) and level (uint8).

        Raises:
            PinError: the board has no such pin.
        """
        return self._edges.of(name)

    def clear_edges(self) -> None:
        """Forget the level changes recorded so far, of all pins."""
        self._edges.clear()

    def take_edges(self) -> NDArray[Any]:
        """Return the level changes of all pins recorded so far and forget them; for runs without end.

        Returns:
            Structured array in order of time, fields cycle, pin (chip numbering, see `pins`) and level.
        """
        return self._edges.take()

    def listen(self, listener: Callable[[NDArray[Any]], None]) -> None:
        """Hand every further edge, after each run, to a function as well; see `take_edges` for their form."""
        self._edges.listeners.append(listener)

    def write_vcd(self, path: str | Path, names: Sequence[str]) -> None:
        """Write the recorded level changes of some pins as a waveform file.

        Of a program that is watched (`observe`), the line `isr` holds the number of the interrupt that runs, else 0.

        Raises:
            PinError: the board has no such pin.
            TraceError: the file cannot be written.
        """
        self._edges.write_vcd(path, names, self._interrupt_changes() if self.is_observed else None)

    def snapshot(self) -> UnoSnapshot:
        """Copy everything that decides the further run."""
        return UnoSnapshot(self._chip.snapshot(), self.serial.snapshot(), self._edges.snapshot())

    def restore(self, snapshot: UnoSnapshot) -> None:
        """Go back to a snapshot of this board; with the same calls the same run follows."""
        self._chip.restore(snapshot.chip)
        self.serial.restore(snapshot.serial)
        self._edges.restore(snapshot.edges)
        if self._observer is not None:
            self._observer.begin(self.cycle)
            self._chip.watch(self._observer)

    def fork(self, count: int) -> tuple[Self, ...]:
        """Make `count` boards that go on from here, each on its own; this one stays as it is.

        Recorded edges and bytes come along; what is driven from outside stays driven. Forks are not watched.

        Raises:
            UsageError: a negative count.
        """
        if count < 0:
            raise UsageError(f"a board cannot be forked into {count}")
        return tuple(self._twin() for _ in range(count))

    def _twin(self) -> Self:
        twin = copy.copy(self)
        twin._chip, twin._observer = self._chip.fork(), None
        twin._edges = EdgeLog(twin._chip)
        twin._edges.restore(self._edges.snapshot())
        twin.serial = SerialPort(twin._chip, self.serial.baud, "direct" if self.serial.bridge is None else "16u2")
        twin.serial.restore(self.serial.snapshot())
        return twin

    def _run_to(self, target: int, *, tx_quiet: int = 0) -> bool:
        """Run as `Chip.run_to` does; tell whether the board has sent something."""
        cause = self._chip.run_to(target, tx_quiet=tx_quiet)
        sent = self._collect()
        if cause is not StopCause.REACHED:
            raise StoppedError(
                f"{self._source}: the program ended at cycle {self.cycle} ({self.time_s:.6f} s): {cause.value}",
                self.cycle,
                cause.name,
            )
        return sent


def _load_optional(path: str | Path | None) -> Image | None:
    return None if path is None else load_image(path)
