"""Finds the order of the functions in the image that leaves the fewest far calls, and writes it to order.ld.

    python firmware/order.py            searches on from the order that order.ld has, and writes what it found
    python firmware/order.py --check    tells names in order.ld that no image has any more; exit code 1 if there are any

RCALL and RJMP take two bytes and reach 4 KB, CALL and JMP four; the linker takes the short ones where they reach
(--relax). One order serves all images. It is searched for those of two and of four joints, as other wirings differ in
no call. The search is simulated annealing by a seeded generator: the same image and order give the same result. Needs
the standard library and avr-gcc only.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import sys
import tempfile
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import build

ORDER = build.FIRMWARE / "order.ld"
SEARCHED = ("uno", "uno_four")
TRIES = 300_000  # half a minute
SEED = 124
WARM, COLD = 1.0, 0.12  # so many far jumps more are kept one time in e, at the search's start and at its end
BLOCK = 8  # most functions that are moved at once
# From the instruction behind RCALL or RJMP (AVR instruction set manual).
REACH_BACK_BYTES, REACH_AHEAD_BYTES = 4096, 4094
JUMP_BYTES = 2

PLACED = re.compile(
    r"^ (?P<name>\.\S+)\s+0x(?P<at>[0-9a-f]+)\s+0x(?P<size>[0-9a-f]+)"
    r"(?:\s+0x[0-9a-f]+ \(size before relaxing\))? \S+$",
    re.M,
)
JUMP = re.compile(r"^\s*(?P<at>[0-9a-f]+):\t(?P<far>r?)(?:call|jmp)\t.*?0x(?P<to>[0-9a-f]+) <", re.M)
NAMED = re.compile(r"^\*\((\S+)\)$", re.M)


HEAD, TAIL = "head", "tail"  # what lies before the functions, and behind


@dataclass(frozen=True, slots=True)
class Jump:
    """A call or jump from one function to another; offsets in bytes from the functions' starts."""

    function: str
    offset: int
    to: str
    to_offset: int
    is_far: bool


@dataclass(frozen=True, slots=True)
class Graph:
    """What the linked image holds: bytes of each function that may be moved, and of what lies before them all."""

    head_bytes: int
    sizes: dict[str, int]
    jumps: tuple[Jump, ...]

    @property
    def far_jumps(self) -> int:
        """How many take four bytes now."""
        return sum(jump.is_far for jump in self.jumps)


def pattern_of(section: str) -> str:
    """The section's name as order.ld has it: a clone's number, which changes with the code around it, left open."""
    return re.sub(r"\.(isra|constprop|part|lto_priv)\.\d+", r".\1.*", section)


def read_graph(elf: Path) -> Graph:
    """The functions and jumps of a linked image whose map lies beside it."""
    text = elf.with_suffix(".map").read_text(encoding="utf-8")
    text = text[text.index("\n.text ") : text.index("\n.data ")]
    places = [(int(found["at"], 16), int(found["size"], 16), found["name"]) for found in PLACED.finditer(text)]
    places = sorted(place for place in places if place[1] > 0)
    first = min(at for at, _, name in places if name.startswith(".text."))
    last = min(at for at, _, name in places if name.startswith((".text.__vector_", ".fini")))
    sizes: dict[str, int] = {}
    lies: list[tuple[int, str, int]] = []
    for at, size, name in places:
        function = HEAD if at < first else TAIL if at >= last else pattern_of(name)
        before = sizes.get(function, 0)
        lies.append((at, function, before - at))
        sizes[function] = before + size
    starts = [at for at, *_ in lies]
    code = build.code_start(elf)
    listing = build.run(["avr-objdump", "-d", "--no-show-raw-insn", f"--start-address={code}", str(elf)])
    jumps = []
    for found in JUMP.finditer(listing):
        at, to = int(found["at"], 16), int(found["to"], 16)
        (_, function, shift), (_, callee, to_shift) = (lies[bisect_right(starts, place) - 1] for place in (at, to))
        if function != callee:
            jumps.append(Jump(function, at + shift, callee, to + to_shift, found["far"] == ""))
    return Graph(first, {name: size for name, size in sizes.items() if name not in (HEAD, TAIL)}, tuple(jumps))


class Layout:
    """A graph laid out in any order of the functions of several graphs, of which it may have some only."""

    def __init__(self, graph: Graph, names: Sequence[str]) -> None:
        number = {HEAD: 0, TAIL: len(names) + 1} | {name: at for at, name in enumerate(names, 1)}
        self.head = graph.head_bytes
        self.sizes = [0, *(graph.sizes.get(name, 0) for name in names)]
        # From the lowest address that a jump reaches to the one it wants, with both functions at 0.
        self.jumps = [
            (number[jump.function], number[jump.to], jump.to_offset - (jump.offset + JUMP_BYTES - REACH_BACK_BYTES))
            for jump in graph.jumps
        ]
        self.places = [0] * (len(names) + 2)  # the head's stays 0

    def far_jumps(self, order: Sequence[int]) -> int:
        """How many jumps would take four bytes with the functions of these numbers, from 1, in this order."""
        sizes, places = self.sizes, self.places
        at = self.head
        for function in order:
            places[function] = at
            at += sizes[function]
        places[-1] = at
        most = REACH_BACK_BYTES + REACH_AHEAD_BYTES
        return sum([not 0 <= places[to] - places[function] + offset <= most for function, to, offset in self.jumps])


def find_order(graphs: Iterable[Graph], start: Sequence[str], tries: int = TRIES, seed: int = SEED) -> list[str]:
    """The best order found of all functions of the graphs, from one that may lack some or name others.

    Blocks of functions are moved; a try that leaves more far jumps is kept with a probability that falls as the search
    goes on.
    """
    graphs = tuple(graphs)
    known = sorted({name for graph in graphs for name in graph.sizes})
    names = [name for name in start if name in known] + [name for name in known if name not in start]
    layouts = [Layout(graph, names) for graph in graphs]
    chance = random.Random(seed).random  # the one method that gives the same numbers in every version of Python
    order = list(range(1, len(names) + 1))
    best, now = order, sum(layout.far_jumps(order) for layout in layouts)
    fewest = now
    for done in range(tries):
        size = 1 + int(chance() * BLOCK) if chance() < 0.4 else 1
        at = int(chance() * (len(order) - size + 1))
        block = order[at : at + size]
        tried = order[:at] + order[at + size :]
        to = int(chance() * (len(tried) + 1))
        tried[to:to] = block if chance() < 0.7 else block[::-1]
        far = sum(layout.far_jumps(tried) for layout in layouts)
        if far <= now or chance() < math.exp((now - far) / (WARM * (COLD / WARM) ** (done / tries))):
            order, now = tried, far
            if now < fewest:
                best, fewest = order, now
    return [names[function - 1] for function in best]


def read_order() -> list[str]:
    """The sections that order.ld names."""
    return NAMED.findall(ORDER.read_text(encoding="utf-8"))


def write_order(names: Iterable[str]) -> None:
    """Write order.ld."""
    head = "/* Found by order.py; the linker reads it in the middle of image.ld. */\n"
    ORDER.write_text(head + "".join(f"*({name})\n" for name in names), encoding="utf-8")


def link(out: Path) -> list[Graph]:
    """Build the searched images; return their graphs."""
    return [read_graph(build.build_image(out, board).with_suffix(".elf")) for board in SEARCHED]


def stale_names(graphs: Iterable[Graph]) -> list[str]:
    """What order.ld names and no image has."""
    known = {name for graph in graphs for name in graph.sizes}
    return [name for name in read_order() if name not in known]


def main() -> int:
    """Check order.ld or search a better order; return the exit code."""
    parser = argparse.ArgumentParser(description="Finds the order of the functions in the image.")
    parser.add_argument("--check", action="store_true", help="tell stale names only")
    parser.add_argument("--tries", type=int, default=TRIES)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        graphs = link(Path(folder))
        if arguments.check:
            stale = stale_names(graphs)
            sys.stdout.write("".join(f"order.ld: no image has {name}\n" for name in stale))
            return 1 if stale else 0
        before = [graph.far_jumps for graph in graphs]
        write_order(find_order(graphs, read_order(), arguments.tries))
        after = [graph.far_jumps for graph in link(Path(folder))]
    for board, graph, was, now in zip(SEARCHED, graphs, before, after, strict=True):
        sys.stdout.write(f"{board}: of {len(graph.jumps)} jumps {now} are far, {was} before\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
