"""A line to the emulated board that carries few bytes a second, or late, as a network or another chip may."""

from collections import deque

from planarm.link.sim_transport import SimTransport

SLICE_S = 0.0005


class SlowLine:
    """A transport; each way has a rate and a delay of its own. `inner` is the board's own line.

    Args:
        inner: the emulated board.
        bytes_s: what the line carries to the board.
        delay_s: how much later bytes come, each way.
    """

    arm = None

    def __init__(self, inner: SimTransport, bytes_s: float, delay_s: float = 0.0) -> None:
        self.inner, self.bytes_s, self.delay_s = inner, bytes_s, delay_s
        self.clock = self
        self.pins = inner.pins
        self._free_s = 0.0
        self._there: deque[tuple[float, int]] = deque()
        self._back: deque[tuple[float, bytes]] = deque()
        self._received = bytearray()

    def now_s(self) -> float:
        return self.inner.clock.now_s()

    def wait_until(self, t_s: float) -> None:
        while self.now_s() < t_s:
            self._advance(t_s)

    def nonce(self) -> int:
        return self.inner.nonce()

    def write(self, data: bytes) -> None:
        for byte in data:
            self._free_s = max(self._free_s, self.now_s()) + 1.0 / self.bytes_s
            self._there.append((self._free_s + self.delay_s, byte))

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        self._advance(self.now_s())
        while not self._received and self.now_s() < deadline_s:
            self._advance(deadline_s)
        data = bytes(self._received[:max_bytes])
        del self._received[:max_bytes]
        return data

    def close(self) -> None:
        self.inner.close()

    def _advance(self, until_s: float) -> None:
        """Bring what is due to the board and to the host; let the board run for a little while."""
        due = bytearray()
        while self._there and self._there[0][0] <= self.now_s():
            due.append(self._there.popleft()[1])
        if due:
            self.inner.write(bytes(due))
        wake_s = min([until_s, self.now_s() + SLICE_S, *(queue[0][0] for queue in (self._there, self._back) if queue)])
        data = self.inner.read(4096, wake_s)
        if data:
            self._back.append((self.now_s() + self.delay_s, data))
        while self._back and self._back[0][0] <= self.now_s():
            self._received += self._back.popleft()[1]
