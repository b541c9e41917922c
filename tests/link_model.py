"""A model of the device's side of the protocol on a line that can be made bad, in virtual time.

It is written from `protocol/messages.toml` alone: what a frame does, when a reply is sent, what the ledger counts. The
link's tests run against it where they need faults that the released firmware on the emulator cannot be given.
"""

import contextlib
import heapq
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import count

from planarm.errors import LinkError
from planarm_wire.boards import Board
from planarm_wire.codec import decode, encode, encoded_bytes
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    BOARDS,
    HOLD_CODE,
    JOINTS,
    PROTOCOL_VERSION,
    QUEUE_BYTES,
    QUEUE_FRAME_BYTES,
    RX_RING_BYTES,
    SPEC_HASH,
    TICKS_HZ,
    Clear,
    Config,
    Enable,
    Fault,
    Hello,
    Ledger,
    Move,
    Override,
    Query,
    Reset,
    Result,
    Resume,
    Segment,
    Segments,
    SoftLimits,
    Start,
    State,
    Status,
    Stop,
    Welcome,
)
from planarm_wire.steps import direction, duration_ticks, is_last, step_ticks

BYTE_S = 10 / 250_000
USB_FLUSH_S = 65_536 / 16_000_000  # the USB bridge hands replies to the computer when its timer 0 overflows


class Events:
    """Virtual time: what happens when, in order."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._heap: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()

    def at(self, t_s: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._heap, (max(t_s, self.now_s), next(self._order), action))

    def run_next(self, until_s: float) -> bool:
        """Carry out the next event, if it comes by `until_s`; else let the time be `until_s`."""
        if not self._heap or self._heap[0][0] > until_s:
            self.now_s = max(self.now_s, until_s)
            return False
        self.now_s, _, action = heapq.heappop(self._heap)
        action()
        return True


@dataclass
class Damage:
    """What the line does to single bytes, as probabilities, and for how long it holds bytes back."""

    drop: float = 0.0
    flip: float = 0.0
    duplicate: float = 0.0
    delay_s: float = 0.0
    flush_s: float = 0.0  # replies are handed over at multiples of this

    def apply(self, byte: int, chance: random.Random) -> bytes:
        if chance.random() < self.drop:
            return b""
        if chance.random() < self.flip:
            byte ^= 1 << chance.randrange(8)
        return bytes([byte] * (2 if chance.random() < self.duplicate else 1))


@dataclass
class Device:
    """The firmware's side; `send` puts bytes on the line and returns when they are through."""

    events: Events
    send: Callable[[bytes], float] = lambda data: 0.0
    main_byte_s: float = 20e-6  # what the main loop needs for one received byte
    protocol_version: int = PROTOCOL_VERSION
    spec_hash: int = SPEC_HASH
    boot_nonce: int = 0xB0070001
    segments_executed: list[Segment] = field(default_factory=list)  # over all boots: the judge's list
    accepted: int = 0  # frames carried out
    deepest_ring: int = 0

    def __post_init__(self) -> None:
        self._boot()

    def _boot(self) -> None:
        self.state = State.IDLE
        self.fault = Fault.NONE
        self.refusal, self.refusal_seq = Result.OK, 0
        self.crc_errors = self.ring_full = 0
        self.expected = 0
        self.ring: deque[int] = deque()
        self.decoder = FrameDecoder()
        self.queue: deque[Segment] = deque()
        self.frames: deque[tuple[int, int]] = deque()  # segments left and bytes taken
        self.used_bytes = 0
        self.heads: list[tuple[int, int, int]] = []
        self.configs: list[Config] = []
        self.soft_limits: SoftLimits | None = None
        self.holds = 0
        self.held_s = 0.0
        self.override_percent = 100
        self.last_queued = False
        self.executed = 0
        self.position = [0, 0]
        self.segment_start_s = 0.0
        self.boot_s = self.events.now_s
        self.deaf_until_s = self.events.now_s
        self.welcome_due: int | None = None
        self.status_due = False
        self.sending_until_s = self.events.now_s
        self.generation = getattr(self, "generation", 0) + 1  # events of an earlier boot are void

    def reset(self, deaf_s: float = 0.0) -> None:
        """Restart, with a bootloader that swallows everything for `deaf_s`."""
        self.boot_nonce += 1
        self._boot()
        self.deaf_until_s = self.events.now_s + deaf_s

    # -- receiving ----------------------------------------------------------------------------------------------------

    def take_byte(self, byte: int) -> None:
        if self.events.now_s < self.deaf_until_s:
            return
        if byte == HOLD_CODE:
            self.hold()
            return
        if len(self.ring) >= RX_RING_BYTES:
            self.ring_full = (self.ring_full + 1) % 256
            return
        self.ring.append(byte)
        self.deepest_ring = max(self.deepest_ring, len(self.ring))
        if len(self.ring) == 1:
            self._later(self.main_byte_s, self._main)

    def _main(self) -> None:
        for frame in self.decoder.feed(bytes([self.ring.popleft()])):
            if isinstance(frame, Frame):
                self._on_frame(frame)
            else:
                self.crc_errors = (self.crc_errors + 1) % 256
                self.status_due = True
            self._reply()
        if self.ring:
            self._later(self.main_byte_s, self._main)

    def _on_frame(self, frame: Frame) -> None:
        message: object = None
        with contextlib.suppress(WireError):
            message = decode(frame.type_code, frame.payload)
        if isinstance(message, Hello):
            self.expected = (frame.seq + 1) % 256
            self.refusal = Result.OK
            self.welcome_due = message.host_nonce
            return
        self.status_due = True
        if frame.seq != self.expected:
            return
        result = Result.MALFORMED if message is None else self._carry_out(message)
        if result is Result.BUSY:
            return
        self.expected = (self.expected + 1) % 256
        self.accepted += 1
        if result < 0 and self.refusal is Result.OK:
            self.refusal, self.refusal_seq = result, frame.seq

    def _carry_out(self, message: object) -> Result:
        match message:
            case Query():
                return Result.OK
            case Enable(on=1) if self.state is State.IDLE:
                self.state = State.READY
            case Enable(on=0) if self.state is State.READY:
                self._drop_queue(State.IDLE)
            case Clear() if self.state is not State.RUNNING:
                lost = self.fault in (Fault.EMERGENCY_STOP, Fault.STOP_INPUT, Fault.HOMING_FAILED)
                self._drop_queue(State.IDLE if lost or self.state is State.IDLE else State.READY)
                self.fault, self.refusal = Fault.NONE, Result.OK
            case Segments() if self.state in (State.READY, State.RUNNING, State.HELD):
                return self._append(message)
            case Config() if self.state is State.IDLE:
                self.configs.append(message)
            case SoftLimits() if self.state in (State.IDLE, State.READY):
                self.soft_limits = message
            case Resume():
                if self.state is State.HELD:
                    self.state = State.RUNNING
                    self.segment_start_s += self.events.now_s - self.held_s
                    self._await_segment_end()
            case Stop():
                if self.state is State.HELD:
                    self.position = list(self._ledger().position_usteps)
                    self._drop_queue(State.READY)
            case Override():
                self.override_percent = message.percent
                if self.state is State.RUNNING:
                    self._await_segment_end()
            case Start() if self.state is State.READY and self.queue:
                self.state = State.RUNNING
                self.segment_start_s = self.events.now_s + message.lead_ticks / TICKS_HZ
                self._await_segment_end()
            case _:
                return Result.WRONG_STATE
        return Result.OK

    def _append(self, message: Segments) -> Result:
        segments = message.segments
        if self.last_queued:
            self.latch(Fault.QUEUE_MISUSE)
            return Result.OK
        room = encoded_bytes(message) + QUEUE_FRAME_BYTES
        if room > QUEUE_BYTES - self.used_bytes:
            return Result.BUSY
        self.heads.append((message.slow, message.fast, message.need))
        self.frames.append((len(segments), room))
        self.used_bytes += room
        self.queue.extend(segments)
        self.last_queued = is_last(segments[-1])
        return Result.OK

    def _drop_queue(self, state: State) -> None:
        self.queue.clear()
        self.frames.clear()
        self.used_bytes = 0
        self.last_queued = False
        self.state = state

    # -- executing ----------------------------------------------------------------------------------------------------

    def _segment_end_s(self) -> float:
        return self.segment_start_s + duration_ticks(self.queue[0]) / TICKS_HZ * 100 / self.override_percent

    def _await_segment_end(self) -> None:
        end_s = self._segment_end_s()
        self._later(end_s - self.events.now_s, lambda: self._end_segment(end_s))

    def _end_segment(self, end_s: float) -> None:
        if self.state is not State.RUNNING or end_s != self._segment_end_s():
            return  # a hold has put the end off
        self.segment_start_s = self._segment_end_s()
        segment = self.queue.popleft()
        left, room = self.frames.popleft()
        if left > 1:
            self.frames.appendleft((left - 1, room))
        else:
            self.used_bytes -= room
        self.segments_executed.append(segment)
        self.executed += 1
        for joint, move in enumerate(segment.moves):
            self.position[joint] += direction(move) * len(step_ticks(move))
        if is_last(segment):
            self.last_queued = False
            self.state = State.READY
            self.status_due = True
            self._reply()
        elif self.queue:
            self._await_segment_end()
        else:
            self.latch(Fault.UNDERRUN)

    def hold(self) -> None:
        """Rest at once; the released firmware slows down first."""
        self.holds += 1
        if self.state is State.RUNNING:
            self.state = State.HELD
            self.held_s = self.events.now_s
            self.status_due = True
            self._reply()

    def latch(self, fault: Fault) -> None:
        """Stop and tell."""
        self.position = list(self._ledger().position_usteps)
        self.fault, self.state = fault, State.FAULT
        self.status_due = True
        self._reply()

    # -- replying -----------------------------------------------------------------------------------------------------

    def _ledger(self) -> Ledger:
        position = list(self.position)
        if self.state in (State.RUNNING, State.HELD) and self.queue:
            now_s = self.held_s if self.state is State.HELD else self.events.now_s
            elapsed_ticks = (now_s - self.segment_start_s) * TICKS_HZ * self.override_percent / 100
            for joint, move in enumerate(self.queue[0].moves):
                position[joint] += direction(move) * sum(tick <= elapsed_ticks for tick in step_ticks(move))
        return Ledger(self.executed, tuple(position))

    def status(self) -> Status:
        return Status(
            state=self.state,
            fault=self.fault,
            detail=0,
            refusal=self.refusal,
            refusal_seq=self.refusal_seq,
            free_bytes=max(0, QUEUE_BYTES - self.used_bytes - QUEUE_FRAME_BYTES),
            crc_errors=self.crc_errors,
            overruns=0,
            ring_full=self.ring_full,
            holds=self.holds,
            inputs=0,
            override_percent=self.override_percent,
            rate_percent=0 if self.state is State.HELD else self.override_percent,
            mcu_ticks=int((self.events.now_s - self.boot_s) * TICKS_HZ) % 2**32,
            ledger=self._ledger(),
        )

    def _reply(self) -> None:
        """One reply at a time; what is due meanwhile shares the next one."""
        if self.events.now_s < self.sending_until_s:
            return
        message: Welcome | Status
        if self.welcome_due is not None:
            message = Welcome(
                self.protocol_version,
                self.welcome_due,
                self.boot_nonce,
                self.spec_hash,
                (1, 2, 3),
                Reset.EXTERNAL,
                0,
                JOINTS,
                self._ledger(),
            )
            self.welcome_due = None
        elif self.status_due:
            message = self.status()
            self.status_due = False
        else:
            return
        self.sending_until_s = self.send(encode_frame(self.expected, *encode(message)))
        self._later(self.sending_until_s - self.events.now_s, self._reply)

    def _later(self, delay_s: float, action: Callable[[], None]) -> None:
        generation = self.generation
        self.events.at(self.events.now_s + delay_s, lambda: action() if generation == self.generation else None)


class ModelLine:
    """A Transport to a `Device`: bytes paced at 250,000 baud both ways, damaged as asked, all from one seed."""

    pins = None

    def __init__(self, to_device: Damage | None = None, to_host: Damage | None = None, seed: int = 0) -> None:
        self.events = Events()
        self.device = Device(self.events, send=self.from_device)
        self.to_device = to_device or Damage()
        self.to_host = to_host or Damage()
        self.cut = False
        self.written = bytearray()
        self._chance = random.Random(seed)
        self._out_free_s = self._in_free_s = 0.0
        self._received = bytearray()
        self._open = True

    @property
    def clock(self) -> "ModelLine":
        return self

    def nonce(self) -> int:
        return self._chance.getrandbits(32)

    def now_s(self) -> float:
        return self.events.now_s

    def wait_until(self, t_s: float) -> None:
        while self.events.run_next(t_s):
            pass

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        self._check_open()
        while not self._received and self.events.run_next(deadline_s):
            pass
        data = bytes(self._received[:max_bytes])
        del self._received[:max_bytes]
        return data

    def write(self, data: bytes) -> None:
        self._check_open()
        self.written += data
        for byte in data:
            self._out_free_s = max(self._out_free_s, self.events.now_s) + BYTE_S
            for arriving in b"" if self.cut else self.to_device.apply(byte, self._chance):
                self.events.at(
                    self._out_free_s + self.to_device.delay_s, self._arrival(self.device.take_byte, arriving)
                )

    def close(self) -> None:
        self._open = False

    def _check_open(self) -> None:
        if not self._open:
            raise LinkError("port model: closed")

    def from_device(self, data: bytes) -> float:
        for byte in data:
            self._in_free_s = max(self._in_free_s, self.events.now_s) + BYTE_S
            handed_s = self._in_free_s + self.to_host.delay_s
            if self.to_host.flush_s:
                handed_s = (handed_s // self.to_host.flush_s + 1) * self.to_host.flush_s
            for arriving in b"" if self.cut else self.to_host.apply(byte, self._chance):
                self.events.at(handed_s, self._arrival(self._received.append, arriving))
        return self._in_free_s

    @staticmethod
    def _arrival(take: Callable[[int], None], byte: int) -> Callable[[], None]:
        return lambda: take(byte)


def motion(
    count: int, ticks: int = 32_000, seed: int = 1, moving: int = 2, board: Board = BOARDS["uno"]
) -> tuple[Segment, ...]:
    """A motion of `count` segments of `ticks` each, within the protocol's limits, different from one to the next.

    Of the board's joints `moving` move.
    """
    chance, least = random.Random(seed), board.min_interval_ticks
    rest = (Move(0),) * (board.joints - moving)
    segments = [
        Segment(2 * ticks, (*(_move(chance, ticks, least) for _ in range(moving)), *rest)) for _ in range(count)
    ]
    segments[-1] = replace(segments[-1], duration_flags=2 * ticks + 1)
    return tuple(segments)


def _move(chance: random.Random, ticks: int, least_ticks: int) -> Move:
    """A run that keeps half of the least interval clear at either end of the segment."""
    margin = least_ticks // 2
    most = min((ticks - 2 * margin) // (least_ticks + 20), 12)
    steps = chance.randrange(0, most + 1)
    steps_dir = 2 * steps + chance.randrange(2)
    if steps == 0:
        return Move(steps_dir)
    first = chance.randrange(margin, margin + 20)
    if steps == 1:
        return Move(steps_dir, first)
    room = min((ticks - 2 * margin - 20) // steps, 50_000)
    interval = chance.randrange((least_ticks + 10) << 8, room << 8)
    return Move(steps_dir, first, interval, chance.randrange(-(10 << 8) // steps, (10 << 8) // steps))


def frames_written(line: ModelLine) -> list[Frame]:
    """Return all that the host wrote, as frames."""
    return [frame for frame in FrameDecoder().feed(bytes(line.written)) if isinstance(frame, Frame)]


def after(line: ModelLine, t_s: float, action) -> None:
    """Do something to the line at a time of its clock."""
    line.events.at(t_s, action)
