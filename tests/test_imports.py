"""The one direction of imports among the packages, and the cost of importing public names."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "hkt_mdo"
MODULES = sorted(PACKAGE.rglob("*.py"))

# A package may import those named beside it; the order is from the lowest to the highest.
ALLOWED = {
    "compiled": set(),
    "errors": set(),
    "files": {"errors", "sections"},
    "quantities": set(),
    "sections": {"errors"},
    "messages": {"errors", "files", "sections"},
    "solve": {"compiled", "errors"},
    "rotor": {"compiled", "errors", "files", "quantities"},
    "dynamics": {"errors", "files", "messages", "quantities", "rotor", "sections"},
    "case": {"dynamics", "errors", "files", "messages", "quantities", "sections"},
    "results": {"case", "dynamics", "errors", "files", "problem", "quantities", "rotor"},
    "problem": {"case", "dynamics", "errors", "files", "quantities", "rotor", "sections", "solve"},
    "start": {"case", "dynamics", "errors", "problem", "quantities", "results", "rotor", "solve"},
    "run": {
        *("case", "dynamics", "errors", "files", "problem", "quantities", "results", "rotor"),
        *("sections", "solve", "start"),
    },
    "exports": {
        *("case", "dynamics", "errors", "files", "messages", "problem", "quantities", "results"),
        *("rotor", "sections"),
    },
    "pages": {"case", "errors", "exports", "files", "quantities", "results", "sections"},
    "studies": {
        *("case", "compiled", "dynamics", "errors", "files", "problem", "quantities", "results"),
        *("rotor", "run", "start"),
    },
    "cli": {
        *("case", "dynamics", "errors", "exports", "files", "messages", "problem", "pages"),
        *("results", "rotor", "run", "studies"),
    },
    "__init__": set(),
    "__main__": {"cli"},
}


def imports(path):
    """Return the modules of the package that a file imports, at its top or within functions."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            modules |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
    return {name for name in modules if name.startswith("hkt_mdo.")}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    rooms = {name.split(".")[1] for name in imports(path)} & ALLOWED.keys()
    reached = rooms - {room} - ALLOWED[room]
    assert not reached, f"{path.name} reaches for {reached}"


def test_modules_import_each_other_in_no_circle():
    names = {
        ".".join(("hkt_mdo", *p.relative_to(PACKAGE).with_suffix("").parts)): p for p in MODULES
    }
    open_ = {name: imports(path) & names.keys() - {name} for name, path in names.items()}
    while open_:
        free = {name for name, needs in open_.items() if not needs & open_.keys()}
        assert free, f"in a circle: {sorted(open_)}"
        open_ = {name: needs for name, needs in open_.items() if name not in free}


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import hkt_mdo", "numpy"),
        (
            "from hkt_mdo import load_case; load_case('sine_oloc')",
            "openmdao dymos matplotlib scipy casadi wisdem",
        ),
        ("import hkt_mdo.cli", "numpy jinja2 plotly"),
        ("from hkt_mdo import Solution", "dymos openmdao wisdem matplotlib numba"),
        ("import hkt_mdo.rotor.bem, hkt_mdo.rotor.shape, hkt_mdo.rotor.inertia", "openmdao"),
        ("import hkt_mdo.results.charts", "dymos openmdao wisdem numba"),
        (
            "import hkt_mdo.run.run, hkt_mdo.run.sweep, hkt_mdo.cli",
            "wisdem casadi pyoptsparse distributed dask pandas",
        ),
        ("from hkt_mdo import build_problem, load_case, run_case, TurbineGroup", "wisdem"),
    ],
)
def test_heavy_imports_wait_until_they_are_used_and_none_warns(statement, absent):
    code = f"{statement}\nimport sys\nprint(*[n for n in {absent.split()!r} if n in sys.modules])"
    usual = {key: value for key, value in os.environ.items() if key != "PYTHONWARNINGS"}
    options = {"env": usual | {"PYTHONPATH": str(PACKAGE.parent)}, "capture_output": True}
    done = subprocess.run([sys.executable, "-c", code], text=True, check=True, **options)
    assert (done.stdout.strip(), done.stderr) == ("", "")


def test_public_names_exist():
    import hkt_mdo

    for name in hkt_mdo.__all__:
        assert callable(getattr(hkt_mdo, name))
    with pytest.raises(AttributeError):
        _ = hkt_mdo.nothing
