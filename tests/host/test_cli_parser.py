"""The command line's parser: what it says of words that it does not know, and its help."""

from itertools import chain

import pytest

from planarm.cli.commands import build_parser
from planarm.cli.main import main
from planarm.cli.parser import USES, meant

ARM = "tests/scenarios/arm.toml"


def told(words, capsys):
    with pytest.raises(SystemExit) as left:
        main(words)
    return left.value.code, capsys.readouterr()


def test_the_help_has_every_command_once():
    listed = list(chain.from_iterable(USES.values()))
    [choices] = [one.choices for one in build_parser()._actions if one.dest == "command"]
    assert sorted(listed) == sorted(choices)
    text = build_parser().format_help()
    assert all(text.count(f"\n  {name} ") == 1 for name in listed)


def test_each_commands_page_begins_with_what_it_is_for_and_ends_with_the_exit_codes():
    [commands] = [one for one in build_parser()._actions if one.dest == "command"]
    for name, command in commands.choices.items():
        usage, about, *_ = command.format_help().split("\n\n")
        assert usage.startswith(f"usage: planarm {name} ")
        assert about[0].isupper() or about.startswith(f"planarm {name} "), about
        assert max(map(len, about.splitlines())) < 80
        assert command.format_help().rstrip().endswith("differ from the plan")
        assert all(one.help for one in command._actions)


def test_without_words_the_help_is_told_and_it_is_no_success(capsys):
    code, said = told([], capsys)
    assert (code, said.out) == (2, "")
    assert "plan and run:" in said.err and "exit codes:" in said.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pln"], "there is no command 'pln'; did you mean plan?"),
        (["xyzzy"], "there is no command 'xyzzy'; 'planarm --help'"),
        (["run", ARM, "--planer", "chs"], "there is no option --planer; did you mean --planner?; 'planarm run --help'"),
        (["run", ARM, "--prot=sim://"], "there is no option --prot; did you mean --port?"),
        (["run", ARM, "--planner", "ch"], "'ch' is none of a_star, .*any_angle; did you mean chs?"),
        (["run", ARM, "more"], "nothing takes 'more'; 'planarm run --help'"),
        (["run", "--port"], "--port: expected one argument"),
        (["jog", ARM, "1", "ten"], "DEGREES: 'ten' given, a number expected"),
        (["jog", ARM, "1", "nan"], "DEGREES: 'nan' given, a number expected"),
        (["jog", ARM, "0", "10"], "JOINT: '0' given, a whole number above 0 expected"),
        (["goto", ARM, "inf", "1"], "X: 'inf' given, a number expected"),
        (["plan", ARM, "--seed", "1.5"], "--seed: '1.5' given, a whole number expected"),
        (["emulate", "--seconds", "-1"], "--seconds: '-1' given, a number above 0 expected"),
    ],
)
def test_what_was_meant_is_said(words, said, capsys):
    code, out = told(words, capsys)
    assert code == 2
    head, _, tail = said.partition(".*")
    assert head in out.err and tail in out.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", ARM, "--faults", "none.toml"], "none.toml: cannot be read: No such file or directory; give"),
        (["run", ARM, "--out", ARM], f"{ARM}: cannot be written: "),
        (["run", ARM, "--out", f"{ARM}/deeper"], "arm.toml is a file; give the path of a folder"),
        (["envelope", ARM, "--out", ARM], "arm.toml is a file; give the path of a folder"),
        (["campaign", "examples/sweeps/line_faults.toml", "--out", ARM], "arm.toml is a file; give the path of"),
        (["stream", "none.plan"], "none.plan: cannot be read"),
        (["jog", ARM, "1", "361"], "361 degrees given, but its limits are only"),
        (["timing", "none.vcd"], "give the path of a VCD"),
        (["timing", "diff", ARM, "none.vcd"], "none.vcd: cannot be read"),
        (["resume", "none"], "give the folder of a run"),
        (["dump", ARM], "has no message in it"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_done(words, said, capsys, monkeypatch, pytestconfig):
    monkeypatch.chdir(pytestconfig.rootpath)
    first = "stream.tell_first_compile", "timing.tell_first_compile", "campaign.tell_first_compile"
    for module in ("run.compile_first", "envelope.compile_first", *first):
        monkeypatch.setattr(f"planarm.cli.{module}", lambda *_: pytest.fail("began"))
    code, out = told(words, capsys)
    assert code == 2
    assert said in out.err


@pytest.mark.parametrize(("port", "named"), [("sim", "sim"), ("SIM:/", "SIM:/"), ("", "''")])
def test_a_port_that_may_mean_the_emulator_is_told_how_it_is_called(port, named, capsys, monkeypatch, pytestconfig):
    monkeypatch.chdir(pytestconfig.rootpath)
    code, out = told(["status", ARM, "--port", port], capsys)
    assert code == 5
    assert f"port {named}: not found (the emulator in this process is sim://)" in out.err


def test_nothing_is_meant_where_nothing_is_near():
    assert meant("zzzz", ["plan", "run"]) == ""
