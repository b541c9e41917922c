"""Codes of everything that can go wrong: errors, checks of the certificate, the device's faults and refusals.

========  ==========================================================================
``E202``  an exception of `planarm.errors`; its first digit is the exit code
``C12``   a check of the certificate
``F2``    a fault that the device latched, by its number on the wire
``R3``    a refusal of the device, by its number on the wire without the minus
========  ==========================================================================
"""

from __future__ import annotations

import difflib
import re
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources

from planarm.errors import UsageError
from planarm_wire.messages import FAULT_WORDS, RESULT_WORDS, Fault, Result

_JOINT = re.compile(r"^joint \d+ ")


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a code means.

    Attributes:
        code: such as E202.
        title: what it is, in a few words; of a check its name.
        cause: why it comes.
        fix: what helps.
    """

    code: str
    title: str
    cause: str
    fix: str


@cache
def explanations() -> dict[str, Explanation]:
    """Return every explanation by its code: errors, checks, faults, refusals."""
    told = tomllib.loads(resources.files("planarm").joinpath("explanations.toml").read_text(encoding="utf-8"))
    found = [Explanation(e["code"], e["title"], e["cause"], e["fix"]) for e in told["errors"]]
    found += [Explanation(c["code"], c["name"], c["cause"], c["fix"]) for c in told["checks"]]
    found += [
        Explanation(f"F{fault.value}", f"Fault: {_word(fault.name)}", _sentence(words[0]), _sentence(words[1]))
        for fault, words in FAULT_WORDS.items()
        if fault is not Fault.NONE
    ]
    found += [
        Explanation(f"R{-result.value}", f"Refusal: {_word(result.name)}", _sentence(words[0]), _sentence(words[1]))
        for result, words in RESULT_WORDS.items()
        if result.value < Result.OK
    ]
    return {explanation.code: explanation for explanation in found}


def check_code(name: str) -> str:
    """Return the code of a check of the certificate by its name, which may name a joint; "" if none has it."""
    bare = _JOINT.sub("", name)
    return next((e.code for e in explanations().values() if e.code[0] == "C" and _names(e.title, bare)), "")


def explain(asked: str) -> Explanation:
    """Return the explanation of a code, or of a title or fault's name.

    Raises:
        UsageError: nothing has this code or title; the message names the nearest.
    """
    known = explanations()
    by_word = {code.lower(): e for code, e in known.items()}
    by_word |= {e.title.lower(): e for e in known.values()}
    by_word |= {e.title.split(": ")[-1].lower(): e for e in known.values()}
    word = _JOINT.sub("", asked.strip()).replace("_", " ").lower()
    if word not in by_word:
        near = difflib.get_close_matches(word, by_word, n=1, cutoff=0.5)
        meant = f"; did you mean {near[0].upper() if len(near[0]) < 5 else repr(near[0])}?" if near else ""
        raise UsageError(f"nothing has the code {asked!r}{meant}; 'planarm explain' lists all")
    return by_word[word]


def _names(title: str, name: str) -> bool:
    """Tell whether a check's name is a title, or one with a circumstance behind it, such as ", 0.2 s late"."""
    return name == title or name.startswith(f"{title},")


def _word(name: str) -> str:
    return name.lower().replace("_", " ")


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + "." if words else ""
