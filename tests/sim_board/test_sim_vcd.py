"""Waveform files: exact to the cycle, readable by others, strict on the way back."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim.errors import TraceError
from planarm_sim.trace import EDGE, UNITS_PER_CYCLE, VcdWriter, read_vcd

HEADER = "$timescale 100 ps $end\n$var wire 1 ! D9 $end\n$enddefinitions $end\n"


def read_text(tmp_path: Path, text: str):
    path = tmp_path / "wave.vcd"
    path.write_text(text)
    return read_vcd(path)


def test_a_cycle_is_a_whole_number_of_units():
    assert UNITS_PER_CYCLE * 100e-12 * 16_000_000 == 1.0


def test_the_file_says_what_the_standard_asks_for(tmp_path: Path):
    path = tmp_path / "wave.vcd"
    with VcdWriter(path, ["D9", "D4"], [0, 1], cycle=2) as writer:
        writer.change(3, 0, 1)
        writer.change(3, 1, 0)
        writer.close(10)
    lines = path.read_text().splitlines()
    assert lines[1:] == [
        "$timescale 100 ps $end",
        "$scope module uno $end",
        "$var wire 1 ! D9 $end",
        '$var wire 1 " D4 $end',
        "$upscope $end",
        "$enddefinitions $end",
        "#1250",
        "$dumpvars",
        "0!",
        '1"',
        "$end",
        "#1875",
        "1!",
        '0"',
        "#6250",
    ]


changes = st.lists(st.tuples(st.integers(1, 10**12), st.integers(0, 119)), max_size=60)


@settings(deadline=None, max_examples=40)
@given(changes, st.integers(0, 2**40), st.integers(0, 10**6))
def test_what_is_written_is_read_back_exactly(tmp_path_factory, steps, start, tail):
    names = [f"S{index}" for index in range(120)]  # more than the 94 one-letter codes
    path = tmp_path_factory.mktemp("vcd") / "wave.vcd"
    levels = [index % 2 for index in range(120)]
    wanted = {name: [(start, level)] for name, level in zip(names, levels, strict=True)}
    cycle = start
    with VcdWriter(path, names, levels, cycle=start) as writer:
        for gap, signal in steps:
            cycle += gap
            levels[signal] ^= 1
            writer.change(cycle, signal, levels[signal])
            wanted[names[signal]].append((cycle, levels[signal]))
        writer.close(cycle + tail)
    vcd = read_vcd(path)
    assert (vcd.start_cycle, vcd.end_cycle) == (start, cycle + tail)
    for name, entries in wanted.items():
        np.testing.assert_array_equal(vcd.edges[name], np.array(entries, dtype=EDGE))


def test_time_runs_forward_only(tmp_path: Path):
    with (
        VcdWriter(tmp_path / "w.vcd", ["D9"], [0], cycle=5) as writer,
        pytest.raises(TraceError, match="cycle 4 comes after cycle 5"),
    ):
        writer.change(4, 0, 1)


@pytest.mark.parametrize("names", [[], ["D9", "D9"], ["a b"], [""]])
def test_bad_signal_names_are_refused(tmp_path: Path, names):
    with pytest.raises(TraceError, match="signal names"):
        VcdWriter(tmp_path / "w.vcd", names, [0] * len(names))


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path):
    with pytest.raises(TraceError, match=r"no[/\\]w\.vcd: cannot be written: No such file"):
        VcdWriter(tmp_path / "no" / "w.vcd", ["D9"], [0])


def test_a_recording_of_another_tool_is_read(tmp_path: Path):
    vcd = read_text(
        tmp_path,
        "$date today $end $version other $end $timescale 1ns $end $scope module top $end\n"
        "$var reg 1 a STEP $end $upscope $end $enddefinitions $end\n#0 $dumpvars 0a $end\n#125 1a #250 0a #1000",
    )
    assert vcd.edges["STEP"].tolist() == [(0, 0), (2, 1), (4, 0)]
    assert vcd.end_cycle == 16


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "enddefinitions is missing"),
        (HEADER, "no moment"),
        ("$var wire 1 ! D9 $end $enddefinitions $end", "timescale is missing"),
        (HEADER.replace("100 ps", "50 ps"), "timescale '50ps'"),
        (HEADER.replace("wire 1", "wire 8"), "single-bit"),
        (HEADER.replace("$enddef", "$var wire 1 ! D8 $end $enddef"), "declared twice"),
        (HEADER.replace("$enddef", "stray $enddef"), "outside of any declaration"),
        (HEADER.removesuffix("$end\n"), "\\$end is missing"),
        (HEADER + "1!", "before the first moment"),
        (HEADER + "#0 1?", "no change of a declared signal"),
        (HEADER + "#0 x!", "no change of a declared signal"),
        (HEADER + "#624", "no whole number of cycles"),
        (HEADER + "#-625", "is not a number"),
        (HEADER + "#625 1! #625 0!", "does not come after"),
    ],
)
def test_every_deviation_is_refused_with_its_place(tmp_path: Path, text, words):
    with pytest.raises(TraceError, match=words) as caught:
        read_text(tmp_path, text)
    assert "wave.vcd" in str(caught.value)


def test_a_number_stands_in_binary_beside_the_levels(tmp_path: Path):
    path = tmp_path / "wave.vcd"
    with VcdWriter(path, ["D9"], [0], numbers=("isr",)) as writer:
        writer.change(1, 0, 1)
        writer.number(1, 0, 18)
        writer.number(2, 0, 0)
    text = path.read_text()
    assert '$var wire 8 " isr $end\n' in text
    assert text.endswith('#625\n1!\nb10010 "\n#1250\nb0 "\n')
