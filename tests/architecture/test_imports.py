"""Imports run one way: the whole list of what may import what, and nothing else may."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"planarm": ROOT / "host", "planarm_wire": ROOT / "protocol", "planarm_sim": ROOT / "hil_sim"}

# Room -> rooms it may import. A room is the first folder or file below a package; planarm_wire is one room,
# except its kernel cache, the one thing beside the wire that host and emulator share.
WIRE = {"planarm_wire", "planarm_wire.kernel_cache"}
ALLOWED: dict[str, set[str]] = {
    "planarm_wire": {"planarm_wire"},
    "planarm_wire.kernel_cache": set(),
    "planarm": set(),
    "planarm.errors": set(),
    # docs/decisions/0121: what tells how far a long piece of work is
    "planarm.notice": set(),
    "planarm.output": {"planarm.errors"},
    # docs/decisions/0081: codes of everything that can go wrong
    "planarm.explain": {"planarm_wire", "planarm.errors"},
    # docs/decisions/0103: a scene says its board
    "planarm.scene": {"planarm_wire", "planarm.errors"},
    "planarm.model": {"planarm_wire.kernel_cache", "planarm.errors", "planarm.scene"},
    "planarm.workspace": {"planarm_wire.kernel_cache", "planarm.errors", "planarm.scene", "planarm.model"},
    "planarm.search": {
        "planarm_wire.kernel_cache",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
    },
    "planarm.smoothing": {
        "planarm_wire.kernel_cache",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
    },
    "planarm.dynamics": {"planarm_wire.kernel_cache", "planarm.scene"},
    # docs/decisions/0077: configurations and moves between them, searched by planarm.search, costed by planarm.dynamics
    "planarm.roadmap": {
        "planarm_wire.kernel_cache",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
        "planarm.dynamics",
    },
    "planarm.trajectory": {
        "planarm_wire.kernel_cache",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.smoothing",
        "planarm.dynamics",
    },
    "planarm.fastest": {
        "planarm_wire.kernel_cache",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.smoothing",
        "planarm.trajectory",
    },
    "planarm.stepping": {
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.smoothing",
        "planarm.dynamics",
        "planarm.trajectory",
        *WIRE,
    },
    # docs/decisions/0020: the emulated arm is built from the scene's shapes and transmission
    "planarm.link": {
        "planarm_wire",
        "planarm.errors",
        "planarm.output",
        "planarm.scene",
        "planarm.model",
        "planarm_sim",
    },
    # docs/decisions/0080: a run as plain values, between the stages and the page
    "planarm.record": {
        "planarm.analysis",
        "planarm.streaming",
        "planarm_wire",
        "planarm",
        "planarm.explain",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.dynamics",
        "planarm.stepping",
        "planarm.link",
        "planarm.plan",
    },
    "planarm.analysis": {"planarm.notice", "planarm.errors", *WIRE},
    "planarm.report": {"planarm_wire", "planarm", "planarm.errors", "planarm.analysis"},
    # docs/decisions/0071: a motion among moving obstacles has its times from the search
    "planarm.routes": {
        "planarm.notice",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
        "planarm.smoothing",
        "planarm.roadmap",
        "planarm.trajectory",
    },
    "planarm.plan": {
        "planarm.scene",
        "planarm.workspace",
        "planarm.search",
        "planarm.smoothing",
        "planarm.trajectory",
        "planarm.stepping",
        "planarm.analysis",
        "planarm.routes",
    },
    # docs/decisions/0078: the one loop; it re-enters at search with what has changed
    "planarm.operations": {
        "planarm.motions",
        "planarm.notice",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.smoothing",
        "planarm.roadmap",
        "planarm.trajectory",
        "planarm.stepping",
        "planarm.link",
        "planarm.routes",
        "planarm.plan",
        "planarm.streaming",
        "planarm.pipeline",
        "planarm.run_folder",
        "planarm.plan_file",
        *WIRE,
    },
    # docs/decisions/0072: keeping time is a loop of streaming and planning
    # docs/decisions/0065: how plans are streamed and gone on with
    # docs/decisions/0066: small moves of a real arm
    "planarm.streaming": {
        "planarm.notice",
        "planarm_wire",
        "planarm",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.dynamics",
        "planarm.stepping",
        "planarm.link",
        "planarm.routes",
        "planarm.plan",
        "planarm.plan_file",
    },
    # docs/decisions/0121: what the pipeline's one line "motion" is made of
    "planarm.motions": {
        "planarm_wire",
        "planarm.errors",
        "planarm.notice",
        "planarm.scene",
        "planarm.model",
        "planarm.search",
        "planarm.trajectory",
        "planarm.fastest",
        "planarm.stepping",
        "planarm.routes",
    },
    "planarm.pipeline": {
        "planarm.errors",
        "planarm.notice",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
        "planarm.trajectory",
        "planarm.stepping",
        "planarm.link",
        "planarm.record",
        "planarm.routes",
        "planarm.motions",
        "planarm.plan",
        "planarm.streaming",
        "planarm.run_folder",
        "planarm.plan_file",
    },
    "planarm.run_folder": {
        "planarm_wire",
        "planarm.errors",
        "planarm.output",
        "planarm.model",
        "planarm.link",
        "planarm.record",
        "planarm.report",
        "planarm.plan",
        "planarm.plan_file",
    },
    # docs/decisions/0083: a run watched and steered while it goes on
    "planarm.live": {"planarm_wire", "planarm.model", "planarm.link", "planarm.plan"},
    # docs/decisions/0084: bringing an arm up
    "planarm.bringup": {
        "planarm_wire",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.smoothing",
        "planarm.trajectory",
        "planarm.stepping",
    },
    "planarm.warm_up": {
        "planarm.motions",
        "planarm.notice",
        "planarm.scene",
        "planarm.model",
        "planarm.smoothing",
        "planarm.trajectory",
        "planarm.stepping",
        "planarm.link",
        "planarm.routes",
        "planarm.pipeline",
        "planarm.operations",
    },
    "planarm.first_start": set(),
    "planarm.plan_file": {
        "planarm_wire",
        "planarm",
        "planarm.errors",
        "planarm.output",
        "planarm.scene",
        "planarm.stepping",
    },
    "planarm.campaign": {
        "planarm.notice",
        "planarm_wire",
        "planarm",
        "planarm.errors",
        "planarm.output",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
        "planarm.stepping",
        "planarm.link",
        "planarm.analysis",
        "planarm.plan",
        "planarm.operations",
        "planarm.streaming",
        "planarm.pipeline",
        "planarm.plan_file",
        "planarm_sim",
    },
    "planarm.timing_flow": {
        "planarm.notice",
        "planarm_wire",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.stepping",
        "planarm.analysis",
        "planarm.plan_file",
    },
    "planarm.envelope": {"planarm.errors", "planarm.scene", "planarm.model", "planarm.stepping"},
    "planarm.experiments": {
        "planarm.notice",
        "planarm_wire.kernel_cache",
        "planarm.errors",
        "planarm.scene",
        "planarm.model",
        "planarm.workspace",
        "planarm.search",
        "planarm.smoothing",
        "planarm.dynamics",
        "planarm.roadmap",
        "planarm.trajectory",
        "planarm.report",
    },
    "planarm.cli": {
        "planarm.motions",
        "planarm.notice",
        "planarm",
        "planarm.errors",
        "planarm.output",
        "planarm.explain",
        "planarm.scene",
        "planarm.model",
        "planarm.stepping",
        "planarm.link",
        "planarm.record",
        "planarm.report",
        "planarm.routes",
        "planarm.plan",
        "planarm.operations",
        "planarm.streaming",
        "planarm.pipeline",
        "planarm.run_folder",
        "planarm.live",
        "planarm.bringup",
        "planarm.warm_up",
        "planarm.first_start",
        "planarm.plan_file",
        "planarm.campaign",
        "planarm.timing_flow",
        "planarm.envelope",
        "planarm.experiments",
        "planarm_sim",
        *WIRE,
    },
    "planarm_sim": {"planarm_wire", "planarm_wire.kernel_cache", "planarm_sim"},
}
# The emulator enters the host through these files alone, and only inside functions.
SIM_DOORS = {
    "host/planarm/link/sim_bench.py",
    "host/planarm/link/sim_transport.py",
    "host/planarm/campaign/fault_runs.py",
    "host/planarm/campaign/faulty_transport.py",
    "host/planarm/campaign/line_faults.py",
    "host/planarm/link/replay.py",
    "host/planarm/cli/emulate.py",
}


def room_of(module: str) -> str:
    parts = module.split(".")
    if parts[0] == "planarm" and len(parts) > 1:
        return ".".join(parts[:2])
    if module.startswith("planarm_wire.kernel_cache"):
        return "planarm_wire.kernel_cache"
    return parts[0]


def module_of(path: Path) -> str:
    relative = path.relative_to(PACKAGES[next(p for p in PACKAGES if (PACKAGES[p] / p) in path.parents)])
    return ".".join(relative.with_suffix("").parts).removesuffix(".__init__")


def imported_modules(node: ast.AST, module: str, is_package: bool) -> list[str]:
    """Every one of our modules that the import statement names, relative ones resolved."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names if alias.name.split(".")[0] in PACKAGES]
    if not isinstance(node, ast.ImportFrom):
        return []
    base = node.module or ""
    if node.level:
        parents = module.split(".") if is_package else module.split(".")[:-1]
        base = ".".join([*parents[: len(parents) - node.level + 1], *([base] if base else [])])
    if base.split(".")[0] not in PACKAGES:
        return []
    return [f"{base}.{alias.name}" if base in ("planarm", "planarm_wire") else base for alias in node.names]


def sources() -> list[Path]:
    return sorted(path for package, top in PACKAGES.items() for path in (top / package).rglob("*.py"))


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_only_listed_imports(path: Path) -> None:
    module = module_of(path)
    room = room_of(module)
    for node in ast.walk(ast.parse(path.read_text())):
        for target in imported_modules(node, module, path.name == "__init__.py"):
            other = room_of(target)
            if other == "planarm" and target.count("."):
                other = target  # an unknown room shows by its full name
            if other != room:
                assert room in ALLOWED, f"{room} is a new room: docs/decisions explains it, then this list takes it"
                assert other in ALLOWED[room], f"{path.name}:{node.lineno} imports {target}"


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_the_emulator_enters_the_host_by_its_doors_and_lazily(path: Path) -> None:
    if (ROOT / "host") not in path.parents:
        return
    module = module_of(path)
    tree = ast.parse(path.read_text())
    top_level = {id(node) for node in tree.body}
    for node in ast.walk(tree):
        if any(t.split(".")[0] == "planarm_sim" for t in imported_modules(node, module, False)):
            assert str(path.relative_to(ROOT)) in SIM_DOORS, f"{path.name}:{node.lineno} is no door to the emulator"
            assert id(node) not in top_level, f"{path.name}:{node.lineno} must import the emulator inside a function"


def test_the_list_names_only_rooms_that_exist() -> None:
    rooms = {room_of(module_of(path)) for path in sources()}
    assert set(ALLOWED) <= rooms
