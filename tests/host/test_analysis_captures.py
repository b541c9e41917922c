"""Readers give what a plain reading of the file gives, whatever the blocks' borders, and name damage by its place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from captures import two_joints, write_saleae, write_sigrok, write_vcd
from planarm.analysis import csv_capture, vcd_capture
from planarm.analysis.capture import open_capture
from planarm.errors import CaptureError


def read_all(path, wanted):
    chunks = list(open_capture(path).chunks(wanted))
    return [
        (int(t), int(c), int(v))
        for chunk in chunks
        for t, c, v in zip(chunk.times_ps, chunk.channels, chunk.levels, strict=True)
    ]


def plain_vcd(text, codes):
    """Read the changes in Python's own way."""
    found, now = [], 0
    for line in text.split("$enddefinitions $end")[1].split("\n"):
        if line.startswith("#"):
            now = int(line[1:])
        elif line[:1] in ("0", "1") and line[1:] in codes:
            found.append((now, codes.index(line[1:]), int(line[0])))
    return found


@pytest.mark.parametrize("block", [7, 64, 1000, 1 << 22])
def test_a_vcds_changes_are_those_of_a_plain_reading(block, tmp_path, monkeypatch):
    monkeypatch.setattr(vcd_capture, "BLOCK_BYTES", block)
    path = tmp_path / "a.vcd"
    write_vcd(path, two_joints(40))
    expected = [(100 * t, c, v) for t, c, v in plain_vcd(path.read_text(), ["!", '"', "#", "$"])]
    assert read_all(path, ["D9", "D4", "D10", "D5"]) == expected


@pytest.mark.parametrize("block", [5, 33, 1 << 22])
def test_a_csvs_changes_are_the_trains_edges(block, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_capture, "BLOCK_BYTES", block)
    train = two_joints(12)
    names = train.channels
    expected = [(round(t / 1000) * 1000, names.index(n), v) for t, n, v in train.edges()]
    write_saleae(tmp_path / "a.csv", train)
    assert read_all(tmp_path / "a.csv", [f"Channel {n}" for n in range(4)])[4:] == expected
    if block > 5:  # a row a sample: a small file would take long in tiny blocks
        write_sigrok(tmp_path / "b.csv", train, 400_000)
        seen = read_all(tmp_path / "b.csv", names)[4:]
        grid = 2_500_000
        wanted = [(-(-t // grid) * grid, c, v) for t, c, v in expected]
        assert sorted(seen) == sorted(w for w in wanted if w[1] in (1, 3) or w[0] // grid)


VALUES = st.sampled_from(
    ["0!", "1!", "x!", "z!", "b101 ab", "bx1 ab", "r1.5 !", "sword !", "1ab", "0~~~~", "$comment 1! $end"]
)


@given(st.lists(st.tuples(st.integers(0, 50), st.lists(VALUES, max_size=4)), max_size=12))
def test_any_legal_mixture_of_values_is_read(tmp_path_factory, parts):
    body, now, expected = [], 0, []
    for gap, values in parts:
        now += gap
        body.append(f"#{now}")
        for value in values:
            body.append(value)
            if value in ("x!", "z!", "bx1 ab"):
                expected.append((now * 1000, int(value == "bx1 ab"), -1))
            elif value in ("0!", "1!"):
                expected.append((now * 1000, 0, int(value[0])))
            elif value == "b101 ab":
                expected.append((now * 1000, 1, 5))
            elif value == "0~~~~":
                expected.append((now * 1000, 2, 0))
            elif value == "1ab":
                expected.append((now * 1000, 1, 1))
    path = tmp_path_factory.mktemp("vcd") / "a.vcd"
    path.write_text(
        "$timescale 1 ns $end\n$var wire 1 ! a $end\n$var wire 3 ab b $end\n$var wire 1 ~~~~ c [0] $end\n"
        "$var real 64 r r $end\n$enddefinitions $end\n" + "\n".join(body) + "\n"
    )
    assert read_all(path, ["a", "b", "c"]) == expected


def test_names_that_stand_twice_carry_their_scopes(tmp_path):
    (tmp_path / "a.vcd").write_text(
        "$timescale 1 ns $end $scope module x $end $var wire 1 ! d $end $upscope $end "
        "$scope module y $end $var wire 1 % d $end $upscope $end $enddefinitions $end #1 1%\n"
    )
    capture = open_capture(tmp_path / "a.vcd")
    assert capture.channels == ("x.d", "y.d")
    assert read_all(tmp_path / "a.vcd", ["y.d"]) == [(1000, 0, 1)]


HEAD = "$timescale 1 ns $end $var wire 1 ! d $end $enddefinitions $end\n"
BROKEN = {
    "$timescale 3 ns $end $enddefinitions $end\n": r"\$timescale '3 ns' is not 1, 10 or 100",
    "$var wire 1 ! d $end $enddefinitions $end\n": r"no \$timescale",
    "$timescale 1 ns $end $enddefinitions $end\n": "holds no variable",
    "$timescale 1 ns $end $var wire 1 ! d $end\n": r"no \$enddefinitions",
    HEAD + "#5 1!\nwhat 0!\n": r"byte 69: 'what' is no time and no change",
    HEAD + "#5 1!\n#x7 0!\n": "'#x7' is no time",
    HEAD + "#5 1!\n#4 0!\n": "times run backwards",
    "Time [s],a\n0.0,0\n0.1,2\n": "line 3 is no row of 1 levels",
    "Time [s],a,b\n0.0,0,1\n0.1,1,0,1\n": "line 3 is no row of 2 levels",
    "Time [s],a\n0.2,0\n0.1,1\n": "line 3 is no row of 1 levels in order of time",
    "Time,a\n0,0\n0,1\n": "tells no unit",
    "; Channels (1/1): a\nlogic\n0\n1\n": "names no sample rate",
    "Time [s],a\n": "no row of figures",
    "; Channels (2/2): a, b\nMETA samplerate: 5\nlogic\n0\n1\n": "names 2 channels, its rows have 1",
    "hello\n": "neither a value change dump",
    "": "neither a value change dump",
}


@pytest.mark.parametrize("text", BROKEN, ids=range(len(BROKEN)))
def test_damage_is_one_sentence_with_its_place(text, tmp_path):
    path = tmp_path / "broken"
    path.write_text(text)
    with pytest.raises(CaptureError, match=BROKEN[text]) as told:
        capture = open_capture(path)
        list(capture.chunks(capture.channels))
    assert str(told.value).startswith(str(path))


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(CaptureError, match="cannot be read: No such file"):
        open_capture(tmp_path / "none.vcd")


def test_an_unknown_channel_is_told_with_those_there_are(tmp_path):
    write_vcd(tmp_path / "a.vcd", two_joints(3))
    with pytest.raises(CaptureError, match="has no channel 'D7'; it has D9, D4, D10, D5"):
        list(open_capture(tmp_path / "a.vcd").chunks(["D7"]))


def test_a_wide_number_keeps_its_last_eight_bits(tmp_path):
    (tmp_path / "a.vcd").write_text(
        "$timescale 1 us $end $var wire 8 ! v $end $var wire 9 % w $end $enddefinitions $end #1 b11111111 !\n"
    )
    capture = open_capture(tmp_path / "a.vcd")
    assert capture.channels == ("v",)
    assert read_all(tmp_path / "a.vcd", ["v"]) == [(10**6, 0, 255)]
    assert np.iinfo(np.uint8).max == 255
