"""A rotor and a turbine in other OpenMDAO models: values, partials, names, one's own objective."""

from pathlib import Path

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo import RotorGroup, Solution, TurbineGroup, build_problem, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics

FLOW = np.array([1.0, 1.3, 1.7, 2.0])
LOADS = "thrust", "root_moment", "stress", "cavitation"
OUTPUTS = (
    *("torque_coefficient", "power_coefficient", "thrust_coefficient"),
    *("hydrodynamic_torque", "hydrodynamic_power", *LOADS, "mass", "inertia"),
)
SEVERAL = {
    "rotor": {
        "sections": [
            {"polar": "naca63815_Re1e6", "outline": "naca63815", "thickness": 0.15},
            {"polar": "naca63424_Re1e6", "outline": "naca63424", "thickness": 0.24},
        ],
        "wall": 0.05,
        "material": {"density": 1900, "modulus": "25 GPa"},
    },
    "design": {"chord_points": 5, "twist_points": 4},
}
ROTORS = {
    "paper": {},
    "rm1": "rm1_set_angle",
    "several sections": SEVERAL,
    "designed thickness": "designed_thickness",
}
RESULT = Path(__file__).parents[1] / "data" / "openfast" / "paper"


def but(names, quick):
    """Return names as parameters of a test, of which all but some are slow."""
    slow = pytest.mark.slow
    return [name if name in quick else pytest.param(name, marks=slow) for name in names]


def case_of(rotor, depth=True):
    """Return a case of a rotor: a shipped one by its name, or what it adds to the default one."""
    spec = ROTORS[rotor]
    if isinstance(spec, str):
        return load_case(spec, ["site.hub_depth=30"] if depth else [])
    more = {"site": {"hub_depth": 4}} if depth else {}
    return load_case({"inflow": "sine", "control": {"law": "quadratic"}} | more | spec)


def model_of(group, **inputs):
    """Return a problem with a group, run at some inputs."""
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("group", group, promotes=["*"])
    problem.setup(force_alloc_complex=True)
    for name, value in inputs.items():
        problem.set_val(name, value)
    problem.run_model()
    return problem


# The rotor ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rotor", but(ROTORS, ["paper", "designed thickness"]))
def test_rotor_has_the_performance_loads_and_mass_of_its_blade(rotor):
    case = case_of(rotor)
    model = physics(case)
    problem = model_of(RotorGroup(case, num_points=4), inflow_speed=FLOW)
    blade, ratio = model.blade, problem["tip_speed_ratio"]
    assert ratio == pytest.approx(model.rotor.best_operation(blade).tip_speed_ratio, rel=1e-12)
    values, radius = model.rotor.coefficients(blade, ratio), blade.rotor_radius
    pressure, area = 0.5 * model.density * FLOW**2, np.pi * radius**2
    for name in ("torque", "power", "thrust"):
        np.testing.assert_allclose(problem[f"{name}_coefficient"], getattr(values, name), rtol=1e-8)
    speed = ratio * FLOW / radius
    np.testing.assert_allclose(problem["rotor_speed"], speed, rtol=1e-12)
    power = pressure * FLOW * area * values.power
    np.testing.assert_allclose(problem["hydrodynamic_power"], power, rtol=1e-8)
    np.testing.assert_allclose(problem["hydrodynamic_torque"] * speed, power, rtol=1e-8)
    np.testing.assert_allclose(problem["thrust"], pressure * area * values.thrust, rtol=1e-8)
    for name, load in model.rotor.loads(blade, ratio).items():
        over = problem[name] / (pressure * load.largest) - 1.0
        assert np.all(over > -1e-8), name
        assert np.all(over < (0.03 if name in ("stress", "cavitation") else 1e-8)), name
    assert set(model.rotor.load_names) == set(LOADS)
    mass = model.rotor.mass_and_inertia(blade)
    assert (problem["mass"][0], problem["inertia"][0]) == pytest.approx(mass[:2], rel=1e-8)


@pytest.mark.parametrize("quantity", ["tip_speed_ratio", "rotor_speed"])
@pytest.mark.parametrize("rotor", but(ROTORS, ["paper", "rm1"]))
def test_totals_of_the_rotor_by_every_input(rotor, quantity):
    """BEM by central differences in the model, whose formulas are by complex step below."""
    problem = model_of(RotorGroup(case_of(rotor), num_points=4, given=quantity), inflow_speed=FLOW)
    problem.set_val(quantity, problem[quantity] * [0.95, 1.03, 1.1, 1.2])  # off the best ratio
    problem.run_model()
    shaped = [f"{name}_control" for name in ("chord", "twist", "thickness")]
    names = {meta["prom_name"] for _, meta in problem.model.list_inputs(out_stream=None)}
    inputs = ["inflow_speed", quantity, "rotor_radius", "density", *names.intersection(shaped)]
    assert len(inputs) >= 5
    for name in inputs:
        size = np.max(np.abs(problem[name]))
        options = {"method": "fd", "form": "central", "step": 1e-6 * max(size, 1e-2)}
        totals = problem.check_totals(of=list(OUTPUTS), wrt=[name], out_stream=None, **options)
        for (output, _), entry in totals.items():
            noise = 1e-6 * np.max(np.abs(problem[output])) / max(size, 1e-2)
            total = entry["J_fwd"] if "J_fwd" in entry else entry["J_rev"]
            np.testing.assert_allclose(total, entry["J_fd"], rtol=1e-5, atol=noise, err_msg=output)


@pytest.mark.parametrize("rotor", ROTORS)
def test_formulas_of_the_rotor_by_complex_step(rotor, monkeypatch):
    monkeypatch.setenv("OPENMDAO_CHECK_ALL_PARTIALS", "1")  # those of ExecComp, too
    problem = model_of(RotorGroup(case_of(rotor), num_points=4), inflow_speed=FLOW)
    parts = ["group.operating_points", "group.power_and_loads"]
    data = problem.check_partials(includes=parts, method="cs", out_stream=None)
    assert set(data) == set(parts)
    assert_check_partials(data, atol=1e-6, rtol=1e-9)


def test_rotor_without_depth_has_no_cavitation_and_local_reynolds_numbers_are_refused():
    problem = model_of(RotorGroup(case_of("paper", depth=False)))
    with pytest.raises(KeyError):
        problem.get_val("cavitation")
    case = SHORT | LAWS["quadratic"] | MORE["local Reynolds numbers"]
    with pytest.raises(InputError, match=r"rotor\.reynolds = 'local'.*give invariant"):
        model_of(RotorGroup(load_case(case)))


@pytest.mark.parametrize(
    ("quantity", "values", "words"),
    [
        ("tip_speed_ratio", {"tip_speed_ratio": [2.0, -1.0]}, "tip_speed_ratio = -1 is not pos"),
        ("rotor_speed", {"inflow_speed": 0.0}, "inflow_speed = 0 is not positive"),
        ("tip_speed_ratio", {"inflow_speed": [1.0, np.nan]}, "inflow_speed = nan is not positive"),
        ("tip_speed_ratio", {"chord_control": -0.1}, "chord = -0.1 is not positive"),
        ("tip_speed_ratio", {"twist_control": np.nan}, "twist = nan is not finite"),
    ],
)
def test_a_point_without_a_rotor_is_one_that_a_driver_may_leave(quantity, values, words):
    problem = model_of(RotorGroup(case_of("paper"), num_points=2, given=quantity))
    for name, value in values.items():
        problem.set_val(name, value)
    refused = pytest.raises(om.AnalysisError, match=words)
    with np.errstate(divide="ignore", invalid="ignore"), refused:
        problem.run_model()


def test_complex_step_through_a_rotor_is_refused():
    problem = model_of(RotorGroup(case_of("paper")))
    message = r"group\.blades\.\w+: takes no complex numbers, .*use its exact partials"
    with pytest.raises(InputError, match=message):
        problem.check_totals(of=["power_coefficient"], wrt=["twist_control"], method="cs")


# The turbine --------------------------------------------------------------------------------------

LAWS = {
    "quadratic": {"control": {"law": "quadratic", "torque_limit": 700}},
    "open loop": {"control": {"law": "open_loop", "torque_limit": 700}},
    "fixed": {"control": {"law": "open_loop", "torque_limit": 700}, "design": {"blade": "fixed"}},
}
SHORT = {"inflow": "sine", "phase": {"duration": 12, "segments": 12}}


@pytest.mark.parametrize("law", but(LAWS, ["quadratic"]))
def test_turbine_ends_at_the_optimum_of_the_case_by_another_driver(law):
    """With the case's own objective: by SciPy with OpenMDAO's totals, as by our own drivers."""
    case = load_case(SHORT | LAWS[law])
    problem = build_problem(case)
    problem.run_model()
    other = om.Problem(reports=False)
    other.model.add_subsystem("turbine", TurbineGroup(case))
    other.model.add_objective("turbine.energy", ref=-1e4)
    other.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-10, maxiter=300, disp=False)
    other.driver.declare_coloring(show_summary=False)
    other.setup()
    other.run_model()
    assert other["turbine.energy"] == pytest.approx(problem["energy"], rel=1e-13)
    assert problem.run_driver() is not None
    assert problem.driver.outcome().success
    assert other.run_driver().success
    assert other["turbine.energy"] == pytest.approx(problem["energy"], rel=1e-6)


def test_turbine_begins_at_the_design_of_a_result():
    solution = Solution.load(RESULT)
    more = [f"start.from={solution.folder}", "start.method=blade"]
    problem = model_of(TurbineGroup(load_case("sine_limited_quadratic", more)))
    np.testing.assert_allclose(problem["chord"], solution.blade["chord_m"], rtol=1e-9)
    assert problem["gain_0"][0] == pytest.approx(solution.summary.gain, rel=1e-9)
    assert problem["energy"][0] == pytest.approx(solution.summary.energy_J, rel=1e-3)


MORE = {
    "two flows": {
        "scenarios": [
            {"name": "slow", "inflow": {"profile": "sine", "mean": 1.2}, "weight": 0.75},
            {"name": "fast", "inflow": {"profile": "sine"}, "weight": 0.25},
        ]
    },
    "states of a law": {"control": {"law": "tracking", "torque_limit": 700}},
    "local Reynolds numbers": {"rotor": {"polar": "naca63815", "reynolds": "local"}},
    "torque as unknown": {"control": {"law": "open_loop", "unknown": "torque"}},
    "several sections": SEVERAL,
}


@pytest.mark.parametrize("name", but(MORE, ["two flows", "states of a law", "torque as unknown"]))
def test_turbine_has_the_values_and_constraints_of_the_cases_own_problem(name):
    case = load_case(SHORT | LAWS["quadratic"] | MORE[name])
    base, other = build_problem(case, improve=False), om.Problem(reports=False)
    other.model.add_subsystem("turbine", TurbineGroup(case, improve=False))
    other.model.add_objective("turbine.objective")
    other.driver = om.ScipyOptimizeDriver()
    other.setup()
    for problem in (base, other):
        problem.run_model()
    assert other["turbine.objective"] == pytest.approx(base["objective"], rel=1e-13)
    for kind in ("get_constraint_values", "get_design_var_values"):
        group, wanted = ([*getattr(each.driver, kind)().values()] for each in (other, base))
        assert len(group) == len(wanted) > 1
        np.testing.assert_allclose(*map(np.sort, map(np.concatenate, (group, wanted))), rtol=1e-12)


def test_partials_of_the_turbine_by_complex_step():
    """All of the package's components in it but those of BEM, which take no complex numbers."""
    case = load_case(SHORT | LAWS["quadratic"] | {"limits": {"power": 5000, "thrust": 6500}})
    problem = model_of(TurbineGroup(case, improve=False))
    parts = [
        part.pathname
        for part in problem.model.system_iter(recurse=True, typ=om.ExplicitComponent)
        if type(part).__module__.startswith("hkt_mdo.") and part.name != "tables"
    ]
    parts = [name for name in parts if not name.endswith(("flow", "mass_and_inertia"))]
    assert len(parts) >= 9
    data = problem.check_partials(includes=parts, method="cs", out_stream=None)
    assert set(data) == set(parts)
    assert_check_partials(data, atol=1e-5, rtol=1e-8)
