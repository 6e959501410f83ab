"""What several test modules share."""

import gc
import json
import os
import signal
from functools import cache
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # small matrices: more threads make the tests slower

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from hkt_mdo.case import load_case, read_case
from hkt_mdo.errors import InputError
from hkt_mdo.quantities import LOADS, OVER_TIME, QUANTITIES
from hkt_mdo.results.folder import write_csv, write_json

CASES, DATA = Path(__file__).parent.parent / "cases", Path(__file__).parent / "data"
# r/R of the paper's stations: a case with limits has 40 stations unless it gives these
NINE = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.999]

# `make test` tries the same examples on every machine, and no time decides; `make fuzz` others
settings.register_profile(
    "fixed",
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.register_profile(
    "random", settings.get_profile("fixed"), derandomize=False, max_examples=1000, print_blob=True
)
settings.load_profile("fixed")


def pytest_collection_finish():
    """Leave modules and tests out of garbage collection, which takes an eighth of the time."""
    gc.freeze()
    gc.set_threshold(100_000)


def operate(time: np.ndarray, limit: float | None, law: str) -> dict[str, np.ndarray]:
    """Return something like a rotor in a sinusoidal flow; invented, not computed."""
    flow = 1.5 + 0.2 * np.sin(0.25 * time)
    ratio = 7.2 + (0.05 if law == "quadratic" else 0.9) * np.cos(0.25 * time)
    speed = ratio * flow / 1.4
    torque = 0.47 / ratio * 0.5 * 1000.0 * np.pi * 1.4**3 * flow**2
    control = np.minimum(torque * (1.0 - 0.01 * np.cos(0.25 * time)), limit or np.inf)
    powers = (torque * speed, control * speed, 0.9 * control * speed)
    loads = 2600.0 * flow**2, 680.0 * flow**2, 3.1e7 * flow**2, 0.3 * flow**2
    values = (time, flow, speed, ratio, torque, control, *powers, *loads)
    values += (35.0 * np.cos(0.25 * time),)
    return {QUANTITIES[name].column: x for name, x in zip(OVER_TIME, values, strict=True)}


def make_result(folder: Path, law: str = "quadratic", limit: float | None = 700.0) -> Path:
    """Write a result folder whose numbers are invented but look like a run's."""
    folder.mkdir(parents=True)
    torque_limit = "null" if limit is None else f"{limit:g}"
    case = read_case(
        f"name: sine_{law}\ninflow: {{profile: sine}}\n"
        f"control: {{law: {law}, torque_limit: {torque_limit}}}\n"
        "design: {chord_bounds: [0.01, 1.0]}\nphase: {duration: 60}\n"  # a run writes these
    )
    (folder / "case.yaml").write_text(case.to_yaml(), encoding="utf-8")

    edges = np.linspace(0.0, 60.0, 61)
    nodes = np.sort(np.r_[edges, 0.5 * (edges[1:] + edges[:-1]), edges[1:]])  # 181 of them
    trajectory = operate(nodes, limit, law)
    simulation = operate(np.linspace(0.0, 60.0, 1201), limit, law)
    ratio, count, span = np.linspace(2.2, 12.4, 141), np.arange(45.0), np.linspace(0.2, 1.0, 65)
    tables = {
        "trajectory": trajectory,
        "simulation": simulation,
        "loads": {
            "r_m": 1.4 * span,
            "r_over_R": span,
            "stress_Pa": 9e7 * np.sin(np.pi * span),
            "flapwise_moment_Nm": 1900.0 * (1.0 - span) ** 2,
            "cavitation": 0.87 * span**2,
        },
        "coefficients": {
            "tip_speed_ratio": ratio,
            "power_coefficient": 0.47 - 0.015 * (ratio - 7.2) ** 2,
            "start_power_coefficient": 0.43 - 0.02 * (ratio - 6.4) ** 2,
            "thrust_coefficient": 0.8 + 0.02 * (ratio - 7.2),
            "start_thrust_coefficient": 0.7 + 0.02 * (ratio - 6.4),
        },
        "convergence": {
            "evaluation": count,
            "energy_J": 322239.0 - 16000.0 * np.exp(-count / 6.0) * np.cos(0.5 * count),
            "infeasibility": 0.3 * np.exp(-count / 2.2) * (1.5 + np.sin(3.0 * count)),
        },
    }
    for name, table in tables.items():
        write_csv(folder / f"{name}.csv", table)
    radius = 1.4 * np.array(case.rotor.stations)
    gain, unit = {
        "open_loop": (None, []),
        "linear": (90.9, ["N*m*s/rad"]),
        "quadratic": (10.98, ["N*m*s**2/rad**2"]),
    }[law]
    ratio = trajectory["tip_speed_ratio"]
    summary = json.loads((DATA / "summary.json").read_text()) | {
        "case": case.name,
        "gain": gain,
        "gain_units": unit,
        "tip_speed_ratio": {"min": ratio.min(), "max": ratio.max(), "mean": ratio.mean()},
        "control_torque_max_Nm": trajectory["control_torque_Nm"].max(),
        "limits": {
            "control_torque": {"value": limit, "limit": limit, "unit": "N*m", "binding": True}
        },
        "loads": {
            name: {
                "value": simulation[load.column].max(),
                "unit": load.unit or "",
                "time_s": simulation["time_s"][np.argmax(simulation[load.column])],
            }
            for name in LOADS
            for load in [QUANTITIES[name]]
        },
        "r_m": radius,
        "chord_m": 0.22 - 0.1 * radius,
        "twist_deg": 21.0 * (1.0 - radius / 1.5),
        "start_chord_m": 0.19 - 0.06 * radius,
        "start_twist_deg": 5.0 + 15.0 * (1.0 - radius / 1.4) ** 2,
    }
    write_json(folder / "summary.json", summary)
    return folder


def edit_summary(folder: Path, **changes: object) -> None:
    """Change entries of the summary of a result folder."""
    path = folder / "summary.json"
    write_json(path, json.loads(path.read_text(encoding="utf-8")) | changes)


def checked(component, atol=1e-9, rtol=1e-11, **values):
    """Return a problem of one component at some values, after a check of its partials."""
    import openmdao.api as om
    from openmdao.utils.assert_utils import assert_check_partials

    problem = om.Problem(reports=False)
    problem.model.add_subsystem("part", component, promotes=["*"])
    for name in values.keys() & {"chord", "twist", "torque_coefficient_table"}:
        problem.model.set_input_defaults(name, np.array(values[name]))
    problem.setup(force_alloc_complex=True)
    shapes = problem.model.get_io_metadata(("input",), metadata_keys=("shape",)).values()
    shapes = {each["prom_name"]: each["shape"] for each in shapes}
    for name, value in values.items():
        problem.set_val(name, np.reshape(value, shapes[name]))
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=atol, rtol=rtol)
    return problem


def refused(read, path: Path, **options: object) -> str:
    """Return what is said of a file that is refused, without its path: one printable line."""
    with pytest.raises(InputError) as caught:
        read(path, **options)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    return message.removeprefix(f"{path}: ")


@pytest.fixture
def own_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command changes the environment of its process; let that end with the test."""
    monkeypatch.setattr(os, "environ", os.environ.copy())


@pytest.fixture
def put(tmp_path: Path):
    """Return a function that writes a text into the test's folder and returns its path."""

    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")
        return path

    return write


@pytest.fixture
def result_folder(tmp_path: Path) -> Path:
    """Return the folder of an invented, successful run."""
    return make_result(tmp_path / "result")


@pytest.fixture
def linear_result_folder(tmp_path: Path) -> Path:
    """Return the folder of another one, to compare with."""
    return make_result(tmp_path / "linear", "linear", None)


@pytest.fixture(scope="session")
def polar():
    """The shipped polar of the tests' own Reynolds number."""
    from hkt_mdo.rotor.airfoil import PolarFamily

    return PolarFamily.from_file("naca63815_Re2e5").polars[0]


@pytest.fixture(scope="session")
def blade():
    """The Bahaj blade scaled to R = 1.4 m at the nine default stations, 5 degrees set angle."""
    from hkt_mdo.case import Fluid, Rotor
    from hkt_mdo.problem.turbine import build_turbine

    return build_turbine(Rotor(), Fluid(), 1.5).blade


@pytest.fixture(scope="session")
def solve(tmp_path_factory):
    """Run a shipped case once per session and return its solution."""

    from hkt_mdo.run.run import run_case

    @cache
    def run(name, *overrides):
        case = load_case(CASES / f"{name}.yaml", overrides)
        return run_case(case, tmp_path_factory.mktemp("runs") / name, figures=False)

    return run


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c_interrupts():
    """A shell starts jobs in the background with Ctrl-C ignored, which processes inherit."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _openmdao_writes_elsewhere(tmp_path_factory):
    """Problems that tests build save colorings; they belong in no checkout."""
    os.environ["OPENMDAO_WORKDIR"] = str(tmp_path_factory.mktemp("openmdao"))
