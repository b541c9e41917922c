"""The summary's table: every entry on a line of its own, with the unit of its key."""

import io

import numpy as np
from rich.console import Console

from planarm.report.tables import summary_table


def printed(summary: dict) -> list[str]:
    console = Console(file=io.StringIO(), width=100)
    console.print(summary_table(summary))
    return [" ".join(line.split()) for line in console.file.getvalue().splitlines() if line.strip()]


def test_units_come_from_the_keys() -> None:
    assert printed(
        {
            "scene": "Table I, case 1",
            "path_length_cm": 68.984271,
            "search_ms": 12.0,
            "net_usteps": [5310, -12],
            "bytes_sent": 43210,
            "min_pulse_high_us": np.float64(2.5),
            "s": 3,
            "line_asked_bytes_s": 1432.3,
            "max_acceleration_rad_s2": 20.5,
        }
    ) == [
        "scene Table I, case 1",
        "path length 68.9843 cm",
        "search 12 ms",
        "net 5,310 / -12 micro-steps",
        "bytes sent 43,210",
        "min pulse high 2.5 µs",
        "s 3",
        "line asked 1432.3 bytes/s",
        "max acceleration 20.5 rad/s²",
    ]


def test_truth_nothing_and_inner_tables() -> None:
    assert printed(
        {"certificate_ok": True, "ok": False, "max_jitter_ticks": None, "empty": [], "link": {"baud": 250000}}
    ) == [
        "certificate ok yes",
        "ok no",
        "max jitter not measured",
        "empty none",
        "link: baud 250,000",
    ]


def test_brackets_in_values_are_no_markup() -> None:
    assert printed({"port": "[red]COM3[/red]"}) == ["port [red]COM3[/red]"]


def test_mappings_in_a_list_are_a_line_of_words_each() -> None:
    held = [
        {"joint": 1, "limit": "speed", "share_of_time": 0.61},
        {"joint": 2, "limit": "torque", "share_of_time": 0.2},
    ]
    assert printed({"binding_limits": held}) == [
        "binding limits joint 1, limit speed, share of time 0.61",
        "joint 2, limit torque, share of time 0.2",
    ]
