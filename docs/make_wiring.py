"""Draw the wirings of docs/wiring.toml: `python docs/make_wiring.py [FOLDER]`, one SVG each.

The Uno is on the left with the pins that are used, in the order of its wires; the parts are on the right. A wire that
is to be added to a shield is dashed. The motor supply's line goes up the right side, through the emergency stop's
contact.
"""

import sys
import tomllib
from html import escape
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
WIDTH, ROW, TOP = 800, 26, 64
UNO_X, UNO_WIDTH, PART_X, PART_WIDTH = 24, 110, 430, 186
COLOURS = {"STEP": "#0b6fb8", "DIR": "#b8620b", "ENABLE": "#5b6770", "GND": "#222"}
SUPPLY = "#b3202c"
SUPPLY_FROM = "motor supply +"
RAIL_X = PART_X + PART_WIDTH + 26
OTHER = "#3d8a4e"
STYLE = "font-family: sans-serif; font-size: 14px"


def make_wiring(folder: Path) -> list[Path]:
    """Write all drawings into the folder and return their files."""
    wirings = tomllib.loads((DOCS / "wiring.toml").read_text(encoding="utf-8"))
    files = []
    for name, wiring in wirings.items():
        files.append(folder / f"wiring_{name}.svg")
        files[-1].write_text(draw(wiring), encoding="utf-8", newline="\n")
    return files


def draw(wiring: dict[str, Any]) -> str:
    """Return one wiring as SVG."""
    places, boxes, y = {}, [], TOP
    for part in wiring["parts"]:
        height = ROW * len(part["pins"]) + 30
        boxes.append(_box(PART_X, y, PART_WIDTH, height, part["name"]))
        for row, pin in enumerate(part["pins"]):
            at = y + 38 + ROW * row
            places[f"{part['name']} {pin}"] = at
            boxes.append(_text(PART_X + 14, at + 5, pin))
        y += height + 18
    wires = sorted(wiring["wires"], key=lambda wire: places[wire["to"]])
    pins = list(dict.fromkeys(wire["from"] for wire in wires))
    step = (y - 18 - TOP - 60) / max(1, len(pins) - 1)
    pin_at = {pin: TOP + 44 + step * row for row, pin in enumerate(pins)}
    boxes.append(_box(UNO_X, TOP, UNO_WIDTH, y - 18 - TOP, "Uno"))
    boxes += [_text(UNO_X + UNO_WIDTH - 14, at + 5, pin, "end") for pin, at in pin_at.items()]
    lines = [_wire(pin_at[wire["from"]], places[wire["to"]], wire) for wire in wires]
    lines += _supply(places[SUPPLY_FROM], [places[place] for place in wiring["supplied"]])
    height = y + 8
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
    title = f'<text x="{UNO_X}" y="36" font-size="18" font-weight="bold">{escape(wiring["title"])}</text>'
    paper = f'<rect width="{WIDTH}" height="{height}" fill="white"/>'
    return "\n".join([f'{head} style="{STYLE}">', paper, title, *lines, *boxes, "</svg>\n"])


def _box(x: float, y: float, width: float, height: float, name: str) -> str:
    frame = f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="none" stroke="#222"/>'
    return f'{frame}\n<text x="{x + width / 2:g}" y="{y + 20}" text-anchor="middle" fill="#555">{escape(name)}</text>'


def _text(x: float, y: float, words: str, anchor: str = "start") -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}">{escape(words)}</text>'


def _wire(from_y: float, to_y: float, wire: dict[str, Any]) -> str:
    colour = next((colour for word, colour in COLOURS.items() if wire["to"].endswith(word)), OTHER)
    dashes = ' stroke-dasharray="7 5"' if wire.get("added") else ""
    begin, end = UNO_X + UNO_WIDTH, PART_X
    middle = (begin + end) / 2
    path = f"M {begin} {from_y:g} C {middle:g} {from_y:g} {middle:g} {to_y:g} {end} {to_y:g}"
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2.5"{dashes}/>'


def _supply(from_y: float, to_ys: list[float]) -> list[str]:
    """The line from the supply to each place, and an opened contact just above the supply."""
    edge, contact = PART_X + PART_WIDTH, from_y - 12
    stroke = f'fill="none" stroke="{SUPPLY}" stroke-width="2.5"'
    lines = [f'<path d="M {edge} {from_y:g} H {RAIL_X} V {contact:g}" {stroke}/>']
    lines.append(f'<path d="M {RAIL_X} {contact:g} l 12 -20" {stroke}/>')
    lines.append(f'<path d="M {RAIL_X} {contact - 22:g} V {min(to_ys):g}" {stroke}/>')
    lines += [f'<path d="M {RAIL_X} {y:g} H {edge}" {stroke}/>' for y in to_ys]
    return [*lines, _text(RAIL_X + 20, contact - 14, "emergency"), _text(RAIL_X + 20, contact + 4, "stop's contact")]


if __name__ == "__main__":
    make_wiring(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images")
