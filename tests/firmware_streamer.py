"""A host's end of the line for the firmware's tests: a motion streamed with a window of unacknowledged bytes."""

from __future__ import annotations

from collections import deque

from firmware_board import Board, room_after
from planarm_wire.codec import encode, encoded_bytes
from planarm_wire.framing import encode_frame
from planarm_wire.messages import HOST_WINDOW_BYTES, QUEUE_FRAME_BYTES, Fault, Query, Segment, Segments, Status


class Streamer:
    """Sends a motion as a host does: a window of unacknowledged bytes, the line never idle while it has room."""

    def __init__(self, board: Board, segments: list[Segment], busy_line: bool) -> None:
        self.board = board
        self.waiting = deque(segments)
        self.busy_line = busy_line
        self.in_flight: deque[tuple[int, int, int]] = deque()
        self.last: Status | None = None
        board.replies.clear()

    def run(self, until_segments: int, limit_ticks: int) -> Status:
        """Stream until so many segments are executed or a fault is latched."""
        end = self.board.now + limit_ticks
        while self.board.now < end:
            self.top_up()
            self.board.run(2000)
            while self.board.replies:
                self.take_reply(*self.board.replies.popleft())
            if self.last and (
                self.last.fault is not Fault.NONE or self.last.ledger.executed_segments >= until_segments
            ):
                return self.last
        raise AssertionError(f"not done after {limit_ticks} ticks: {self.last}")

    def take_reply(self, acknowledged: int, reply: object) -> None:
        assert isinstance(reply, Status)
        self.last = reply
        while self.in_flight and (acknowledged - self.in_flight[0][0] - 1) % 256 < 128:
            self.in_flight.popleft()

    def top_up(self) -> None:
        free = room_after() if self.last is None else self.last.free_bytes
        queued = sum(room for _, _, room in self.in_flight)
        while True:
            next_message = Segments(0, 0, 0, (self.waiting[0],)) if self.waiting else None
            has_room = next_message is not None and queued + encoded_bytes(next_message) <= free
            if not has_room and not self.busy_line and self.in_flight:
                return
            message = next_message if has_room and next_message is not None else Query()
            frame = encode_frame(self.board.seq, *encode(message))
            if sum(size for _, size, _ in self.in_flight) + len(frame) > HOST_WINDOW_BYTES:
                return
            room = encoded_bytes(message) + QUEUE_FRAME_BYTES if has_room else 0
            self.in_flight.append((self.board.seq, len(frame), room))
            self.board.seq = (self.board.seq + 1) % 256
            self.board.receive(frame)
            if has_room:
                self.waiting.popleft()
                queued += room


class LedgerReader(Streamer):
    """Keeps what the ledger told, and for when."""

    def __init__(self, board: Board, segments: list[Segment]) -> None:
        super().__init__(board, segments, busy_line=True)
        self.told: list[tuple[int, tuple[int, ...]]] = []

    def take_reply(self, acknowledged: int, reply: object) -> None:
        super().take_reply(acknowledged, reply)
        assert isinstance(reply, Status)
        self.told.append((reply.mcu_ticks, reply.ledger.position_usteps))

    def assert_exact(self) -> None:
        """What each ledger told is the steps that had risen at its tick; the tick of cycle 0 is the same for all."""
        moving = [(tick, told) for tick, told in self.told if 0 < told[0] < len(self.board.rises(0))]
        assert len(moving) >= 60
        fitting: set[int] | None = None
        for tick, told in moving:
            risen = [self.board.rises(joint) for joint in range(2)]
            earliest = max(rises[count - 1] for rises, count in zip(risen, told, strict=True))
            latest = min(rises[count] for rises, count in zip(risen, told, strict=True))
            zeros = set(range(earliest - tick, latest - tick))
            fitting = zeros if fitting is None else fitting & zeros
        assert fitting, "no tick of cycle 0 explains all ledgers"
