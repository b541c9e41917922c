"""A transport whose computer's clock runs at another rate than the board's, and shows another time."""

from planarm.link.sim_transport import SimTransport


class SkewedLine:
    """An emulated board seen by a computer whose clock shows `zero_s + rate x` the board's time.

    A rate below 1 is a board that runs fast.
    """

    pins = arm = None

    def __init__(self, inner: SimTransport, rate: float, zero_s: float) -> None:
        self.inner, self.rate, self.zero_s = inner, rate, zero_s
        self.clock = self

    def host_s(self, board_s: float) -> float:
        return self.zero_s + self.rate * board_s

    def _board_s(self, host_s: float) -> float:
        return (host_s - self.zero_s) / self.rate

    def now_s(self) -> float:
        return self.host_s(self.inner.clock.now_s())

    def wait_until(self, t_s: float) -> None:
        self.inner.clock.wait_until(self._board_s(t_s))

    def nonce(self) -> int:
        return self.inner.nonce()

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        return self.inner.read(max_bytes, self._board_s(deadline_s))

    def write(self, data: bytes) -> None:
        self.inner.write(data)

    def close(self) -> None:
        self.inner.close()
