"""The specification is read strictly: each mistake is an error that names its place."""

import re
import tomllib

import pytest

from planarm_wire.errors import SpecError
from planarm_wire.spec import SPEC_PATH, load_spec, parse_spec, spec_hash

TEXT = SPEC_PATH.read_text(encoding="utf-8")


def changed(old: str, new: str) -> str:
    assert TEXT.count(old) >= 1, f"{old!r} is not in the specification any more"
    return TEXT.replace(old, new, 1)


def test_the_shipped_specification_is_read() -> None:
    spec = load_spec()
    assert spec.name == "planarm"
    assert spec.limit("ticks_hz") == 16_000_000
    assert {message.name for message in spec.messages} >= {"hello", "segments", "status"}
    with pytest.raises(KeyError):
        spec.limit("no_such_limit")


MISTAKES = {
    "unknown key": ('name = "planarm"', 'name = "planarm"\nauthor = "x"', "protocol: unknown key 'author'"),
    "unknown key, near miss": (
        'doc = "Asks',
        'docs = "Asks',
        "messages.query: unknown key 'docs'; did you mean 'doc'?",
    ),
    "unknown section": ("[protocol]", "[extras]\nx = 1\n[protocol]", "top level: unknown key 'extras'"),
    "missing section": ("[sequence]\n", "[limits.sequence]\nvalue = 1\n", "sequence is missing"),
    "missing key": ("version = 2\n", "", "protocol: version is missing"),
    "missing doc of a limit": (', doc = "Timer1 and path clock, prescaler 1"', "", "limits.ticks_hz: doc is missing"),
    "missing doc of a field": (', doc = "1 or 0"', "", "messages.enable.fields[0]: doc is missing"),
    "empty doc": ('doc = "Asks for STATUS."', 'doc = " "', "messages.query.doc: empty"),
    "missing fix": (', fix = "wait until the motion is done"', "", "faults.queue_misuse: fix is missing"),
    "empty fix": ('fix = "wait until the motion is done"', 'fix = ""', "faults.queue_misuse.fix: empty"),
    "wrong type": ("version = 2\n", 'version = "1"\n', "protocol.version: '1' is not of type int"),
    "truth for a number": ("version = 2\n", "version = true\n", "protocol.version: True is not of type int"),
    "version": ("version = 2\n", "version = 256\n", "protocol.version: 256 is outside 1 .. 255"),
    "delimiter": ("delimiter = 0x7E", "delimiter = 0x17E", "framing.delimiter: 382 is outside 1 .. 255"),
    "same special byte twice": (
        "escape = 0x7D",
        "escape = 0x7E",
        "framing: delimiter, escape and reserved: 126 stands",
    ),
    "escaped byte is special again": ("escape_xor = 0x20", "escape_xor = 0x03", "framing.escape_xor: an escaped byte"),
    "limit out of range": ("value = 16_000_000", "value = 0", "limits.ticks_hz.value: 0 is outside 1 .. 4294967295"),
    "limit gone": ("joints = {", "joint_count = {", "limits: joints is missing"),
    "window too small": (
        "host_window_bytes = { value = 112",
        "host_window_bytes = { value = 71",
        "longest frame without escapes, 72",
    ),
    "pins": ('step_pins = ["D9", "D10"]', 'step_pins = ["D9"]', "boards.uno.step_pins: 1 pins for 2 joints"),
    "pin's name": ('enable_pin = "D8"', 'enable_pin = "PB0"', "boards.uno: 'PB0' is not a pin's name"),
    "pin twice": ('enable_pin = "D8"', 'enable_pin = "D9"', "boards.uno: pins: 'D9' stands there twice"),
    "state twice": ("ready = { code = 1", "ready = { code = 0", "states: codes: 0 stands there twice"),
    "fault twice": ("underrun = { code = 2", "underrun = { code = 1", "faults: codes: 1 stands there twice"),
    "result out of range": (
        "version = { code = -5",
        "version = { code = -129",
        "results.version.code: -129 is outside",
    ),
    "message twice": ("code = 0x02", "code = 0x01", "messages: codes: 1 stands there twice"),
    "code of the other side": ("code = 0x02", "code = 0x92", "messages.query.code: 146 is outside 0 .. 127"),
    "sender": ('from = "host"', 'from = "pc"', "messages.hello.from: 'pc' is neither host nor device"),
    "unknown type": (
        '"host_nonce", type = "u32"',
        '"host_nonce", type = "u33"',
        "host_nonce.type: 'u33' is unknown; did you",
    ),
    "struct used before it is told": (
        'name = "moves", type = "move"',
        'name = "moves", type = "ledger"',
        "'ledger' is unknown",
    ),
    "number without unit": (
        ', unit = "1", doc = "1 or 0"',
        ', doc = "1 or 0"',
        "messages.enable.on.unit: a number needs one",
    ),
    "struct with unit": ('type = "ledger", doc', 'type = "ledger", unit = "1", doc', "ledger.unit: a number needs one"),
    "field twice": ('name = "host_nonce"', 'name = "protocol_version"', "protocol_version: there are two fields"),
    "bad name": ('name = "host_nonce"', 'name = "hostNonce"', "'hostNonce' is no name of small letters"),
    "repeat": ("repeat = 3", "repeat = 0", "firmware_version.repeat: 0 is outside 1 .. 255"),
    "repeat by unknown name": ('repeat = "joints"', 'repeat = "arms"', "moves.repeat: 'arms' is no count"),
    "end not last": ("repeat = 3", 'repeat = "end"', "only the last field of a message may go on to the end"),
    "end in a struct": (
        'type = "move", repeat = "joints"',
        'type = "move", repeat = "end"',
        "structs.segment.fields: a struct",
    ),
    "condition's form": (
        'when = "steps_dir >= 2"',
        'when = "steps_dir > 1"',
        "first_ticks.when: 'steps_dir > 1' is not of",
    ),
    "condition on nothing": (
        'when = "steps_dir >= 2"',
        'when = "speed >= 2"',
        "'speed' is no plain number that always stands",
    ),
    "condition on a condition": (
        'when = "steps_dir >= 4"',
        'when = "first_ticks >= 4"',
        "'first_ticks' is no plain number",
    ),
    "enumeration": ('enum = "states"', 'enum = "moods"', "messages.status.state.enum: 'moods' is none of"),
    "payload too long": (
        "repeat = 3",
        "repeat = 30",
        "messages.welcome: more bytes with 4 joints than framing.max_payload_bytes",
    ),
    "not a table": (
        'idle = { code = 0, doc = "drivers released',
        'other = 1\nidle = { code = 0, doc = "drivers released',
        "states.other: not",
    ),
    "no TOML": ("[protocol]", "[protocol", "messages.toml: Expected"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_an_error_that_names_its_place(mistake: str) -> None:
    old, new, message = MISTAKES[mistake]
    with pytest.raises(SpecError, match=re.escape(message)):
        parse_spec(changed(old, new))


def test_wording_leaves_the_hash_as_it_is_and_everything_else_changes_it() -> None:
    before = load_spec().spec_hash
    for old, new in (
        ('doc = "1 or 0"', 'doc = "one or zero"'),
        ('text = "done"', 'text = "did it"'),
        ("fix = ", "fix = "),
    ):
        assert parse_spec(changed(old, new)).spec_hash == before
    for old, new in (
        ("version = 2\n", "version = 3\n"),
        ('unit = "ticks"', 'unit = "us"'),
        ("value = 320", "value = 321"),
        ("initial 0xFFFF", "initial 0x0000"),
    ):
        assert parse_spec(changed(old, new)).spec_hash != before


def test_the_hash_is_the_one_told_in_the_page() -> None:
    # printf '{"a":[1,{"c":"x"}],"b":true}' | sha256sum begins with f9324011
    data = tomllib.loads('b = true\ndoc = "left out"\na = [1, {c = "x", text = "left out", fix = ""}]')
    assert spec_hash(data).to_bytes(4, "little").hex() == "f9324011"


def test_a_missing_specification_says_where_it_belongs(tmp_path) -> None:
    with pytest.raises(SpecError, match="belongs to the source tree and is not installed"):
        load_spec(tmp_path / "messages.toml")
