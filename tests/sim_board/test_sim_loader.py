"""Program files. The records are built here from the formats' definitions, by other code than the readers'."""

import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim.errors import ImageError
from planarm_sim.loader import FLASH_BYTES, load_elf, load_hex, load_image
from planarm_sim.loader.elf import parse_elf
from planarm_sim.loader.intel_hex import parse_hex

DATA = Path(__file__).parent / "data"
END = ":00000001FF"


def record(kind: int, address: int, data: bytes) -> str:
    raw = bytes([len(data), address >> 8, address & 0xFF, kind]) + data
    return f":{raw.hex().upper()}{256 - sum(raw) % 256 & 0xFF:02X}"


def hex_error(*lines: str) -> str:
    with pytest.raises(ImageError) as caught:
        parse_hex("\n".join(lines), "arm.hex")
    return str(caught.value)


# --- Intel HEX ---


def test_example_record_of_the_specification_is_read():
    # Intel's own example of a data record: 16 bytes at 0x0100, checksum 0x40.
    image = parse_hex(f":10010000214601360121470136007EFE09D2190140\n{END}\n", "arm.hex")
    assert image.flash[0x100:0x110] == bytes.fromhex("214601360121470136007EFE09D21901")
    assert image.used_bytes == 16
    assert set(image.flash[:0x100] + image.flash[0x110:]) == {0xFF}, "what the file does not name is erased"
    assert len(image.flash) == FLASH_BYTES == 32768


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=30),
    st.lists(st.integers(0, 300), min_size=30, max_size=30),
    st.randoms(use_true_random=False),
    st.sampled_from(["\n", "\r\n"]),
)
def test_what_is_written_is_read_back_in_any_record_order(pieces, gaps, random, line_end):
    flash, lines, at = bytearray(b"\xff" * FLASH_BYTES), [], 0
    for piece, gap in zip(pieces, gaps, strict=False):
        at += gap
        flash[at : at + len(piece)] = piece
        lines.append(record(0, at, piece))
        at += len(piece)
    random.shuffle(lines)
    image = parse_hex(line_end.join([*lines, END]), "arm.hex")
    assert image.flash == bytes(flash)
    assert image.used_bytes == sum(map(len, pieces))


@pytest.mark.parametrize(("kind", "value"), [(2, 0x0400), (4, 0)])
def test_extended_addresses_move_the_base(kind, value):
    base = value * 16 if kind == 2 else value << 16
    image = parse_hex("\n".join([record(kind, 0, value.to_bytes(2, "big")), record(0, 8, b"ab"), END]), "arm.hex")
    assert image.flash[base + 8 : base + 10] == b"ab"


def test_start_addresses_are_dropped_and_blank_lines_and_small_letters_are_allowed():
    text = "\n".join([record(3, 0, bytes(4)), "", record(0, 0, b"\xab\xcd").lower(), record(5, 0, bytes(4)), END])
    assert parse_hex(text, "arm.hex").flash[:2] == b"\xab\xcd"


@settings(deadline=None, max_examples=80)
@given(st.binary(min_size=1, max_size=20), st.data())
def test_any_single_wrong_digit_is_noticed(data, draw):
    line = record(0, 0x40, data)
    at = draw.draw(st.integers(1, len(line) - 1))
    digit = draw.draw(st.sampled_from("0123456789ABCDEF").filter(lambda d: d != line[at]))
    assert "line 1" in hex_error(line[:at] + digit + line[at + 1 :], END)


def test_a_wrong_checksum_names_both_values():
    assert hex_error(END, END) == "arm.hex, line 2: a record after the end-of-file record"
    damaged = record(0, 0, b"\x01")[:-2] + "00"
    assert hex_error(damaged, END) == "arm.hex, line 1: checksum 0x00, should be 0xFE; the file is damaged"


def test_bytes_past_the_flash_name_line_address_and_limit():
    message = hex_error(record(0, 0x7FF8, bytes(8)), record(0, 0x7FFF, bytes(2)), END)
    assert "line 2" in message
    assert "0x7FFF to 0x8000" in message
    assert "32768" in message
    assert "line 2" in hex_error(record(4, 0, b"\x00\x01"), record(0, 0, b"\x01"), END), "64 KiB lies past it, too"


def test_bytes_given_twice_name_both_lines():
    message = hex_error(record(0, 0, b"abcd"), record(0, 8, b"x"), record(0, 3, b"yz"), END)
    assert message == "arm.hex, line 3: byte 0x0003 was already given by line 1"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "end-of-file record"),
        ([record(0, 0, b"ab")], "end-of-file record"),
        ([END], "holds no program bytes"),
        (["10010000"], "line 1"),
        ([":0000000", END], "line 1"),
        ([record(0, 0, b"ab") + "00", END], "announces 2 data bytes and holds 3"),
        ([record(6, 0, b""), END], "type 06"),
        ([record(4, 0, b"\x00"), END], "type 04 holds 2 data bytes, not 1"),
        ([record(2, 5, b"\x00\x00"), END], "address 0x0000, not 0x0005"),
        ([record(1, 0, b"\x00")], "type 01 holds 0 data bytes, not 1"),
        ([record(0, 0xFFFF, b"ab"), END], "0xFFFF"),
    ],
)
def test_every_deviation_from_the_format_is_refused(lines, words):
    assert words in hex_error(*lines)


def test_a_missing_or_binary_hex_file_is_named(tmp_path: Path):
    with pytest.raises(ImageError, match=r"nothing\.hex: cannot be read: No such file"):
        load_hex(tmp_path / "nothing.hex")
    binary = tmp_path / "binary.hex"
    binary.write_bytes(b":00\xff")
    with pytest.raises(ImageError, match="byte 3 is 0xFF"):
        load_hex(binary)


# --- ELF ---


def elf(
    segments: list[tuple[int, bytes, int]],
    *,
    machine: int = 83,
    family: int = 5,
    kind: int = 2,
    elf_class: int = 1,
    sections: list[tuple[str, bytes]] | None = None,
) -> bytes:
    """An ELF32 file: header, program headers, contents, sections with their names (TIS ELF 1.2, book I).

    Segments are (load address, content, virtual address); each is also a section .sN.
    """
    extra = sections or []
    at = 52 + 32 * len(segments)
    body, programs, table = b"", b"", [("", 0, 0, 0)]
    for index, (load, content, virtual) in enumerate(segments):
        programs += struct.pack("<8I", 1, at + len(body), virtual, load, len(content), len(content), 5, 2)
        table.append((f".s{index}", 1, at + len(body), len(content)))
        body += content
    for name, content in extra:
        table.append((name, 7, at + len(body), len(content)))
        body += content
    names = b""
    offsets = []
    for name, *_ in [*table, (".names",)]:
        offsets.append(len(names))
        names += name.encode() + b"\0"
    table.append((".names", 3, at + len(body), len(names)))
    body += names
    headers = b"".join(
        struct.pack("<10I", offset, section_kind, 0, 0, where, size, 0, 0, 1, 0)
        for offset, (_, section_kind, where, size) in zip(offsets, table, strict=True)
    )
    ident = b"\x7fELF" + bytes([elf_class, 1, 1]) + bytes(9)
    head = struct.pack(
        "<HHIIIIIHHHHHH", kind, machine, 1, 0, 52, at + len(body), family, 52, 32, len(segments), 40, len(table),
        len(table) - 1,
    )  # fmt: skip
    return ident + head + programs + body + headers


def elf_error(data: bytes) -> str:
    with pytest.raises(ImageError) as caught:
        parse_elf(data, "arm.elf")
    return str(caught.value)


def device_note(name: bytes) -> list[tuple[str, bytes]]:
    return [(".note.gnu.avr.deviceinfo", struct.pack("<III4s", 4, 16, 1, b"AVR\0") + b"\0" + name + b"\0\0\0")]


def test_segments_go_to_their_load_addresses_and_memory_beside_flash_is_left_out():
    code, data, eeprom = b"\x0c\x94" * 20, b"start values", b"ee"
    file = elf([(0, code, 0), (40, data, 0x800100), (0x810000, eeprom, 0x810000)], sections=device_note(b"atmega328p"))
    image = parse_elf(file, "arm.elf")
    assert image.flash[:52] == code + data
    assert set(image.flash[52:]) == {0xFF}
    assert image.used_bytes == 52


def test_a_program_for_another_chip_is_refused():
    assert "machine 40" in elf_error(elf([(0, b"ab", 0)], machine=40)), "ARM"
    assert "ELF class 2" in elf_error(elf([(0, b"ab", 0)], elf_class=2))
    assert "family 6" in elf_error(elf([(0, b"ab", 0)], family=6)), "ATmega2560"
    message = elf_error(elf([(0, b"ab", 0)], sections=device_note(b"atmega644p")))
    assert message == "arm.elf, section .note.gnu.avr.deviceinfo: built for atmega644p, not for an atmega328p"


def test_an_image_too_large_names_section_and_limit():
    message = elf_error(elf([(0, bytes(100), 0), (0x7FF0, bytes(17), 0x7FF0)]))
    assert "section .s1" in message
    assert "0x7FF0 to 0x8000" in message
    assert "32768" in message


def test_overlapping_sections_are_refused_by_name():
    assert elf_error(elf([(0, b"abcd", 0), (2, b"x", 2)])) == (
        "arm.elf, section .s1: byte 0x0002 was already given by section .s0"
    )


def test_objects_empty_programs_and_other_files_are_refused():
    assert "link it first" in elf_error(elf([(0, b"ab", 0)], kind=1))
    assert "holds no program bytes" in elf_error(elf([]))
    assert "starts with b'MZ" in elf_error(b"MZ\0\0" + bytes(60))


@settings(deadline=None, max_examples=60)
@given(st.floats(0, 1, exclude_max=True))
def test_a_file_cut_off_anywhere_is_refused(share):
    whole = elf([(0, b"program bytes", 0)], sections=device_note(b"atmega328p"))
    message = elf_error(whole[: int(len(whole) * share)])
    assert message.startswith("arm.elf")


def test_first_bytes_tell_the_kind_of_file(tmp_path: Path):
    as_elf, as_hex = tmp_path / "a.bin", tmp_path / "b.bin"
    as_elf.write_bytes(elf([(0, b"same", 0)]))
    as_hex.write_text(f"{record(0, 0, b'same')}\n{END}\n")
    assert load_image(as_elf).flash == load_image(as_hex).flash == load_elf(as_elf).flash
    assert load_image(as_elf).source == str(as_elf)


# --- what avr-gcc makes ---


@pytest.fixture(scope="module")
def compiled(tmp_path_factory) -> bytes:
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed (Debian: gcc-avr, avr-libc)")
    elf = tmp_path_factory.mktemp("elf") / "a.elf"
    source = "static int f(int n) { return n; } int g(void) { return f(2); } int main(void) { return g(); }"
    command = ["avr-gcc", "-mmcu=atmega328p", "-O0", "-g", "-x", "c", "-", "-o", elf]
    subprocess.run(command, input=source.encode(), check=True, timeout=60)
    return elf.read_bytes()


def test_functions_come_with_their_names(compiled):
    symbols = parse_elf(compiled, "a.elf").symbols
    named = {symbol.name: symbol for symbol in symbols}
    assert {"main", "f", "g", "__vectors"} <= set(named)
    assert not any(name.startswith(("__ctors", "__dtors", "__trampolines", "_etext")) for name in named)
    assert [s.address for s in symbols] == sorted({s.address for s in symbols})
    assert named["f"].address + named["f"].size == named["g"].address


@settings(deadline=None, max_examples=300)
@given(st.data())
def test_a_damaged_elf_file_is_read_or_refused_by_name(compiled, data):
    damaged = bytearray(compiled)
    tables = st.integers(len(compiled) - 40 * 25, len(compiled) - 1)  # section headers stand at the end
    anywhere = st.integers(0, 200) | st.integers(0, len(compiled) - 1) | tables
    for place in data.draw(st.lists(anywhere, min_size=1, max_size=5)):
        damaged[place] = data.draw(st.sampled_from([0, 1, 0x7F, 0xFF]) | st.integers(0, 255))
    try:
        image = parse_elf(bytes(damaged), "a.elf")
    except ImageError as error:
        assert "a.elf" in str(error)
    else:
        assert len(image.flash) == FLASH_BYTES


@pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed: the test programs are not rebuilt"
)
@pytest.mark.parametrize("name", ["echo", "pulses", "unmodelled"])
def test_elf_and_hex_of_avr_gcc_are_the_kept_program(tmp_path: Path, name):
    built = tmp_path / f"{name}.elf"
    flags = ["-mmcu=atmega328p", "-nostdlib", "-Wl,-e,main"]
    subprocess.run(["avr-gcc", *flags, "-o", built, DATA / f"{name}.S"], check=True)
    subprocess.run(["avr-objcopy", "-O", "ihex", built, tmp_path / f"{name}.hex"], check=True)
    kept = load_hex(DATA / f"{name}.hex")
    assert load_elf(built).flash == kept.flash, "run make in tests/sim_board/data"
    assert load_hex(tmp_path / f"{name}.hex").flash == kept.flash


@pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed: nothing to build for another chip"
)
def test_a_program_built_for_another_chip_is_refused(tmp_path: Path):
    source, built = tmp_path / "main.c", tmp_path / "main.elf"
    source.write_text("int main(void) { return 0; }")
    for part, words in (("atmega644p", "built for atmega644p"), ("atmega2560", "AVR family 6")):
        subprocess.run(["avr-gcc", f"-mmcu={part}", "-o", built, source], check=True)
        with pytest.raises(ImageError, match=words):
            load_elf(built)
