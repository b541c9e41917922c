"""Dynamics of n rigid links in a plane, in the links' absolute directions phi.

Link i points in direction phi_i = q_1 + ... + q_i. Point masses and rods seen from the base give, with
p_i = base + sum_{k<i} l_k e(phi_k) + c_i e(phi_i), the kinetic energy

    T = 1/2 sum_ij A_ij cos(phi_i - phi_j) phi'_i phi'_j

with A_ij = l_i (m_j c_j + l_j sum_{k>j} m_k) for i < j, every end mass counted like a mass at its link's outer end, and
A_ii = I_i + m_i c_i^2 + l_i^2 sum_{k>i} m_k. Lagrange's equations of that are

    sum_j A_ij cos(phi_i - phi_j) phi''_j = Q_i - sum_j A_ij sin(phi_i - phi_j) phi'_j^2 - g B_i cos phi_i

with B_i = m_i c_i + l_i sum_{k>i} m_k. No mass matrix is differentiated, and no Christoffel symbol is needed. A torque
tau_i of joint i turns link i and holds against link i - 1: Q_i = tau_i - tau_{i+1}.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there
from planarm_sim.plant.spec import Link

Floats = NDArray[np.float64]


def inertia_constants(links: Sequence[Link]) -> tuple[Floats, Floats]:
    """Return A, shape (n, n), and B, shape (n,), of the module's text."""
    n = len(links)
    lengths = [link.length_m for link in links]
    beyond = [links[i].end_mass_kg + sum(k.mass_kg + k.end_mass_kg for k in links[i + 1 :]) for i in range(n)]
    first = np.array([links[i].mass_kg * links[i].com_m + lengths[i] * beyond[i] for i in range(n)])
    a = np.zeros((n, n))
    for i, link in enumerate(links):
        a[i, i] = link.inertia_kg_m2 + link.mass_kg * link.com_m**2 + lengths[i] ** 2 * beyond[i]
        for j in range(i + 1, n):
            a[i, j] = a[j, i] = lengths[i] * first[j]
    return a, first


@inner
def mass_matrix(a: Floats, phi: Floats, out: Floats) -> None:
    """Write A_ij cos(phi_i - phi_j)."""
    n = len(phi)
    for i in range(n):
        out[i, i] = a[i, i]
        for j in range(i):
            out[i, j] = out[j, i] = a[i, j] * np.cos(phi[i] - phi[j])


@inner
def add_inertia_torques(a: Floats, b: Floats, gravity: float, phi: Floats, dphi: Floats, out: Floats) -> None:
    """Subtract what speeds and gravity ask for from the torques `out` on the directions."""
    n = len(phi)
    for i in range(n):
        for j in range(i):
            s = a[i, j] * np.sin(phi[i] - phi[j])
            out[i] -= s * dphi[j] * dphi[j]
            out[j] += s * dphi[i] * dphi[i]
        if gravity != 0.0:
            out[i] -= gravity * b[i] * np.cos(phi[i])


@inner
def solve_in_place(m: Floats, x: Floats) -> None:
    """Replace x by m^-1 x by Cholesky's method; m, positive definite, is overwritten by its factor."""
    n = len(x)
    for j in range(n):
        for k in range(j):
            m[j, j] -= m[j, k] * m[j, k]
        m[j, j] = np.sqrt(m[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                m[i, j] -= m[i, k] * m[j, k]
            m[i, j] /= m[j, j]
    substitute(m, x)


@inner
def substitute(factor: Floats, x: Floats) -> None:
    """Replace x by (factor factor^T)^-1 x."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]


@kernel
def energy_j(a: Floats, b: Floats, gravity: float, phi: Floats, dphi: Floats) -> float:
    """Return kinetic and potential energy; the latter is 0 with all links level."""
    n = len(phi)
    total = 0.0
    for i in range(n):
        total += gravity * b[i] * np.sin(phi[i])
        for j in range(n):
            total += 0.5 * a[i, j] * np.cos(phi[i] - phi[j]) * dphi[i] * dphi[j]
    return total
