"""What the owner of a motion asks of the device while it runs: hold, go on, another rate, stop.

Each says what the device is to do, and its status says when it is done. A hold that nobody here asked for, as a damaged
byte may cause, is taken back; one that was asked for and is not there is sent again: its byte overtakes frames, so a
RESUME that the device has not read yet undoes it.
"""

from collections.abc import Callable

from planarm.link.session import Session
from planarm_wire.messages import HOLD_CODE, HostMessage, Override, Resume, State, Stop


class Orders:
    """Orders that wait for room on the line, and whether the device does what was asked.

    The path clock's rate is asked for when it is sent: what the line carries may be known only then.

    Attributes:
        stop_wanted: the rest of the plan is to be dropped.
        unasked_holds: how often the device held by itself and was told to go on.

    Args:
        session: whose line it is.
        rate: tells the path clock's rate.
    """

    def __init__(self, session: Session, rate: Callable[[], Override]) -> None:
        self.stop_wanted = False
        self.unasked_holds = 0
        self._session = session
        self._rate = rate
        self._rate_wanted = False
        self._hold_wanted = False
        self._hold_seq = 0
        self._waiting: list[HostMessage] = []

    def hold(self) -> None:
        """Hold; its byte goes at once."""
        self._hold_wanted = True
        self._waiting = [order for order in self._waiting if not isinstance(order, Resume)]
        self._send_hold()

    def resume(self) -> None:
        """Go on after a hold."""
        self._hold_wanted = False
        self._waiting.append(Resume())

    def set_rate(self) -> None:
        """Let the path clock run at another rate."""
        self._rate_wanted = True

    def stop(self, *, quick: bool) -> None:
        """Drop the rest of the plan."""
        self.stop_wanted = True
        self._waiting.append(Stop(int(quick)))

    def send(self, state: State, now_s: float) -> None:
        """Send what waits, a hold that is not there again, and take back one that nobody asked for."""
        if self.hold_is_missing(state) and self._session.idle and self._session.next_seq != self._hold_seq:
            self._send_hold()
        held = state in (State.HOLDING, State.HELD)
        if held and not self._hold_wanted and not self._waiting and self._session.idle:
            self.unasked_holds += 1
            self._waiting.append(Resume())
        if self._rate_wanted:
            self._waiting.append(self._rate())
            self._rate_wanted = False
        while self._waiting and self._session.fits(self._waiting[0]):
            self._session.send(self._waiting.pop(0), now_s)

    def hold_is_missing(self, state: State) -> bool:
        """Whether the device runs where it is to rest; by a state that may be older than the hold."""
        return self._hold_wanted and not self.stop_wanted and state in (State.RUNNING, State.STARVED)

    def _send_hold(self) -> None:
        self._session.send_out_of_band(HOLD_CODE)
        self._hold_seq = self._session.next_seq
