"""Generated files are up to date, well formed, and the firmware's header holds the same numbers."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planarm_wire import generate, messages
from planarm_wire.codec import decode, encode
from planarm_wire.crc import crc16
from planarm_wire.errors import WireError
from planarm_wire.framing import MAX_FRAME_BYTES, FrameDecoder, FrameError, encode_frame
from planarm_wire.messages import Move, Segment
from planarm_wire.spec import load_spec
from planarm_wire.steps import expand_moves

ROOT = generate.ROOT
VECTORS = json.loads((ROOT / "protocol" / "vectors.json").read_text(encoding="utf-8"))
SPEC = load_spec()


def test_generated_files_are_up_to_date() -> None:
    differing = [str(path.relative_to(ROOT)) for path, _ in generate.outdated()]
    assert not differing, f"run `python -m planarm_wire.generate` and commit {differing}"


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A source tree with a specification and nothing generated yet."""
    (tmp_path / "protocol").mkdir()
    shutil.copy(ROOT / "protocol" / "messages.toml", tmp_path / "protocol")
    monkeypatch.setattr(generate, "ROOT", tmp_path)
    outdated = generate.outdated
    monkeypatch.setattr(generate, "outdated", lambda: outdated(tmp_path))
    return tmp_path


def test_check_writes_nothing_and_generate_writes_all(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert generate.main(["--check"]) == 1
    assert "messages.h: differs" in capsys.readouterr().out
    assert [path.name for path in copy.rglob("*.*")] == ["messages.toml"]
    assert generate.main([]) == 0
    assert all((copy / name).is_file() for name in generate.GENERATED)
    assert generate.main(["--check"]) == 0
    (copy / "docs" / "protocol.md").write_text("edited by hand")
    capsys.readouterr()
    assert generate.main(["--check"]) == 1
    assert capsys.readouterr().out.startswith("docs/protocol.md: differs from messages.toml")


def test_an_installed_package_says_that_it_has_no_specification(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (copy / "protocol" / "messages.toml").unlink()
    assert generate.main(["--check"]) == 2
    assert "belongs to the source tree and is not installed" in capsys.readouterr().err


def test_messages_py_is_formatted_and_every_public_name_has_a_docstring() -> None:
    path = ROOT / "protocol" / "planarm_wire" / "messages.py"
    ruff = [sys.executable, "-m", "ruff"]
    for command in (["format", "--check", "--diff"], ["check"]):
        done = subprocess.run(
            [*ruff, *command, "--stdin-filename", str(ROOT / "generated.py"), "-"],
            input=path.read_text(encoding="utf-8"),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef):
            assert ast.get_docstring(node), node.name
        if isinstance(node, ast.AnnAssign) and "TypeAlias" not in ast.unparse(node.annotation):
            assert isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant), ast.unparse(node.target)


def test_the_page_tells_every_message_field_limit_and_code() -> None:
    page = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    for message in SPEC.messages:
        assert f"### {message.name.upper()} (0x{message.code:02X}, " in page
    for item in (*SPEC.messages, *SPEC.structs):
        for field in item.fields:
            assert re.search(rf"^\| {field.name} \| {field.kind}", page, re.M), field.name
    for limit in SPEC.limits:
        assert f"| {limit.name} | {limit.value:,} |" in page
    for code in (*SPEC.states, *SPEC.faults, *SPEC.results):
        assert f"| {code.code} | {code.name} |" in page


def header_program() -> str:
    """A program of static_asserts: every number of the header against the specification, layouts counted by codec."""
    lines = ["#include <stddef.h>", '#include "messages.h"', "using namespace planarm::wire;"]

    def check(expression: str, value: int) -> None:
        lines.append(f'static_assert({expression} == {value}, "{expression}");')

    for name in ("PROTOCOL_VERSION", "SPEC_HASH", "DELIMITER", "ESCAPE", "ESCAPE_XOR", "CRC_INITIAL", "HEADER_BYTES"):
        check(name, getattr(messages, name))
    check("MAX_FRAME_BYTES", MAX_FRAME_BYTES)
    for limit in SPEC.limits:
        check(limit.name.upper(), limit.value)
    for index, code in enumerate(messages.RESERVED):
        check(f"RESERVED[{index}]", code)
    for joint, (step, direction) in enumerate(zip(messages.STEP_PINS, messages.DIR_PINS, strict=True)):
        check(f"STEP_PINS[{joint}]", int(step[1:]))
        check(f"DIR_PINS[{joint}]", int(direction[1:]))
    for enum in (
        messages.MessageType,
        messages.State,
        messages.Fault,
        messages.Reset,
        messages.PinMap,
        messages.Result,
    ):
        for member in enum:
            check(f"static_cast<int>({enum.__name__}::{member.name})", member.value)
        check(f"sizeof({enum.__name__})", 1)
    lines.extend(
        f'static_assert({enum}(-1) {sign}, "{enum}");' for enum, sign in (("int8_t", "< 0"), ("uint8_t", "> 0"))
    )
    # Where a field starts, found by changing it alone and looking which payload byte changes first.
    zero = decode(0x82, bytes(30))
    changes = {
        "state": {"state": messages.State.READY},
        "fault": {"fault": messages.Fault.UNDERRUN},
        "refusal": {"refusal": messages.Result.VERSION},
        "free_bytes": {"free_bytes": 1},
        "ring_full": {"ring_full": 1},
        "mcu_ticks": {"mcu_ticks": 1},
        "ledger.executed_segments": {"ledger": messages.Ledger(1, (0, 0))},
        "ledger.position_usteps": {"ledger": messages.Ledger(0, (1, 0))},
    }
    for name, change in changes.items():
        _, payload = encode(messages.Status(**{f: getattr(zero, f) for f in zero.__slots__} | change))
        check(f"offsetof(Status, {name})", next(at for at, byte in enumerate(payload) if byte))
    check("sizeof(Status)", 30)
    check("WELCOME_BYTES", len(encode(decode(0x81, bytes(31)))[1]))
    return "\n".join((*lines, "int main() { return 0; }"))


COMPILERS = {
    "g++": ["g++", "-std=c++14", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"],
    "avr-g++": ["avr-g++", "-std=c++14", "-mmcu=atmega328p", "-Wall", "-Wextra", "-Werror"],
}


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_compiles_and_holds_the_same_numbers(compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    program = tmp_path / "check.cpp"
    program.write_text(header_program())
    done = subprocess.run(
        [
            *COMPILERS[compiler],
            *(f"-I{ROOT / 'firmware' / 'core' / place}" for place in (".", "boards/uno")),
            "-fsyntax-only",
            str(program),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_vectors_hold_every_message_and_every_verdict() -> None:
    assert {vector["message"] for vector in VECTORS["frames"]} == {message.name for message in SPEC.messages}
    verdicts = {gives.get("error") for stream in VECTORS["streams"] for gives in stream["gives"]}
    assert verdicts == {None, "bad_escape", "too_long", "truncated", "header_crc", "payload_crc"}
    assert any(len(bytes.fromhex(vector["line"])) > 80 for vector in VECTORS["frames"]), "a long, much stuffed frame"


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda v: f"{v['message']}-{v['seq']}")
def test_vector_of_a_frame(vector: dict) -> None:
    message = decode(vector["type"], bytes.fromhex(vector["payload"]))
    assert message.TYPE.name.lower() == vector["message"]
    assert json.loads(json.dumps(_plain(message))) == vector["fields"]
    assert encode_frame(vector["seq"], *encode(message)).hex() == vector["line"]


def _plain(item: object) -> object:
    if hasattr(item, "__slots__") and not isinstance(item, int):
        return {name: _plain(getattr(item, name)) for name in item.__slots__}
    return [_plain(entry) for entry in item] if isinstance(item, tuple) else item


@pytest.mark.parametrize("vector", VECTORS["streams"], ids=lambda v: v["name"])
def test_vector_of_a_stream(vector: dict) -> None:
    found = FrameDecoder().feed(bytes.fromhex(vector["line"]))
    assert len(found) == len(vector["gives"])
    for item, expected in zip(found, vector["gives"], strict=True):
        if isinstance(item, FrameError):
            assert (item.cause.name.lower(), item.byte_count) == (expected["error"], expected["byte_count"])
        else:
            assert (item.seq, item.type_code, item.payload.hex()) == tuple(expected.values())


@pytest.mark.parametrize("vector", VECTORS["bad_payloads"], ids=lambda v: v["why"])
def test_vector_of_a_bad_payload(vector: dict) -> None:
    with pytest.raises(WireError):
        decode(vector["type"], bytes.fromhex(vector["payload"]))


def test_vectors_of_crc_and_steps() -> None:
    for vector in VECTORS["crc"]:
        assert crc16(bytes.fromhex(vector["data"])) == vector["crc"]
    for vector in VECTORS["segments"]:
        fields = vector["segment"]
        segment = Segment(fields["duration_flags"], tuple(Move(**move) for move in fields["moves"]))
        ticks = expand_moves(segment)
        assert [list(joint) for joint in ticks] == vector["step_ticks"]
        assert all(t < segment.duration_flags >> 1 for joint in ticks for t in joint), "a legal segment"
