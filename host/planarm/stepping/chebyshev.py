"""The polynomial that stays nearest to given points, errors measured in given widths: Chebyshev's exchange.

On degree + 2 points the error can be levelled: equal size in widths, alternating signs. The level of any such reference
is a lower bound of the least largest error over all points (de la Vallee Poussin), so a level above 1 shows that no
polynomial stays within the widths. Otherwise the point with the largest error is taken into the reference, which
raises the level, until the polynomial is within all widths.
"""

from math import cos, pi

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

MAX_EXCHANGES = 40
NO_GAIN = 1.0 + 1e-9


@kernel
def best_polynomial(at: Floats, center: Floats, half: Floats, degree: int) -> tuple[bool, Floats, Floats]:
    """Return (inside, nodes, coefficients) of a polynomial in Newton's form.

    Args:
        at: where the points are, strictly ascending, more than `degree` of them.
        center: their values.
        half: the width of each, above 0: inside means within it at every point.
        degree: of the polynomial.

    Returns:
        The polynomial is the sum over k of coefficients[k] (x - nodes[0]) ... (x - nodes[k - 1]).
    """
    points = at.shape[0]
    size = min(degree + 2, points)
    reference = np.zeros(size, np.int64)
    for k in range(size):
        reference[k] = int((points - 1) * 0.5 * (1.0 - cos(pi * k / (size - 1))) + 0.5)
    spread(reference)
    nodes, coefficients = np.zeros(degree + 1), np.zeros(degree + 1)
    for _ in range(MAX_EXCHANGES):
        level = reference_level(at, center, half, reference) if size == degree + 2 else 0.0
        interpolate(at, center, half, reference, level, nodes, coefficients)
        if abs(level) > 1.0:
            return False, nodes, coefficients
        worst, error = worst_point(at, center, half, nodes, coefficients)
        if abs(error) <= 1.0:
            return True, nodes, coefficients
        if abs(error) <= abs(level) * NO_GAIN or not exchange(reference, level, worst, error):
            break
    return False, nodes, coefficients


@kernel
def spread(reference: Indices) -> None:
    """Make ascending indices, from 0 to the last, different from each other."""
    size = reference.shape[0]
    for k in range(1, size - 1):
        reference[k] = max(reference[k], reference[k - 1] + 1)
    for k in range(size - 2, -1, -1):
        reference[k] = min(reference[k], reference[k + 1] - 1)


@kernel
def reference_level(at: Floats, center: Floats, half: Floats, reference: Indices) -> float:
    """Return the level: the polynomial's error at the k-th point of the reference can be (-1)^k level widths.

    The divided difference over the whole reference removes every polynomial, which leaves one equation for the level.
    """
    size = reference.shape[0]
    numerator, denominator = 0.0, 0.0
    sign = 1.0
    for k in range(size):
        weight = 1.0
        for other in range(size):
            if other != k:
                weight /= at[reference[k]] - at[reference[other]]
        numerator += weight * center[reference[k]]
        denominator += weight * sign * half[reference[k]]
        sign = -sign
    return numerator / denominator


@kernel
def interpolate(
    at: Floats, center: Floats, half: Floats, reference: Indices, level: float, nodes: Floats, coefficients: Floats
) -> None:
    """Fill the polynomial with errors of (-1)^k level widths at the first points of the reference.

    The coefficients are divided differences.
    """
    size = nodes.shape[0]
    for k in range(size):
        i = reference[k]
        nodes[k], coefficients[k] = at[i], center[i] - (1 - k % 2 * 2) * level * half[i]
    for order in range(1, size):
        for k in range(size - 1, order - 1, -1):
            coefficients[k] = (coefficients[k] - coefficients[k - 1]) / (nodes[k] - nodes[k - order])


@kernel
def worst_point(at: Floats, center: Floats, half: Floats, nodes: Floats, coefficients: Floats) -> tuple[int, float]:
    """Return the point with the largest error and that error in widths, positive where the polynomial is below."""
    worst, largest = 0, 0.0
    for n in range(at.shape[0]):
        value = coefficients[-1]
        for k in range(nodes.shape[0] - 2, -1, -1):
            value = value * (at[n] - nodes[k]) + coefficients[k]
        error = (center[n] - value) / half[n]
        if abs(error) > abs(largest):
            worst, largest = n, error
    return worst, largest


@kernel
def exchange(reference: Indices, level: float, worst: int, error: float) -> bool:
    """Take point `worst` into the reference so that its errors still alternate; False when it is already there."""
    size = reference.shape[0]
    k = 0
    while k < size and reference[k] < worst:
        k += 1
    if k < size and reference[k] == worst:
        return False
    # The error at the k-th point of the reference is (-1)^k level.
    like_even = (error > 0.0) == (level > 0.0)
    if k < size and like_even == (k % 2 == 0):
        reference[k] = worst
    elif k > 0 and like_even == ((k - 1) % 2 == 0):
        reference[k - 1] = worst
    elif k == 0:
        for i in range(size - 1, 0, -1):
            reference[i] = reference[i - 1]
        reference[0] = worst
    else:
        for i in range(size - 1):
            reference[i] = reference[i + 1]
        reference[size - 1] = worst
    return True
