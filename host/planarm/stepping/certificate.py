"""What a certificate is: checks of a finished plan, each with its value, its limit and the setting to change."""

from dataclasses import dataclass
from math import inf
from typing import Literal

Verdict = Literal["green", "amber", "red"]


@dataclass(frozen=True, slots=True)
class Check:
    """One check of a plan.

    Attributes:
        name: what is checked.
        value: what was found.
        limit: what it is held against.
        unit: of value and limit.
        verdict: green, amber (within the plan's rules, but worth a look) or red.
        where: time and place of the value, in words; empty when it belongs to the whole plan.
        setting: what to change in the scene when it is not green.
    """

    name: str
    value: float
    limit: float
    unit: str
    verdict: Verdict
    where: str
    setting: str


@dataclass(frozen=True, slots=True)
class Certificate:
    """All checks of one plan."""

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """True when there are checks and none is red."""
        return bool(self.checks) and all(check.verdict != "red" for check in self.checks)

    def explain(self) -> str:
        """Say what is wrong: each red check with place, value, limit and setting; or that all is well."""
        if self.ok:
            return f"all {len(self.checks)} checks hold"
        if not self.checks:
            return "the plan carries no checks; make it anew"
        return "; ".join(_sentence(check) for check in self.checks if check.verdict == "red")


def at_most(
    name: str,
    value: float,
    limit: float,
    unit: str,
    where: str = "",
    setting: str = "",
    rounding: float = 0.0,
    amber: float = inf,
) -> Check:
    """Return a check that is red where the value exceeds the limit by more than rounding, amber above `amber`.

    NaN is red.
    """
    verdict: Verdict = "red" if not value <= limit + rounding else "amber" if value > amber else "green"
    return Check(name, float(value), float(limit), unit, verdict, where, setting)


def at_least(
    name: str, value: float, limit: float, unit: str, where: str = "", setting: str = "", amber: float = -inf
) -> Check:
    """Return a check that is red where the value falls below the limit, amber below `amber`; NaN is red."""
    verdict: Verdict = "red" if not value >= limit else "amber" if value < amber else "green"
    return Check(name, float(value), float(limit), unit, verdict, where, setting)


def _sentence(check: Check) -> str:
    place = f" at {check.where}" if check.where else ""
    advice = f"; change {check.setting}" if check.setting else ""
    return f"{check.name} is {check.value:.6g} {check.unit}, limit {check.limit:.6g}{place}{advice}"
