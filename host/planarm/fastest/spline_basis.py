"""Clamped uniform cubic B-splines as power series of each span."""

import numpy as np
from scipy.interpolate import BSpline, PPoly

from planarm.smoothing.smooth_path import Floats

DEGREE = 3


def span_basis(controls: int) -> Floats:
    """Return what each control point adds to each span's power series, shape (spans, 4, controls).

    The spline runs from the first control point at s = 0 to the last at s = spans = controls - 3; it has continuous
    second derivatives. On span p it is the sum over k and c of basis[p, k, c] (s - p)^k control[c].
    """
    spans = controls - DEGREE
    knots = np.concatenate([np.zeros(DEGREE), np.arange(spans + 1.0), np.full(DEGREE, float(spans))])
    basis = np.empty((spans, DEGREE + 1, controls))
    for c, control in enumerate(np.eye(controls)):
        series = PPoly.from_spline(BSpline(knots, control, DEGREE)).c
        basis[:, :, c] = series[::-1, DEGREE : DEGREE + spans].T  # the clamped ends are spans without length
    return basis


def spread(controls: Floats, count: int) -> Floats:
    """Return `count` control points of a spline near to the one with the given control points, shape (count, n).

    The denser spline's control points are taken at its own Greville abscissae (the means of three knots), from the
    polygon over those of the given one: exact for straight lines, near otherwise.
    """
    return np.stack([np.interp(greville(count), greville(len(controls)), column) for column in controls.T], axis=1)


def greville(controls: int) -> Floats:
    """Return each control point's abscissa over [0, 1]."""
    spans = controls - DEGREE
    knots = np.concatenate([np.zeros(DEGREE), np.arange(spans + 1.0), np.full(DEGREE, float(spans))])
    means: Floats = np.array([knots[i + 1 : i + 1 + DEGREE].mean() for i in range(controls)])
    return means / spans
