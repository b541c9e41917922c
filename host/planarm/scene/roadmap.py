"""`[roadmap]`: how many configurations are spread over joint space, how they are drawn, and what a move costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from planarm.scene.strict_toml import Table

ROADMAP_KEYS = ("nodes", "sampling", "cost", "edge_s")

Sampling = Literal["halton", "random"]
EdgeCost = Literal["consumed", "net", "stepper", "time", "travel"]

SAMPLINGS: tuple[Sampling, ...] = ("halton", "random")
EDGE_COSTS: tuple[EdgeCost, ...] = ("consumed", "net", "stepper", "time", "travel")
MOST_NODES = 200_000


@dataclass(frozen=True, slots=True)
class RoadmapSpec:
    """How the graph of configurations is made; its neighbours and its seed are those of `[planner]`."""

    nodes: int = 2000
    sampling: Sampling = "halton"
    cost: EdgeCost = "consumed"
    edge_s: float = 0.0
    """Duration of every edge; 0 for the shortest that the joints' speeds and accelerations allow."""


def parse_roadmap(table: Table) -> RoadmapSpec:
    """Read the table; every key is optional.

    Raises:
        SceneError: a value is not what its key takes.
    """
    default = RoadmapSpec()
    return RoadmapSpec(
        nodes=table.integer("nodes", default.nodes, at_least=2, at_most=MOST_NODES),
        sampling=table.choice("sampling", SAMPLINGS, default.sampling),
        cost=table.choice("cost", EDGE_COSTS, default.cost),
        edge_s=table.number("edge_s", default.edge_s, at_least=0.0, at_most=3600.0),
    )
