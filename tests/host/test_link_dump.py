"""The flight recorder: what it keeps of a run, how it reads, and that it plays again with the same edges."""

import json
import shutil

import numpy as np
import pytest

from broken_runs import SCENE, KilledError, board, run_until
from link_model import Damage, ModelLine, motion
from planarm.cli.main import main
from planarm.errors import JournalError
from planarm.link import recording
from planarm.link.dump import Dump
from planarm.link.exchange import stream_plan
from planarm.link.journal import Kind, Record, read_journal
from planarm.link.replay import replay
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm_wire.messages import BOARDS


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A whole run: its folder, its plan and the board that executed it."""
    folder = tmp_path_factory.mktemp("run")
    plan, line = plan_scene(load_scene(SCENE), lambda _stage, _share: None), board()
    assert run_until(plan, line, folder, 0.0) is None
    return folder, plan, line


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(list(words))
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


def test_a_recorded_run_played_again_has_the_same_edges_and_replies(recorded):
    folder, _, line = recorded
    played = replay(read_journal(folder / "run.journal"))
    assert played.same_replies
    for pin in BOARDS["uno"].driver_pins:
        np.testing.assert_array_equal(played.line.pins.edges(pin), line.pins.edges(pin))
    assert played.edges()["D9"] > 1000


def test_a_broken_run_played_again_stops_where_it_did(recorded, tmp_path):
    _, plan, _ = recorded
    line = board()
    run_until(plan, line, tmp_path, 0.3, KilledError())
    line.clock.wait_until(1.5)
    played = replay(read_journal(tmp_path / "run.journal"))
    for pin in BOARDS["uno"].driver_pins:
        np.testing.assert_array_equal(played.line.pins.edges(pin), line.pins.edges(pin))


def test_the_waveforms_of_a_run_are_held_against_the_replay(recorded, tmp_path, capsys):
    folder, _, line = recorded
    run = tmp_path / "run"
    shutil.copytree(folder, run)
    line.pins.write_vcd(run / "trace.vcd")
    code, out, _ = leave(capsys, "replay", str(run), "--json")
    told = json.loads(out)
    assert (code, told["differences"], told["same_replies"]) == (0, [], True)
    other = board()
    other.pins.write_vcd(run / "trace.vcd")
    code, out, _ = leave(capsys, "replay", str(run))
    assert code == 7
    assert "D9: 0 edges then" in out


def test_the_dump_names_every_message_once(recorded, capsys):
    folder, plan, _ = recorded
    dump = Dump()
    lines = [str(line) for line in dump.lines(read_journal(folder / "run.journal").records)]
    figures = dump.figures.figures()
    messages = figures["messages"]
    assert messages["HELLO"] == messages["WELCOME"] == messages["START"] == 1
    assert messages["STATUS"] >= messages["SEGMENTS"] + messages["QUERY"]
    assert (figures["copies"], figures["damaged"], figures["faults"]) == (0, 0, [])
    assert 1.0 < figures["round_trip_ms"]["p50"] < 10.0
    segments = [line for line in lines if "SEGMENTS" in line]
    assert sum(line.count(" ms (") for line in segments) == len(plan.segments.segments)
    assert sum("last" in line for line in segments) == 1
    assert any("STATUS running" in line and "bytes free" in line for line in lines)
    code, out, _ = leave(capsys, "dump", str(folder))
    assert code == 0
    assert out.splitlines()[: len(lines)] == lines


def test_copies_and_damage_are_told():
    records = []

    class Kept(ModelLine):
        def read(self, max_bytes, deadline_s):
            data = super().read(max_bytes, deadline_s)
            records.append((Kind.RECEIVED, self.now_s(), data))
            return data

        def write(self, data):
            records.append((Kind.SENT, self.now_s(), data))
            super().write(data)

    line = Kept(Damage(drop=0.002), Damage(flip=0.002), seed=3)
    result = stream_plan(line, motion(100, ticks=320_000))
    dump = Dump()
    lines = list(dump.lines(Record(*record) for record in records))
    assert dump.figures.copies == result.retransmissions > 0
    assert dump.figures.damaged >= result.damaged_replies > 0
    assert any(str(line).endswith("(again)") for line in lines)


def test_a_byte_stream_is_dumped_without_times(recorded, tmp_path, capsys):
    folder, _, _ = recorded
    sent = b"".join(r.data for r in read_journal(folder / "run.journal").records if r.kind is Kind.SENT)
    (tmp_path / "bytes.bin").write_bytes(sent)
    code, out, _ = leave(capsys, "dump", str(tmp_path / "bytes.bin"))
    assert code == 0
    assert out.startswith("-> #0   HELLO protocol_version")
    code, out, _ = leave(capsys, "dump", str(tmp_path / "bytes.bin"), "--json")
    assert json.loads(out)["messages"]["START"] == 1
    code, _, err = leave(capsys, "dump", str(tmp_path / "nothing"))
    assert (code, "cannot be read" in err) == (2, True)


def test_a_journal_is_bounded_and_keeps_what_moves_the_arm(recorded, tmp_path, monkeypatch):
    """Beyond its bound questions and answers are left out; the motion's frames are all there."""
    monkeypatch.setattr(recording, "MOST_BYTES", 2000)
    _, plan, _ = recorded
    line = board()
    assert run_until(plan, line, tmp_path, 0.0) is None
    dump = Dump()
    list(dump.lines(read_journal(tmp_path / "run.journal").records))
    segments = dump.figures.messages["SEGMENTS"]
    whole = Dump()
    list(whole.lines(read_journal(recorded[0] / "run.journal").records))
    assert segments == whole.figures.messages["SEGMENTS"]
    assert dump.figures.messages["STATUS"] < whole.figures.messages["STATUS"]
    assert (tmp_path / "run.journal").stat().st_size < 15_000
    played, wanted = (replay(read_journal(run / "run.journal")) for run in (tmp_path, recorded[0]))
    assert played.edges() == wanted.edges()


def test_nothing_sent_is_nothing_to_replay(recorded, tmp_path):
    path = tmp_path / "run.journal"
    data = (recorded[0] / "run.journal").read_bytes()
    first = read_journal(recorded[0] / "run.journal").records[0]
    path.write_bytes(data[: 18 + 13 + len(first.data) + 4])
    with pytest.raises(JournalError, match="nothing to replay"):
        replay(read_journal(path))
