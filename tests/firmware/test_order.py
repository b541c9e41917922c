"""The order of the functions in the image leaves few jumps that take four bytes, and names no function that is gone."""

from __future__ import annotations

import importlib.util
import itertools
import re
import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware"

needs_avr_gcc = pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed (Debian: gcc-avr, avr-libc): no image is built"
)

needs_pio = pytest.mark.skipif(
    importlib.util.find_spec("platformio") is None or importlib.util.find_spec("SCons") is None,
    reason="platformio and scons are not installed: PlatformIO's build is not tried",
)


def code_bytes(elf: Path) -> int:
    told = subprocess.run(["avr-size", "-A", str(elf)], capture_output=True, text=True, check=True).stdout
    found = re.search(r"^\.text\s+(\d+)", told, re.M)
    assert found is not None
    return int(found[1])


@needs_avr_gcc
def test_every_name_in_the_order_is_a_function_of_an_image(orderer: ModuleType, tmp_path: Path) -> None:
    # Another compiler may inline other functions; its order is not searched.
    assert orderer.stale_names(orderer.link(tmp_path)) == [], "run firmware/order.py"


@needs_avr_gcc
def test_the_order_is_worth_having(orderer: ModuleType, uno_image: Path, tmp_path: Path) -> None:
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    (copy / "order.ld").write_text("", encoding="utf-8")
    elf = uno_image.with_suffix(".elf")
    objects = sorted(map(str, (uno_image.parent / "uno").rglob("*.o")))
    flags = [flag for flag in orderer.build.read_settings("uno")[0] if flag.startswith("-Wl,")]
    command = ["avr-g++", "-mmcu=atmega328p", *flags, "-o", str(tmp_path / "plain.elf"), *objects]
    subprocess.run(command, cwd=copy, check=True)
    graph = orderer.read_graph(elf)
    assert graph.far_jumps <= 40 and len(graph.jumps) > 400, "run firmware/order.py"
    assert code_bytes(tmp_path / "plain.elf") - code_bytes(elf) >= 400, "run firmware/order.py"


@needs_avr_gcc
@needs_pio
def test_platformio_links_again_when_the_order_changed(
    builder: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    monkeypatch.setattr(builder, "FIRMWARE", copy)
    image = tmp_path / "pio" / "build" / "uno" / "program.hex"
    assert "Linking" in builder.run_pio(tmp_path, "run", "-e", "uno")
    ordered = image.read_bytes()
    assert "Linking" not in builder.run_pio(tmp_path, "run", "-e", "uno")
    (copy / "order.ld").write_text("", encoding="utf-8")
    assert "Linking" in builder.run_pio(tmp_path, "run", "-e", "uno")
    assert image.read_bytes() != ordered


@needs_avr_gcc
def test_far_jumps_are_those_that_the_linker_made(orderer: ModuleType, uno_image: Path) -> None:
    # The model that the search goes by against the listing. Jumps of exactly 4 KB may differ, as the linker shortens
    # from the start of the image to its end.
    graph = orderer.read_graph(uno_image.with_suffix(".elf"))
    order = list(graph.sizes)  # as they lie
    modelled = orderer.Layout(graph, order).far_jumps(range(1, len(order) + 1))
    assert abs(modelled - graph.far_jumps) <= 1


def test_the_search_brings_callers_and_callees_together(orderer: ModuleType) -> None:
    # Four groups of six kilobytes each, mixed by their names: in the best order a jump is far within a group only, from
    # its first function to its last and back.
    groups = [[f"{number}{group}" for number in range(4)] for group in "abcd"]
    jumps = [orderer.Jump(f, 10, to, 0, True) for group in groups for f, to in itertools.permutations(group, 2)]
    names = sorted(itertools.chain(*groups))
    graph = orderer.Graph(100, dict.fromkeys(names, 1536), tuple(jumps))
    assert orderer.Layout(graph, names).far_jumps(range(1, 17)) == 48
    found = orderer.find_order([graph], names, tries=20_000)
    assert sorted(found) == names
    assert orderer.Layout(graph, found).far_jumps(range(1, 17)) == 8
    assert found == orderer.find_order([graph], names, tries=20_000)


def test_an_order_that_lacks_functions_and_names_others_is_completed(orderer: ModuleType) -> None:
    graph = orderer.Graph(0, {"a": 2, "b": 2, "c": 2}, ())
    assert sorted(orderer.find_order([graph], ["gone", "c"], tries=10)) == ["a", "b", "c"]
