"""A two-phase hybrid stepper: currents by an ideal chopper, torque by the rotor's place in the magnetic field.

With N = steps_per_rev / 4 rotor teeth, theta the rotor's angle, k the torque constant:

    torque = k (i_b cos(N theta) - i_a sin(N theta)) - D sin(4 N theta)
    L i_a' = v_a - R i_a + k theta' sin(N theta),   L i_b' = v_b - R i_b - k theta' cos(N theta)

so currents i_a = I cos(phase), i_b = I sin(phase) pull the rotor to N theta = phase with k I sin(phase - N theta), and
it turns as far per electrical turn as four full steps. The chopper takes any voltage within the supply that brings the
current to its reference (decay modes and ripple are left out): at low speed the current is the reference, at high speed
supply, inductance and back-EMF keep it from getting there, and the torque falls. Without current the windings are open
as soon as their diodes have emptied them. (Acarnley, Stepping Motors, 4th ed., chapters 2 to 5.)
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there


@inner
def torque_nm(k: float, detent: float, current_a: float, current_b: float, sin: float, cos: float) -> float:
    """Return the torque on the rotor; `sin` and `cos` are those of N theta."""
    sin_2, cos_2 = 2.0 * sin * cos, cos * cos - sin * sin
    return k * (current_b * cos - current_a * sin) - detent * 2.0 * sin_2 * cos_2


@inner
def chopped(current: float, wanted: float, emf: float, supply: float, r: float, l_over_h: float) -> float:
    """Return a phase's current one step later: the wanted one, or as near as the supply can bring it.

    Args:
        current: now, A.
        wanted: the reference, A.
        emf: back-EMF that drives the current down, V.
        supply: the most that the driver can put on the phase, V.
        r: resistance, ohm.
        l_over_h: inductance by the length of the step, H/s.
    """
    scale = 1.0 / (l_over_h + r)
    highest = (l_over_h * current + supply - emf) * scale
    lowest = (l_over_h * current - supply - emf) * scale
    return min(max(wanted, lowest), highest)


@inner
def drained(current: float, emf: float, supply: float, r: float, l_over_h: float) -> float:
    """Return a phase's current one step later with the driver's outputs off: its diodes empty it, then it is open."""
    following = chopped(current, 0.0, emf, supply, r, l_over_h)
    return following if following * current > 0.0 else 0.0
