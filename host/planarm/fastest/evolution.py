"""Covariance matrix adaptation (CMA-ES): minimise a function of a dozen variables from its values alone.

Source: N. Hansen, The CMA Evolution Strategy: A Tutorial, 2016 (arXiv:1604.00772), table 1 for the settings, appendix A
for the loop. Written here because the whole population is judged by one compiled call, and because its state is what
makes the search stop and go on at any time.
"""

from dataclasses import dataclass, field

import numpy as np

from planarm.smoothing.smooth_path import Floats


@dataclass(slots=True)
class Evolution:
    """The state of one search: mean, step size and covariance of the distribution that candidates are drawn from."""

    mean: Floats
    """Shape (d,)."""
    step: float
    random: np.random.Generator
    population: int = 0
    generations: int = 0
    covariance: Floats = field(init=False)
    axes: Floats = field(init=False)
    """Eigenvectors in columns, each times the root of its eigenvalue, shape (d, d)."""
    unscale: Floats = field(init=False)
    """The covariance's inverse root, shape (d, d)."""
    step_path: Floats = field(init=False)
    axis_path: Floats = field(init=False)

    def __post_init__(self) -> None:
        size = len(self.mean)
        self.population = self.population or 4 + int(3 * np.log(size))
        self.covariance, self.axes, self.unscale = np.eye(size), np.eye(size), np.eye(size)
        self.step_path, self.axis_path = np.zeros(size), np.zeros(size)

    def ask(self) -> Floats:
        """Return new candidates, shape (population, d)."""
        drawn = self.random.standard_normal((self.population, len(self.mean)))
        return self.mean + self.step * drawn @ self.axes.T

    def tell(self, candidates: Floats, costs: Floats) -> None:
        """Move the distribution towards the better half of the candidates."""
        size, parents = len(self.mean), self.population // 2
        weights = np.log(0.5 * (self.population + 1)) - np.log(np.arange(1, parents + 1))
        weights /= weights.sum()
        mass = 1.0 / (weights**2).sum()
        steps = (candidates[np.argsort(costs, kind="stable")[:parents]] - self.mean) / self.step
        move = weights @ steps
        self.mean = self.mean + self.step * move
        self.generations += 1

        keep = (mass + 2.0) / (size + mass + 5.0)
        self.step_path = (1.0 - keep) * self.step_path + np.sqrt(keep * (2.0 - keep) * mass) * self.unscale @ move
        expected = np.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size**2))
        length = float(np.sqrt(self.step_path @ self.step_path))
        damping = 1.0 + 2.0 * max(0.0, float(np.sqrt((mass - 1.0) / (size + 1.0))) - 1.0) + keep
        settled = length / np.sqrt(1.0 - (1.0 - keep) ** (2 * self.generations)) < (1.4 + 2.0 / (size + 1.0)) * expected

        along = (4.0 + mass / size) / (size + 4.0 + 2.0 * mass / size)
        self.axis_path = (1.0 - along) * self.axis_path + settled * np.sqrt(along * (2.0 - along) * mass) * move
        one = 2.0 / ((size + 1.3) ** 2 + mass)
        many = min(1.0 - one, 2.0 * (mass - 2.0 + 1.0 / mass) / ((size + 2.0) ** 2 + mass))
        lost = (1.0 - settled) * one * along * (2.0 - along)
        self.covariance = (
            (1.0 - one - many + lost) * self.covariance
            + one * np.outer(self.axis_path, self.axis_path)
            + many * (steps.T * weights) @ steps
        )
        self.step *= float(np.exp((keep / damping) * (length / expected - 1.0)))
        self._decompose()

    def _decompose(self) -> None:
        values, vectors = np.linalg.eigh(0.5 * (self.covariance + self.covariance.T))
        roots = np.sqrt(np.maximum(values, 1e-20))
        self.axes = vectors * roots
        self.unscale = (vectors / roots) @ vectors.T
