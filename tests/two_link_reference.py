"""The equation of motion of a two-link arm, derived anew by SymPy from its energies: no line is the plant's."""

import functools

import numpy as np
import sympy
from scipy.integrate import solve_ivp


@functools.cache
def lagrange():
    """Return functions M(q, p) and h(q, q', p) of M q'' + h = tau; p: l1 l2 m1 m2 c1 c2 i1 i2 e1 e2 g."""
    t = sympy.Symbol("t")
    p = sympy.symbols("l1 l2 m1 m2 c1 c2 i1 i2 e1 e2 g")
    l1, l2, m1, m2, c1, c2, i1, i2, e1, e2, g = p
    q = [sympy.Function(f"q{k}")(t) for k in (1, 2)]
    place = sympy.zeros(2, 1)
    kinetic = potential = sympy.Integer(0)
    heading = sympy.Integer(0)
    for angle, length, mass, com, inertia, end in ((q[0], l1, m1, c1, i1, e1), (q[1], l2, m2, c2, i2, e2)):
        heading += angle
        along = sympy.Matrix([sympy.cos(heading), sympy.sin(heading)])
        for point, weight in ((place + com * along, mass), (place + length * along, end)):
            velocity = point.diff(t)
            kinetic += weight * (velocity.T * velocity)[0] / 2
            potential += weight * g * point[1]
        kinetic += inertia * heading.diff(t) ** 2 / 2
        place += length * along
    lagrangian = kinetic - potential
    rates, accelerations = [a.diff(t) for a in q], [a.diff(t, 2) for a in q]
    equations = [
        sympy.expand(lagrangian.diff(rate).diff(t) - lagrangian.diff(a)) for rate, a in zip(rates, q, strict=True)
    ]
    plain = sympy.symbols("x1 x2 v1 v2 a1 a2")
    names = dict(zip((*accelerations, *rates, *q), (*plain[4:], *plain[2:4], *plain[:2]), strict=True))
    equations = [e.subs(names) for e in equations]
    mass = sympy.Matrix(2, 2, lambda i, j: equations[i].diff(plain[4 + j]))
    rest = sympy.Matrix([e.subs({plain[4]: 0, plain[5]: 0}) for e in equations])
    return sympy.lambdify((plain[:2], p), mass), sympy.lambdify((plain[:4], p), rest)


def swing(links, gravity, q, q_dot, times_s):
    """Return angles and speeds of the free arm at the times, shape (n, 4), by a high-order integrator."""
    mass, rest = lagrange()
    one, two = links
    p = (one.length_m, two.length_m, one.mass_kg, two.mass_kg, one.com_m, two.com_m)
    p = (*p, one.inertia_kg_m2, two.inertia_kg_m2, one.end_mass_kg, two.end_mass_kg, gravity)

    def slope(_t, y):
        return np.concatenate([y[2:], np.linalg.solve(mass(y[:2], p), -rest(y, p).ravel())])

    end = float(times_s[-1])
    solution = solve_ivp(slope, (0.0, end), [*q, *q_dot], "DOP853", times_s, rtol=1e-13, atol=1e-13)
    return solution.y.T
