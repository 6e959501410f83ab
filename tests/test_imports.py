"""The house's one direction of imports, and what the public names cost."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "hkt_mdo"

# A module may import those to its right (and data, errors, which anyone may).
ALLOWED = {
    "errors": set(),
    "data": {"errors"},
    "case": {"case", "data", "errors"},
    "rotor": {"rotor", "data", "errors"},
    "dynamics": {"dynamics", "rotor"},
    "totals": set(),
    "trajectory": {"totals", "dynamics", "rotor"},
    "starting_point": {"rotor", "dynamics"},
    "simulation": {"rotor", "dynamics"},
    "drivers": {"errors"},
    "record_files": {"records", "data", "errors"},
    "records": {"record_files", "data", "errors"},
    "flow": {"case", "records", "dynamics", "data", "errors"},
    "turbine": {"case", "rotor", "data", "errors"},
    "problem": {
        "flow",
        "turbine",
        "case",
        "drivers",
        "starting_point",
        "trajectory",
        "dynamics",
        "rotor",
        "errors",
    },
    "judges": {"problem", "simulation", "starting_point", "drivers", "rotor"},
    "result_folder": {"errors"},
    "results": {"case", "data", "errors"},
    "plots": {"results", "errors"},
    "batch": {"run", "problem", "results", "case", "errors"},
    "uncertainty": {"problem", "simulation", "results", "dynamics", "rotor", "errors"},
    "paper": {
        "flow",
        "paper_report",
        "batch",
        "uncertainty",
        "problem",
        "results",
        "rotor",
        "case",
        "data",
        "errors",
    },
    "paper_report": {"paper", "plots", "results", "case", "errors"},
    "verify": {
        "batch",
        "uncertainty",
        "problem",
        "simulation",
        "results",
        "rotor",
        "case",
        "data",
        "errors",
    },
    "polar_report": {"rotor", "data", "errors"},
    "findings": {
        "problem",
        "turbine",
        "starting_point",
        "simulation",
        "dynamics",
        "rotor",
        "case",
    },
    "check": {"findings", "problem", "turbine", "rotor", "case"},
    "new_case": {"flow", "case", "data", "errors"},
    "run": {
        "judges",
        "result_folder",
        "problem",
        "results",
        "plots",
        "simulation",
        "starting_point",
        "drivers",
        "rotor",
        "case",
        "data",
        "errors",
    },
    "cli": {
        "run",
        "check",
        "verify",
        "paper",
        "plots",
        "polar_report",
        "new_case",
        "flow",
        "problem",
        "results",
        "uncertainty",
        "case",
        "errors",
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
