"""Equation of motion of a planar arm with n links: D(q) q'' + q'^T C(q) q' + G(q) = tau (paper A, eq. 1, corrected).

The paper's q'^T C q' stands for one Christoffel matrix a row (docs/errata.md); `christoffel` gives all of them.

Derivation, with each link's heading phi_k = q_1 + ... + q_k as coordinates. A point mass m at a_1 along link 1, ...,
a_n along link n has the velocity sum over k of a_k phi_k' e'(phi_k), so that the kinetic energy of all masses is

    T = 1/2 sum over j, k of A_jk cos(phi_j - phi_k) phi_j' phi_k',   A_jk = sum over masses of m a_j a_k,

with each link's moment of inertia about its centre of mass added to A_kk. Lagrange's equations are then

    f_j = sum over k of A_jk (cos(phi_j - phi_k) phi_k'' + sin(phi_j - phi_k) phi_k'^2) - w_j g . e'(phi_j),

with w_j = sum of m a_j and the gravity vector g. The torque of joint i moves all headings from i on: tau_i = sum over
j >= i of f_j. Everything is O(n^2).
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.scene import Scene
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

STANDARD_GRAVITY_M_S2 = 9.80665
M_PER_CM = 0.01


class RigidBody(NamedTuple):
    """An arm's masses as kernels read them."""

    products_kg_m2: Floats
    """A of the module's text, shape (n, n), symmetric."""
    moments_kg_m: Floats
    """w of the module's text, shape (n,)."""
    gravity_m_s2: Floats
    """Gravity's (x, y), shape (2,); zero for an arm that lies flat."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Return the arm of a scene: links, masses at their ends, payload, gravity."""
        mechanics = scene.mechanics
        lengths_m = M_PER_CM * np.array(scene.arm.link_lengths_cm)
        return cls.from_links(
            lengths_m,
            mechanics.link_masses_kg,
            lengths_m * mechanics.link_com_share,
            mechanics.link_inertias_kg_m2,
            mechanics.end_masses_kg,
            (0.0, -STANDARD_GRAVITY_M_S2 if mechanics.gravity else 0.0),
        )

    @classmethod
    def from_links(
        cls,
        lengths_m: ArrayLike,
        masses_kg: ArrayLike,
        centres_m: ArrayLike,
        inertias_kg_m2: ArrayLike,
        end_masses_kg: ArrayLike = 0.0,
        gravity_m_s2: tuple[float, float] = (0.0, 0.0),
    ) -> Self:
        """Return the arm with these links, from the base; every array has shape (n,).

        Args:
            lengths_m: from joint to joint.
            masses_kg: of the links.
            centres_m: distance of each link's centre of mass from its inner joint, along the link.
            inertias_kg_m2: about each link's own centre of mass.
            end_masses_kg: point masses at the links' outer ends; the last is the payload.
            gravity_m_s2: gravity's (x, y).
        """
        lengths = np.asarray(lengths_m, np.float64)
        count = len(lengths)
        before = np.tril(np.broadcast_to(lengths, (count, count)), -1)  # row i: how far link i is carried by each link
        levers = np.concatenate([before + np.diag(np.asarray(centres_m, np.float64)), before + np.diag(lengths)])
        ends = np.broadcast_to(np.asarray(end_masses_kg, np.float64), (count,))
        masses = np.concatenate([np.asarray(masses_kg, np.float64), ends])
        products = levers.T @ (masses[:, None] * levers) + np.diag(np.asarray(inertias_kg_m2, np.float64))
        return cls(products, masses @ levers, np.array(gravity_m_s2, np.float64))


@kernel
def inertia_matrix(body: RigidBody, q_rad: Floats) -> Floats:
    """Return D(q) in kg m^2, shape (n, n), for angles of shape (n,)."""
    phi = np.cumsum(q_rad)
    count = phi.shape[0]
    d = np.zeros((count, count))
    for i in range(count - 1, -1, -1):
        for k in range(count - 1, -1, -1):
            # The sum of A cos over all headings from i and from k on.
            d[i, k] = body.products_kg_m2[i, k] * np.cos(phi[i] - phi[k])
            if i + 1 < count:
                d[i, k] += d[i + 1, k]
            if k + 1 < count:
                d[i, k] += d[i, k + 1]
            if i + 1 < count and k + 1 < count:
                d[i, k] -= d[i + 1, k + 1]
    return d


@kernel
def christoffel(body: RigidBody, q_rad: Floats) -> Floats:
    """Return C in kg m^2, shape (n, n, n), symmetric in the last two.

    Joint i feels the sum over j and k of C[i, j, k] q_j' q_k'.
    """
    phi = np.cumsum(q_rad)
    count = phi.shape[0]
    c = np.zeros((count, count, count))
    for i in range(count):
        for j in range(count):
            for k in range(count):
                for row in range(i, count):
                    for column in range(max(j, k), count):
                        c[i, j, k] += body.products_kg_m2[row, column] * np.sin(phi[row] - phi[column])
    return c


@kernel
def gravity_torques(body: RigidBody, q_rad: Floats) -> Floats:
    """Return G(q) in N m, shape (n,): what holds the arm at rest."""
    still = np.zeros(q_rad.shape[0])
    return inverse_dynamics(body, q_rad, still, still)


@kernel
def inverse_dynamics(body: RigidBody, q_rad: Floats, qd_rad_s: Floats, qdd_rad_s2: Floats) -> Floats:
    """Return the joint torques in N m, shape (n,), of a motion given by angles, speeds and accelerations."""
    phi, turn, spin = np.cumsum(q_rad), np.cumsum(qd_rad_s), np.cumsum(qdd_rad_s2)
    count = phi.shape[0]
    tau = np.zeros(count)
    for j in range(count - 1, -1, -1):
        cosine, sine = np.cos(phi[j]), np.sin(phi[j])
        force = body.moments_kg_m[j] * (body.gravity_m_s2[0] * sine - body.gravity_m_s2[1] * cosine)
        for k in range(count):
            apart = phi[j] - phi[k]
            force += body.products_kg_m2[j, k] * (np.cos(apart) * spin[k] + np.sin(apart) * turn[k] * turn[k])
        tau[j] = force + (tau[j + 1] if j + 1 < count else 0.0)
    return tau


@kernel
def kinetic_energy_j(body: RigidBody, q_rad: Floats, qd_rad_s: Floats) -> float:
    """Return the kinetic energy in joules."""
    phi, turn = np.cumsum(q_rad), np.cumsum(qd_rad_s)
    total = 0.0
    for j in range(phi.shape[0]):
        for k in range(phi.shape[0]):
            total += 0.5 * body.products_kg_m2[j, k] * np.cos(phi[j] - phi[k]) * turn[j] * turn[k]
    return total


@kernel
def potential_energy_j(body: RigidBody, q_rad: Floats) -> float:
    """Return the potential energy in joules, zero with all masses at the base."""
    phi = np.cumsum(q_rad)
    total = 0.0
    for j in range(phi.shape[0]):
        along = body.gravity_m_s2[0] * np.cos(phi[j]) + body.gravity_m_s2[1] * np.sin(phi[j])
        total -= body.moments_kg_m[j] * along
    return total


@kernel
def path_torques(body: RigidBody, q_rad: Floats, dq_rad: Floats, ddq_rad: Floats) -> tuple[Floats, Floats, Floats]:
    """Return what a path asks of the joints: tau = a s'' + b s'^2 + g, in N m, each of shape (m, n).

    Args:
        body: the arm.
        q_rad: angles along the path, shape (m, n).
        dq_rad: their first derivatives by the path parameter s.
        ddq_rad: their second derivatives.
    """
    points, count = q_rad.shape
    # Each array is taken out of the tuple once: Numba counts a reference every time.
    products, moments = body.products_kg_m2, body.moments_kg_m
    gravity_x, gravity_y = body.gravity_m_s2[0], body.gravity_m_s2[1]
    a, b, g = np.empty((points, count)), np.empty((points, count)), np.empty((points, count))
    cosine, sine, turn, spin = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    for i in range(points):
        phi, dphi, ddphi = 0.0, 0.0, 0.0
        for j in range(count):
            phi, dphi, ddphi = phi + q_rad[i, j], dphi + dq_rad[i, j], ddphi + ddq_rad[i, j]
            cosine[j], sine[j], turn[j], spin[j] = np.cos(phi), np.sin(phi), dphi, ddphi
        from_u, from_x, held = 0.0, 0.0, 0.0
        for j in range(count - 1, -1, -1):
            held += moments[j] * (gravity_x * sine[j] - gravity_y * cosine[j])
            for k in range(count):
                apart_cosine = products[j, k] * (cosine[j] * cosine[k] + sine[j] * sine[k])
                apart_sine = products[j, k] * (sine[j] * cosine[k] - cosine[j] * sine[k])
                from_u += apart_cosine * turn[k]
                from_x += apart_cosine * spin[k] + apart_sine * turn[k] * turn[k]
            a[i, j], b[i, j], g[i, j] = from_u, from_x, held
    return a, b, g
