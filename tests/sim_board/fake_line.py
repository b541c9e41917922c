"""A host and a clock that act by a list instead of by the wall clock."""

from collections import deque


class FakeClock:
    """Moves when someone sleeps, and by `cost_s` at every look, as if computing took that long."""

    def __init__(self, cost_s: float = 0.0) -> None:
        self.time_s = 0.0
        self.cost_s = cost_s

    def now_s(self) -> float:
        self.time_s += self.cost_s
        return self.time_s


class FakeLine:
    """A host whose acts are laid down by time: at `when` seconds it opens, sends bytes, or closes."""

    def __init__(self, clock: FakeClock, acts: list[tuple[float, str | bytes]], room: int = 10**6) -> None:
        self.clock = clock
        self.start_s = 0.0  # the clock's first moment, so that sums of times are exact
        self.acts = deque(sorted(acts, key=lambda act: act[0]))
        self.open = False
        self.openings = 0
        self.inbox = bytearray()  # host to board
        self.received: list[tuple[float, bytes]] = []  # board to host, with the time
        self.room = room
        self.waits: list[float] = []
        self.most_taken = 0
        self.baud_set: int | None = None
        self.dtr_stays_up = False

    def _catch_up(self) -> None:
        while self.acts and self.acts[0][0] <= self.clock.time_s - self.start_s:
            _, act = self.acts.popleft()
            if isinstance(act, bytes):
                assert self.open, "a host writes to an open line only"
                self.inbox += act
            else:
                self.open = act == "open"
                self.openings += self.open

    def is_open(self) -> bool:
        self._catch_up()
        return self.open or bool(self.inbox)

    def opened(self) -> bool:
        self._catch_up()
        openings, self.openings = self.openings, 0
        return openings > 0

    def baud(self) -> int | None:
        return self.baud_set

    def keeps_dtr(self) -> bool:
        return self.dtr_stays_up

    def read(self, most: int) -> bytes:
        self._catch_up()
        assert most >= 0
        data = bytes(self.inbox[:most])
        del self.inbox[:most]
        return data

    def write(self, data: bytes) -> int:
        assert self.open, "nobody is there to read"
        taken = min(len(data), self.room)
        self.room -= taken
        if taken:
            self.received.append((self.clock.time_s - self.start_s, data[:taken]))
        return taken

    def wait(self, timeout_s: float, *, for_bytes: bool) -> bool:
        self._catch_up()
        if for_bytes and self.inbox:
            return True
        wake = self.clock.time_s + max(timeout_s, 0.0)
        if for_bytes and self.open and self.acts:
            wake = min(wake, max(self.start_s + self.acts[0][0], self.clock.time_s))
        self.waits.append(wake - self.clock.time_s)
        self.clock.time_s = wake
        return bool(self.acts) and self.start_s + self.acts[0][0] <= wake

    @property
    def text(self) -> bytes:
        return b"".join(data for _, data in self.received)
