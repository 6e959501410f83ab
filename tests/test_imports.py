"""The house's one direction of imports, and what the public names cost."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "hkt_mdo"

# A module may import those named beside it.
ALLOWED = {
    "errors": set(),
    "data": {"errors"},
    "case": {"case", "data", "errors"},
    "rotor": {"data", "errors", "rotor"},
    "dynamics": {"dynamics", "rotor"},
    "totals": set(),
    "trajectory": {"dynamics", "totals"},
    "starting_point": {"rotor"},
    "simulation": {"dynamics", "rotor"},
    "drivers": {"errors"},
    "record_files": {"data", "errors"},
    "records": {"errors", "record_files"},
    "flow": {"dynamics", "errors", "records"},
    "turbine": {"case", "data", "errors", "rotor"},
    "problem": {
        "case",
        "drivers",
        "dynamics",
        "flow",
        "rotor",
        "starting_point",
        "trajectory",
        "turbine",
    },
    "judges": {"drivers", "problem", "rotor", "simulation", "starting_point"},
    "result_folder": {"errors"},
    "results": {"case", "data", "errors"},
    "plots": {"errors", "results"},
    "batch": {"case", "errors", "problem", "results", "run"},
    "uncertainty": {"dynamics", "errors", "problem", "results", "rotor", "simulation"},
    "paper": {
        "batch",
        "case",
        "data",
        "errors",
        "flow",
        "paper_report",
        "problem",
        "results",
        "rotor",
        "uncertainty",
    },
    "paper_report": {"paper", "plots"},
    "verify": {"batch", "case", "data", "errors", "problem", "rotor", "simulation", "uncertainty"},
    "polar_report": {"data", "errors", "rotor"},
    "findings": {"case", "dynamics", "problem", "rotor", "simulation", "starting_point", "turbine"},
    "check": {"case", "findings", "problem", "rotor", "turbine"},
    "new_case": {"case", "data", "errors", "flow"},
    "run": {
        "case",
        "data",
        "drivers",
        "errors",
        "judges",
        "plots",
        "problem",
        "result_folder",
        "results",
        "rotor",
        "simulation",
        "starting_point",
    },
    "cli": {
        "case",
        "check",
        "errors",
        "flow",
        "new_case",
        "paper",
        "plots",
        "polar_report",
        "results",
        "run",
        "uncertainty",
        "verify",
    },
    "__init__": set(),
    "__main__": {"cli"},
}


def modules():
    return sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    imported = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = (
                [node.module]
                if node.module != "hkt_mdo"
                else [f"hkt_mdo.{a.name}" for a in node.names]
            )
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        imported |= {n.split(".")[1] for n in names if n.startswith("hkt_mdo.")}
    assert imported <= ALLOWED[room], f"{path.name} reaches for {imported - ALLOWED[room]}"


def test_every_room_is_named():
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in modules()}
    assert rooms == set(ALLOWED)


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import hkt_mdo", "numpy"),
        ("from hkt_mdo import load_case", "openmdao"),
        ("import hkt_mdo.cli", "numpy"),
        ("from hkt_mdo import Solution", "dymos openmdao wisdem matplotlib numba"),
        ("import hkt_mdo.plots", "dymos openmdao wisdem numba"),
        ("import hkt_mdo.run", "wisdem casadi pyoptsparse"),
    ],
)
def test_heavy_imports_wait_until_they_are_used(statement, absent):
    program = (
        f"{statement}\nimport sys\nprint(*[n for n in {absent.split()!r} if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""


def test_public_names_exist():
    import hkt_mdo

    for name in hkt_mdo.__all__:
        assert getattr(hkt_mdo, name) is not None
    with pytest.raises(AttributeError):
        _ = hkt_mdo.nothing


def test_imports_go_in_no_circle():
    """But for paper and its report, which asks for names only when it runs."""
    open_ = {room: needs - {room} for room, needs in ALLOWED.items()}
    open_["paper_report"] -= {"paper"}
    while open_:
        free = {room for room, needs in open_.items() if not needs & open_.keys()}
        assert free, f"in a circle: {sorted(open_)}"
        open_ = {room: needs for room, needs in open_.items() if room not in free}
