"""`planarm run --live`: a page on this computer, or a view for the terminal, such as over SSH."""

from __future__ import annotations

import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, Final

from planarm.errors import PlanarmError, UsageError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from planarm.live.live_run import LiveRun
    from planarm.plan import Plan

KEYS: Final = {"\n": "start", "\r": "start", "h": "hold", "r": "resume", "s": "stop"}
REFRESH_HZ = 10
LOOK_EVERY_S = 0.1


@contextmanager
def live_view(kind: str | None) -> Iterator[LiveRun | None]:
    """Give what shows and steers a run, or None when nobody asked; how the run ends is told to who looks on.

    Raises:
        UsageError: a view for the terminal without a terminal.
    """
    if kind is None:
        yield None
        return
    with _page() if kind == "page" else _terminal() as live:
        try:
            yield live
        except PlanarmError as error:
            live.end("failed", str(error))
            raise
        live.end("done")


@contextmanager
def _page() -> Iterator[LiveRun]:
    from planarm.live.live_run import LiveRun
    from planarm.live.server import LiveServer
    from planarm.record.run_record import plan_record
    from planarm.report.page import live_page

    with ExitStack() as stack:

        def announce(plan: Plan) -> None:
            server = stack.enter_context(LiveServer(live, live_page(plan_record(plan))))
            print(f"live: {server.url}\nThe run waits for Start on that page.", file=sys.stderr, flush=True)

        live = LiveRun(announce)
        yield live


@contextmanager
def _terminal() -> Iterator[LiveRun]:
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError("--live terminal needs a terminal for its keys; --live page needs none")
    from planarm.live.live_run import LiveRun

    over = threading.Event()
    threads: list[threading.Thread] = []

    def announce(_plan: Plan) -> None:
        for work in (lambda: _read_keys(live.order, over), lambda: _show(live, over)):
            threads.append(threading.Thread(target=work, daemon=True))
            threads[-1].start()

    live = LiveRun(announce)
    try:
        yield live
    finally:
        over.set()
        for thread in threads:
            thread.join()


def _read_keys(order: Callable[[str], None], over: threading.Event) -> None:
    """Give an order for each key until the run is over."""
    with _single_keys() as next_key:
        while not over.is_set():
            key = next_key(LOOK_EVERY_S)
            if key.lower() in KEYS:
                order(KEYS[key.lower()])


@contextmanager
def _single_keys() -> Iterator[Callable[[float], str]]:
    """Give a function that waits so many seconds for a key and returns it, or ""; keys need no Enter meanwhile."""
    if sys.platform == "win32":
        import msvcrt
        import time

        def pressed(wait_s: float) -> str:
            if not msvcrt.kbhit():
                time.sleep(wait_s)
            return msvcrt.getwch() if msvcrt.kbhit() else ""

        yield pressed
        return
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield lambda wait_s: sys.stdin.read(1) if select.select([sys.stdin], [], [], wait_s)[0] else ""
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _show(live: LiveRun, over: threading.Event) -> None:
    """Draw the run's state again and again until it is over."""
    from rich.console import Console
    from rich.live import Live

    with Live(state_table(live.state), console=Console(stderr=True), refresh_per_second=REFRESH_HZ) as screen:
        while not over.wait(1.0 / REFRESH_HZ):
            screen.update(state_table(live.state))
        screen.update(state_table(live.state))


def state_table(state: dict[str, Any]) -> RenderableType:
    """Return a run's state as a small table with a bar."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    total_s, path_s = state.get("total_s", 0.0), state.get("path_s", 0.0)
    style = {"held": "yellow", "holding": "yellow", "starved": "yellow", "fault": "bold red", "failed": "bold red"}
    name = str(state["state"])
    table.add_row("state", f"[{style.get(name, 'bold')}]{name}[/]")
    table.add_row("path", ProgressBar(total=max(total_s, 1e-9), completed=path_s, width=40))
    table.add_row("left", f"{max(0.0, total_s - path_s):.2f} of {total_s:.2f} s")
    table.add_row("queued", f"{state.get('buffered_ms', 0.0):.0f} ms")
    joints = "  ".join(f"{angle:+.2f}°" for angle in state.get("q_deg", ()))
    table.add_row("joints", joints)
    table.add_row("sent again", str(state.get("retransmissions", 0)))
    table.add_row("keys", "Enter start, h hold, r resume, s stop")
    return table
