"""Every package must find the same known optimum, hold bounds and own up to failure."""

import importlib
import signal
import sys

import numpy as np
import openmdao.api as om
import pytest

from hkt_mdo.errors import InputError, handling
from hkt_mdo.solve import drivers
from hkt_mdo.solve.drivers import make_driver
from hkt_mdo.solve.multipliers import State, gain, multipliers
from hkt_mdo.solve.stationary import Stationary
from hkt_mdo.solve.totals import Substitution

# OpenMDAO makes a directory '<problem>_out' where it runs: keep it out of the checkout.
pytestmark = pytest.mark.usefixtures("empty_directory")


@pytest.fixture
def empty_directory(tmp_path, monkeypatch):
    """Run in a directory of the test's own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _available():
    pairs = [("casadi", "IPOPT"), ("scipy", "SLSQP"), ("pyoptsparse", "IPOPT")]
    for package, optimizer in [*pairs, ("pyoptsparse", "SLSQP")]:
        missing = not drivers._is_usable(package, optimizer)
        mark = pytest.mark.skipif(missing, reason=f"{package} does not provide {optimizer}")
        yield pytest.param(package, optimizer, marks=mark, id=f"{package}-{optimizer}")


every_optimizer = pytest.mark.parametrize(("package", "optimizer"), list(_available()))
every_ipopt = pytest.mark.parametrize(
    ("package", "optimizer"), [param for param in _available() if "IPOPT" in param.values]
)


def ready(problem, driver):
    """Return the problem set up with a driver."""
    problem.driver = driver
    problem.setup()
    return problem


def solved(problem):
    """Return the problem, optimized, and how that ended."""
    problem.run_driver()
    return problem, problem.driver.outcome()


def of_formulas(driver, formulas, x, bounds, ref=None, **constraints):
    """Return the problem of the least f(x), and of constraints, as OpenMDAO takes them."""
    problem = om.Problem(reports=None)
    problem.model.add_subsystem("body", om.ExecComp(formulas, x=np.array(x)), promotes=["*"])
    problem.model.add_design_var("x", **bounds)
    problem.model.add_objective("f", ref=ref)
    for name, options in constraints.items():
        problem.model.add_constraint(name, **options)
    return ready(problem, driver)


def hock_schittkowski_71(driver, lower=25.0, equals=40.0):
    """Return problem 71 of Hock and Schittkowski (1981) at its standard start."""
    f, g, h = "x[0]*x[3]*(x[0] + x[1] + x[2]) + x[2]", "x[0]*x[1]*x[2]*x[3]", "sum(x**2)"
    start, bounds = [1.0, 5.0, 5.0, 1.0], {"lower": 1.0, "upper": 5.0}
    limits = {"g": {"lower": lower, "upper": 100.0}, "h": {"equals": equals}}
    return of_formulas(driver, [f"f = {f}", f"g = {g}", f"h = {h}"], start, bounds, **limits)


class Bowl(om.ExplicitComponent):
    """f = |x - (2, 2, 3) m|^2 in R^3, with a hook that each evaluation calls first."""

    def initialize(self):
        self.options.declare("hook", default=lambda count, x: None, recordable=False)
        self.count = 0

    def setup(self):
        self.add_input("x", np.zeros(3), units="m")
        self.add_output("f", units="m**2")
        self.add_output("sums", np.zeros(2), units="m")
        self.declare_partials("*", "*")

    def compute(self, inputs, outputs):
        self.count += 1
        x = inputs["x"].copy()
        self.options["hook"](self.count, x)
        outputs["f"] = np.sum((x - [2.0, 2.0, 3.0]) ** 2)
        outputs["sums"] = np.sum(x), x[0] + x[1]

    def compute_partials(self, inputs, partials):
        partials["f", "x"] = 2.0 * (inputs["x"] - [2.0, 2.0, 3.0])
        partials["sums", "x"] = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]


def bowl(driver, hook=None, linear=False):
    """Return the bowl under x0 + x1 <= 2 m and x <= 2.5 m: optimum 2.25 m^2 at (1, 1, 2.5) m."""
    problem = om.Problem(reports=None)
    options = {} if hook is None else {"hook": hook}
    problem.model.add_subsystem("bowl", Bowl(**options), promotes=["*"])
    problem.model.add_design_var("x", lower=-100.0, upper=250.0, units="cm", ref0=100.0, ref=330.0)
    scaling = {"units": "cm", "ref": 70.0, "linear": linear}
    problem.model.add_constraint("sums", indices=[1], upper=200.0, **scaling)
    problem.model.add_objective("f", ref=3.0)
    return ready(problem, driver)


def brachistochrone(driver):
    """Return Bernoulli's problem, 10 m across and 5 m down, as Dymos transcribes it."""
    dm = pytest.importorskip("dymos")
    example = importlib.import_module("dymos.examples.brachistochrone.brachistochrone_ode")
    problem = om.Problem(reports=None)
    driver.declare_coloring(show_summary=False)
    transcription = dm.GaussLobatto(num_segments=10, order=3)
    phase = dm.Phase(ode_class=example.BrachistochroneODE, transcription=transcription)
    problem.model.add_subsystem("trajectory", dm.Trajectory()).add_phase("phase", phase)
    phase.set_time_options(fix_initial=True, duration_bounds=(0.5, 10.0))
    phase.add_state("x", fix_initial=True, fix_final=True)
    phase.add_state("y", fix_initial=True, fix_final=True)
    phase.add_state("v", fix_initial=True)
    phase.add_control("theta", units="deg", lower=0.01, upper=179.9, ref=100.0)
    phase.add_parameter("g", units="m/s**2", val=9.80665, opt=False)
    phase.add_objective("time", loc="final")
    ready(problem, driver)
    phase.set_time_val(initial=0.0, duration=2.0)
    phase.set_state_val("x", [0.0, 10.0])
    phase.set_state_val("y", [10.0, 5.0])
    phase.set_state_val("v", [0.0, 9.9])
    phase.set_control_val("theta", [5.0, 100.5])
    return problem


# Known optima.


@every_optimizer
def test_hock_schittkowski_71(package, optimizer):
    driver = make_driver(package, optimizer)
    problem, outcome = solved(hock_schittkowski_71(driver))
    # Hock and Schittkowski (1981), p. 92.
    assert problem.get_val("f")[0] == pytest.approx(17.0140173, abs=1e-6)
    np.testing.assert_allclose(problem.get_val("x"), [1.0, 4.7429994, 3.8211503, 1.3794082], 1e-5)
    assert np.all(problem.get_val("x") >= 1.0)
    assert problem.get_val("h")[0] == pytest.approx(40.0, abs=1e-6)
    assert (outcome.success, outcome.package, outcome.optimizer) == (True, package, optimizer)
    assert 3 <= outcome.iterations <= driver.result.deriv_evals
    assert driver.result.deriv_evals <= driver.result.model_evals < 30
    assert outcome.message
    assert driver.result.success
    problem.set_val("x", [1.0, 5.0, 5.0, 1.0])
    assert solved(problem)[1] == outcome


@every_optimizer
def test_multipliers_and_what_a_little_of_a_bound_gives(package, optimizer):
    states = []
    for more in (0.0, 1e-4):
        driver = make_driver(package, optimizer, tolerance=1e-9)
        problem, _ = solved(hock_schittkowski_71(driver, lower=25.0 * (1.0 + more)))
        states.append(State.of(driver))
        if not more:
            problem.model.linear_solver = Substitution()
            prices, x = multipliers(driver, states[0]), problem.get_val("x").copy()
    # as IPOPT's documentation has them for its example, this problem
    expected = [-0.55229366, 0.16146857, -1.08787121, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(prices, expected, rtol=1e-5, atol=1e-6)
    problem.set_val("x", x)
    problem.run_model()
    changed = gain(states[0], prices, State.of(driver))
    assert changed == pytest.approx(states[1].objective - states[0].objective, rel=1e-3)
    assert changed == pytest.approx(0.55229366 * 25e-4, rel=1e-5)


@every_optimizer
def test_multipliers_of_scaled_problems(package, optimizer):
    driver = make_driver(package, optimizer, tolerance=1e-9)
    problem, _ = solved(bowl(driver))
    problem.model.linear_solver, state = Substitution(), State.of(problem.driver)
    # at (1, 1, 2.5) m: df/dx = (-2, -2, -1) m, so 2 m a metre of the sum and 1 m of the bound
    prices = multipliers(driver, state) / state.scaler
    np.testing.assert_allclose(prices, [2.0 * 0.7, 0.0, 0.0, 1.0 * 2.3], rtol=1e-5, atol=1e-5)


@every_optimizer
@pytest.mark.parametrize("linear", [False, True])
def test_scaled_quantities_in_other_units(package, optimizer, linear):
    problem, outcome = solved(bowl(make_driver(package, optimizer), linear=linear))
    assert outcome.success
    np.testing.assert_allclose(problem.get_val("x", "m"), [1.0, 1.0, 2.5], atol=1e-5)
    assert problem.get_val("f")[0] == pytest.approx(2.25, abs=1e-5)
    # Scaling and units may cost the last bit, no more.
    assert np.all(problem.get_val("x", "m") <= 2.5 * (1 + 2 * np.finfo(float).eps))


@every_optimizer
def test_maximum_and_part_of_a_design_variable(package, optimizer):
    formula = "f = 4 - x[0]**2 - (x[2] - 3)**2"
    bounds = {"indices": [0, 2], "lower": [0.5, -9.0], "upper": 9.0}
    driver = make_driver(package, optimizer)
    problem, outcome = solved(of_formulas(driver, formula, [5.0, 7.0, 0.5], bounds, ref=-2.0))
    assert outcome.success
    np.testing.assert_allclose(problem.get_val("x"), [0.5, 7.0, 3.0], atol=1e-5)


@every_optimizer
def test_coloured_brachistochrone(package, optimizer):
    driver = make_driver(package, optimizer)
    problem, outcome = solved(brachistochrone(driver))
    assert outcome.success
    # 1.8016 s is the cycloid's time; ten segments of third order come within 3e-4.
    duration = problem.get_val("trajectory.phase.timeseries.time")[-1, 0]
    assert duration == pytest.approx(1.8016, abs=3e-4)
    assert driver._coloring_info.coloring is not None


@every_optimizer
@pytest.mark.parametrize("bounded", ["design variable", "constraint"])
def test_negative_scale_of_a_bound_is_refused(package, optimizer, bounded):
    bounds = {"lower": -5.0, "ref": -1.0 if bounded == "design variable" else 1.0}
    limit = {"lower": 2.0, "ref": -1.0 if bounded == "constraint" else 1.0}
    arguments = ["f = x**2", "g = 2*x"], 1.0, bounds
    with pytest.raises(ValueError, match="negative ref"):
        of_formulas(make_driver(package, optimizer), *arguments, g=limit).final_setup()


# Records and progress.


@every_optimizer
def test_cases_are_recorded(package, optimizer, empty_directory):
    driver = make_driver(package, optimizer)
    driver.add_recorder(om.SqliteRecorder(str(empty_directory / "cases.sql")))
    problem, _ = solved(hock_schittkowski_71(driver))
    problem.cleanup()
    cases = om.CaseReader(str(empty_directory / "cases.sql"))
    names = cases.list_cases("driver", out_stream=None)
    assert len(names) == driver.result.model_evals
    last = cases.get_case(names[-1])
    np.testing.assert_allclose(last.get_design_vars()["x"], problem.get_val("x"))
    assert last.get_objectives()["f"][0] == pytest.approx(17.0140173, abs=1e-6)
    assert set(last.get_constraints()) == {"g", "h"}


@every_optimizer
def test_progress_is_reported_in_physical_objective_and_scaled_violation(package, optimizer):
    reports = []
    bowl(make_driver(package, optimizer, progress=lambda *news: reports.append(news))).run_driver()
    counts, objectives, violations = zip(*reports, strict=True)
    assert list(counts) == list(range(counts[0], counts[0] + len(counts)))
    assert objectives[-1] == pytest.approx(2.25, abs=1e-5)
    assert violations[-1] == pytest.approx(0.0, abs=1e-6)
    assert all(type(number) is float for number in objectives + violations)


# Failures.


@every_optimizer
@pytest.mark.parametrize(
    ("most", "bounds", "word"),
    [(200, (99.0, 5.0), ""), (2, (), "iteration")],
    ids=["infeasible", "too few iterations"],
)
def test_failure_is_told(package, optimizer, most, bounds, word):
    driver = make_driver(package, optimizer, max_iterations=most)
    _, outcome = solved(hock_schittkowski_71(driver, *bounds))
    assert not outcome.success
    assert outcome.message
    assert word in outcome.message.lower()


@every_optimizer
@pytest.mark.parametrize("stored", [True, False])
def test_interrupt_stops_the_run(package, optimizer, stored):
    def hook(count, x):
        if count == 3 and stored:
            signal.raise_signal(signal.SIGINT)
        elif count == 3:
            raise KeyboardInterrupt

    driver = make_driver(package, optimizer)
    handler = signal.getsignal(signal.SIGINT)
    problem = bowl(driver, hook)
    with pytest.raises(KeyboardInterrupt):
        problem.run_driver()
    assert problem.model.bowl.count == 3
    assert signal.getsignal(signal.SIGINT) is handler
    assert not driver.outcome().success


def test_sigterm_between_evaluations_stops_ipopt_where_ctrl_c_is_ignored(monkeypatch):
    """A job in the background ignores Ctrl-C, and is ended by SIGTERM."""

    def terminated(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Stationary, "note", lambda *_: signal.raise_signal(signal.SIGTERM))
    ignored, ended = handling(signal.SIGINT, signal.SIG_IGN), handling(signal.SIGTERM, terminated)
    with ignored, ended, pytest.raises(KeyboardInterrupt):
        bowl(make_driver("casadi")).run_driver()


@every_optimizer
def test_error_in_the_model_is_raised(package, optimizer):
    def hook(count, x):
        if count >= 3:
            raise ZeroDivisionError("deliberate")

    driver = make_driver(package, optimizer)
    with pytest.raises(ZeroDivisionError, match="deliberate"):
        bowl(driver, hook).run_driver()


@every_ipopt
@pytest.mark.parametrize("not_a_number", [False, True])
def test_ipopt_backs_away_from_a_failed_evaluation(package, optimizer, not_a_number):
    failures = []

    def hook(count, x):
        if count in (4, 5):
            failures.append(count)
            if not not_a_number:
                raise om.AnalysisError("no solution here")
            x[:] = np.nan

    problem, outcome = solved(bowl(make_driver(package, optimizer), hook))
    assert failures == [4, 5]
    assert outcome.success
    assert problem.get_val("f")[0] == pytest.approx(2.25, abs=1e-5)


# Choice.


def test_auto_falls_back_without_pyoptsparse(monkeypatch):
    monkeypatch.setattr(drivers, "find_spec", lambda name: None if name == "pyoptsparse" else name)
    assert make_driver().package == "casadi"
    assert make_driver(optimizer="SLSQP").package == "scipy"


def test_a_broken_pyoptsparse_is_passed_over(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoptsparse", object())
    monkeypatch.setattr(drivers, "find_spec", lambda name: name)
    assert make_driver().package == "casadi"


@pytest.mark.parametrize(
    ("package", "optimizer", "remedy"),
    [
        ("auto", "SNOPT", "SNOPT is commercial: build pyoptsparse with your copy of it"),
        ("pyoptsparse", "IPOPT", "conda install -c conda-forge pyoptsparse"),
        ("casadi", "IPOPT", "pip install casadi"),
        ("auto", "IPOPT", "conda install -c conda-forge pyoptsparse or pip install casadi"),
    ],
)
def test_a_missing_package_names_its_remedy(package, optimizer, remedy, monkeypatch):
    monkeypatch.setattr(drivers, "find_spec", lambda name: None)
    key, value = ("optimizer", optimizer) if package == "auto" else ("package", package)
    message = f"^driver.{key} = '{value}': {optimizer} is not installed; {remedy}"
    with pytest.raises(InputError, match=message):
        make_driver(package, optimizer)


@pytest.mark.parametrize(
    ("package", "optimizer"), [("scipy", "IPOPT"), ("casadi", "SLSQP"), ("auto", "ipopt")]
)
def test_an_impossible_choice_is_refused(package, optimizer):
    with pytest.raises(InputError, match="choose from"):
        make_driver(package, optimizer)


def test_a_bound_on_the_barrier_reaches_ipopt_alone():
    ipopt = drivers.near_start(1e-5)
    assert make_driver("casadi", ipopt=ipopt).opt_settings["mu_max"] == 1e-5
    assert "mu_max" not in make_driver("casadi").opt_settings
    assert solved(hock_schittkowski_71(make_driver("scipy", "SLSQP", ipopt=ipopt)))[1].success
