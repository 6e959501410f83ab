"""What a user would otherwise reach for, on one problem: open loop at a fixed blade, 700 N m.

All three maximize the same energy over the same torque curve, from a constant tip speed ratio a
fifth above the best: this package; CasADi with IPOPT and exact Hessians over the same quadratic
pieces of rotor speed; SciPy's SLSQP over a torque history with the integration inside it.
"""

import time

import casadi
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import minimize

from cases import OPEN_LOOP, case_of, optimize, start_of
from hkt_mdo.problem.build import assemble
from hkt_mdo.rotor.bem import rotor_coefficients
from hkt_mdo.rotor.steady_optimum import best_operation

LIMIT, FASTER = 700.0, 1.2
SIZES = (30, 100, 300)
SHOOTING_KNOTS = 21  # more only cost time: each is another integration a gradient


class Plant:
    """The rotor that all three optimize: torque curve, flow, inertia, start."""

    def __init__(self, segments, duration):
        # the peers' problem has no condition on the last speed
        case = case_of(OPEN_LOOP, segments, duration, "free", design="{blade: fixed}")
        self.physics, self.setup = start_of(case)
        self.radius, self.density = case.rotor.radius, case.fluid.density
        blade, polar, self.nodes = self.physics.blade, self.physics.rotor.polar, self.setup.nodes
        self.table = rotor_coefficients(blade, polar, self.nodes).torque
        _, self.inertia = self.physics.rotor.mass_and_inertia(blade)
        best = best_operation(blade, polar).tip_speed_ratio
        self.ratio, self.segments, self.duration = FASTER * best, segments, duration

    def scale(self, flow):
        """Return torque over torque coefficient, N*m."""
        return 0.5 * np.pi * self.radius**3 * self.density * flow**2


def by_this_package(plant):
    """Return energy, iterations and seconds; the start is the peers'."""
    began = time.perf_counter()
    problem = assemble(plant.physics, plant.setup)
    at = plant.physics.scenarios[0].samples
    speed = plant.ratio * plant.physics.inflow.speed_at(at) / plant.radius
    phase = problem.model.operation.traj.phases.phase
    phase.set_control_val("rotor_speed", speed, time_vals=at, interpolation_kind="cubic")
    problem.run_model()
    problem.run_driver()
    ended = problem.driver.outcome()
    assert ended.success, ended.message
    return float(problem.get_val("energy")[0]), ended.iterations, time.perf_counter() - began


def by_casadi(plant):
    """Return energy, iterations and seconds of the same transcription with exact Hessians."""
    began = time.perf_counter()
    n, step = plant.segments, plant.duration / plant.segments
    at = np.linspace(0.0, plant.duration, 2 * n + 1)  # ends and middles
    flow, weights = plant.physics.inflow.speed_at(at), np.full(2 * n + 1, step / 3.0)
    weights[1::2], weights[[0, -1]] = 2.0 * step / 3.0, step / 6.0
    spline = make_interp_spline(plant.nodes, plant.table, k=3, bc_type="natural")
    unit = float(np.mean(plant.ratio * flow / plant.radius))
    w = unit * casadi.MX.sym("w", 2 * n + 1)
    x = casadi.symvar(w)[0]
    ratio = casadi.MX.sym("ratio")
    value = casadi.bspline(ratio, spline.c.tolist(), [spline.t.tolist()], [3], 1)
    curve = casadi.Function("curve", [ratio], [value]).map(w.numel())
    torque = plant.scale(flow) * curve((w * plant.radius / flow).T).T
    left, middle, right = w[:-2:2], w[1::2], w[2::2]
    rate = [(-3 * left + 4 * middle - right) / step, (right - left) / step]
    rate.append((left - 4 * middle + 3 * right) / step)
    sides = [torque[:-2:2], torque[1::2], torque[2::2]]
    control = [q - plant.inertia * a for q, a in zip(sides, rate, strict=True)]
    smooth = (rate[2][:-1] - rate[0][1:]) * step / unit
    energy = casadi.dot(weights, torque * w)
    reference = float(weights @ flow**3) * 0.25 * plant.density * np.pi * plant.radius**2
    problem = {"x": x, "f": -energy / (0.1 * reference)}
    problem["g"] = casadi.vertcat(*(c / LIMIT for c in control), smooth)
    solver = casadi.nlpsol("solver", "ipopt", problem, {
        "print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-7}
    })  # fmt: skip
    bounds = np.concatenate((np.ones(3 * n), np.zeros(n - 1)))
    low, high = (end * plant.nodes[k] / plant.ratio for k, end in ((0, 1.02), (-1, 0.98)))
    start = plant.ratio * flow / plant.radius / unit
    optimum = solver(x0=start, lbx=low * start, ubx=high * start, lbg=0.0 * bounds, ubg=bounds)
    assert solver.stats()["success"], solver.stats()["return_status"]
    seconds = time.perf_counter() - began
    return -float(optimum["f"]) * 0.1 * reference, solver.stats()["iter_count"], seconds


def by_shooting(plant, iterations):
    """Return energy, iterations and seconds of SLSQP over torque knots, integrating for each."""
    began = time.perf_counter()
    curve = CubicSpline(plant.nodes, plant.table, bc_type="natural")
    knots = np.linspace(0.0, plant.duration, SHOOTING_KNOTS)
    flow = plant.physics.inflow.speed_at(knots)
    first = plant.ratio * flow[0] / plant.radius
    reference = 0.25 * plant.density * np.pi * plant.radius**2 * plant.duration * np.mean(flow**3)

    def loss(control):
        def rates(at, state):
            speed, v = state[0], float(plant.physics.inflow.speed_at(at))
            torque = plant.scale(v) * float(curve(speed * plant.radius / v))
            brake = LIMIT * np.interp(at, knots, control)
            return [(torque - brake) / plant.inertia, torque * speed / reference]

        path = solve_ivp(
            rates, (0.0, plant.duration), [first, 0.0], method="LSODA", rtol=1e-8, atol=1e-10
        )
        return -10.0 * path.y[1, -1]

    start = plant.scale(flow) * curve(plant.ratio) / LIMIT
    optimum = minimize(
        loss, start, method="SLSQP", bounds=[(0.0, 1.0)] * knots.size,
        options={"ftol": 1e-9, "eps": 1e-5, "maxiter": iterations},
    )  # fmt: skip
    return -0.1 * optimum.fun * reference, optimum.nit, time.perf_counter() - began


@pytest.mark.parametrize("segments", SIZES)
def test_the_same_optimum(benchmark, full, in_turns, segments):
    """This package and CasADi find the same number; so does shooting, where it is affordable."""
    size = segments if full else segments // 5
    plant = Plant(size, size)
    methods = {"hkt_mdo": by_this_package, "CasADi": by_casadi}
    calls = {name: lambda method=method: method(plant) for name, method in methods.items()}
    in_turns(calls, 3 if full else 1)
    results = dict(in_turns.results)
    if segments == SIZES[0]:
        results["shooting"] = by_shooting(plant, 100 if full else 1)
    if segments == SIZES[0] and full:
        # a coarse torque history and the first second's transient cost a little energy
        assert results["shooting"][0] == pytest.approx(results["CasADi"][0], rel=2e-3)
    benchmark.extra_info["rows"] = {name: list(values) for name, values in results.items()}
    assert results["hkt_mdo"][0] == pytest.approx(results["CasADi"][0], rel=1e-6)


@pytest.mark.parametrize("segments", [60, 300, 1000])
def test_slsqp_where_it_pays(benchmark, full, segments):
    """SLSQP's dense algebra grows with the cube: where IPOPT overtakes it."""
    rows, size = {}, segments if full else 10
    for name in ("IPOPT", "SLSQP"):
        case = case_of(segments=size, driver=f"{{optimizer: {name}, max_iterations: 200}}")
        prepared = start_of(case, cold=True)

        def run(prepared=prepared):
            return optimize(*prepared)

        if name == "IPOPT":
            problem, ended, seconds = benchmark.pedantic(run, rounds=1, iterations=1)
        else:
            problem, ended, seconds = run()
        energy = float(problem.get_val("energy")[0])
        rows[name] = [energy, ended.iterations, seconds["driver"], ended.success]
    benchmark.extra_info["rows"] = rows
    if "SLSQP" in rows and rows["SLSQP"][3] and rows["IPOPT"][3]:
        assert rows["IPOPT"][0] == pytest.approx(rows["SLSQP"][0], rel=1e-6)
