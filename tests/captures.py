"""Captures made from step trains, with defects put in by hand, in each format that people's tools write."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

TICK_PS = 62_500
HIGH_PS = 3_125_000
SETUP_PS = 20_000_000

Edge = tuple[int, str, int]


@dataclass(frozen=True)
class Pulse:
    """One step at the pins: its rising edge, its width, the DIR level it wants and how long before DIR changes."""

    rise_ps: int
    positive: bool
    high_ps: int = HIGH_PS
    setup_ps: int = SETUP_PS


@dataclass(frozen=True)
class Train:
    """Pulses of each joint; `scaled` and `moved` are a board whose clock is off and a recording that began earlier."""

    joints: tuple[tuple[Pulse, ...], ...]
    pins: tuple[tuple[str, str], ...] = (("D9", "D4"), ("D10", "D5"))
    notes: dict = field(default_factory=dict)

    def scaled(self, factor: float) -> "Train":
        return self._each(lambda p: replace(p, rise_ps=round(p.rise_ps * factor)))

    def moved(self, by_ps: int) -> "Train":
        return self._each(lambda p: replace(p, rise_ps=p.rise_ps + by_ps))

    def without(self, joint: int, n: int) -> "Train":
        pulses = self.joints[joint]
        return self._with(joint, pulses[:n] + pulses[n + 1 :])

    def with_extra(self, joint: int, n: int) -> "Train":
        """One more pulse half-way between step n and the next."""
        pulses = self.joints[joint]
        middle = (pulses[n].rise_ps + pulses[n + 1].rise_ps) // 2
        return self._with(joint, (*pulses[: n + 1], replace(pulses[n], rise_ps=middle), *pulses[n + 1 :]))

    def changed(self, joint: int, n: int, **change) -> "Train":
        pulses = list(self.joints[joint])
        pulses[n] = replace(pulses[n], **change)
        return self._with(joint, tuple(pulses))

    def edges(self) -> list[Edge]:
        """All edges in order of time; DIR is low at first."""
        found: list[Edge] = []
        for (step, direction), pulses in zip(self.pins, self.joints, strict=True):
            level = 0
            for pulse in pulses:
                if int(pulse.positive) != level:
                    level = int(pulse.positive)
                    found.append((pulse.rise_ps - pulse.setup_ps, direction, level))
                found += [(pulse.rise_ps, step, 1), (pulse.rise_ps + pulse.high_ps, step, 0)]
        return sorted(found)

    @property
    def channels(self) -> list[str]:
        return [pin for pair in self.pins for pin in pair]

    def _with(self, joint: int, pulses: tuple[Pulse, ...]) -> "Train":
        joints = list(self.joints)
        joints[joint] = pulses
        return replace(self, joints=tuple(joints))

    def _each(self, change) -> "Train":
        return replace(self, joints=tuple(tuple(change(p) for p in pulses) for pulses in self.joints))


def two_joints(steps: int = 300, seed: int = 1) -> Train:
    """Two joints that speed up, slow down and turn round, from 20 ms to 400 us a step, on whole ticks."""
    rng = np.random.default_rng(seed)
    joints = []
    for joint in range(2):
        phase = np.linspace(0.0, 2.0 * np.pi, steps)
        gaps_ps = 4e8 + 2e10 * np.cos(phase + 0.3 * joint) ** 8 + 1e7 * rng.random(steps)
        rises = (np.cumsum(gaps_ps) / TICK_PS).astype(np.int64) * TICK_PS
        joints.append(tuple(Pulse(int(t), bool(n < steps // 2)) for n, t in enumerate(rises)))
    return Train(tuple(joints))


def write_vcd(path: Path, train: Train, *, timescale: str = "100 ps", scope: str = "uno", initial: str = "0") -> None:
    """As planarm (100 ps), PulseView and simavr (1 ns) write it; times are rounded to the unit."""
    unit_ps = {"100 ps": 100, "1 ns": 1000, "1ns": 1000, "1 ps": 1}[timescale]
    codes = {name: chr(33 + n) for n, name in enumerate(train.channels)}
    lines = ["$date today $end", f"$timescale {timescale} $end", f"$scope module {scope} $end"]
    lines += [f"$var wire 1 {code} {name} $end" for name, code in codes.items()]
    lines += ["$upscope $end", "$enddefinitions $end", "#0", "$dumpvars"]
    lines += [f"{initial}{code}" for code in codes.values()] + ["$end"]
    now = 0
    for time_ps, name, level in train.edges():
        time = round(time_ps / unit_ps)
        if time != now:
            lines.append(f"#{time}")
            now = time
        lines.append(f"{level}{codes[name]}")
    path.write_text("\n".join(lines) + "\n")


def write_saleae(path: Path, train: Train) -> None:
    """Logic 2's digital export: a row whenever a channel changes, times in seconds with nine decimals."""
    levels = dict.fromkeys(train.channels, 0)
    rows = ["Time [s]," + ",".join(f"Channel {n}" for n in range(len(levels))), "0.000000000,0,0,0,0"]
    for time_ps, name, level in train.edges():
        levels[name] = level
        rows.append(f"{round(time_ps / 1000) / 1e9:.9f}," + ",".join(map(str, levels.values())))
    path.write_text("\r\n".join(rows) + "\r\n")


SALEAE_MAP = ["step1=Channel 0", "dir1=Channel 1", "step2=Channel 2", "dir2=Channel 3"]


def write_sigrok(path: Path, train: Train, rate_hz: int = 4_000_000) -> None:
    """sigrok-cli -O csv: a row a sample, below comments."""
    step_ps = 10**12 // rate_hz
    edges = [(-(-time_ps // step_ps), name, level) for time_ps, name, level in train.edges()]
    samples = np.zeros((edges[-1][0] + 2, len(train.channels)), np.uint8)
    for at, name, level in edges:
        samples[at:, train.channels.index(name)] = level
    names = ", ".join(train.channels)
    width = len(train.channels)
    header = (
        f"; CSV generated by libsigrok 0.5.2\n; from unknown on a day\n; Channels ({width}/{width}): {names}\n"
        f"META samplerate: {rate_hz}\n" + ",".join(["logic"] * width) + "\n"
    )
    text = np.full((len(samples), 2 * width), ord(","), np.uint8)
    text[:, ::2] = samples + ord("0")
    text[:, -1] = ord("\n")
    path.write_bytes(header.encode() + text.tobytes())
