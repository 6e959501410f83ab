"""An optimizer ends at an optimum that no iterate improves, and tells by how much it may lack."""

import numpy as np
import openmdao.api as om
import pytest

from hkt_mdo.solve.drivers import make_driver
from hkt_mdo.solve.stationary import PATIENCE, Stationary

LOWER, UPPER = np.array([-np.inf, 0.0]), np.array([1.0, np.inf])
CENTER, START = np.array([2.0, -1.0]), np.array([0.5, 0.5])


def on_path(barrier):
    """Return point, multipliers, objective and gradient of min |x - c|² / 2 at a barrier parameter.

    On the central path the multiplier of a bound times the distance from it is the parameter.
    """
    room = 0.5 * (-1.0 + np.sqrt(1.0 + 4.0 * barrier))  # of (room + 1) room = barrier, each
    point = np.array([1.0 - room, room])
    multipliers = np.array([1.0, -1.0]) * barrier / room
    return point, multipliers, 0.5 * np.sum((point - CENTER) ** 2), point - CENTER + multipliers


def test_the_gap_is_that_of_objective_and_dual():
    point, multipliers, objective, gradient = on_path(1e-5)
    stationary = Stationary(LOWER, UPPER, 1e-7, START)
    assert not stationary.note(point, multipliers, objective, gradient)
    assert np.array_equal(stationary.best, point)
    assert stationary.gap == pytest.approx(2e-5 / objective)
    # it bounds what the objective lacks of the optimum, which is 1
    assert 0.0 < objective - 1.0 < stationary.gap * objective
    stationary = Stationary(LOWER, UPPER, 1e-7, START)  # too small to wait for more, if none is won
    assert [stationary.note(*on_path(1e-7)) for _ in range(2)] == [False, True]


def test_only_an_optimum_is_kept():
    point, multipliers, objective, gradient = on_path(1e-5)
    for spoiled in (
        (on_path(1e-3)),  # a gap of a thousandth
        (point + np.array([1e-3, 0.0]), multipliers, objective, gradient),  # beyond its bound
        (point, multipliers, objective, gradient + 1e-3),
    ):
        stationary = Stationary(LOWER, UPPER, 1e-7, START)
        assert not any(stationary.note(*spoiled) for _ in range(2 * PATIENCE))
        assert stationary.best is None


def test_the_end_waits_for_iterates_that_are_better():
    point, multipliers, objective, gradient = on_path(1e-6)
    stationary = Stationary(LOWER, UPPER, 1e-7, START)
    better = [objective * (1.0 - 1e-6 * count) for count in range(5)]
    assert not any(stationary.note(point, multipliers, each, gradient) for each in better)
    ends = [stationary.note(point, multipliers, better[-1], gradient) for _ in range(40)]
    assert ends.index(True) == PATIENCE - 1


class Rough(om.ExplicitComponent):
    """A bowl with noise in its gradient, which never vanishes."""

    def setup(self):
        self.add_input("x", np.zeros(3))
        self.add_output("f")
        self.declare_partials("f", "x")

    def compute(self, inputs, outputs):
        outputs["f"] = 10.0 + np.sum((inputs["x"] - 1.0) ** 2)

    def compute_partials(self, inputs, partials):
        x = inputs["x"]
        partials["f", "x"] = 2.0 * (x - 1.0) + 2e-5 * np.sin(1e13 * x)


@pytest.mark.parametrize(("most", "stuck"), [(500, ""), (12, "Maximum_Iterations_Exceeded")])
def test_ipopt_ends_where_nothing_is_gained(monkeypatch, most, stuck):
    """After some patience, or at once where IPOPT finds no step any more."""
    monkeypatch.setattr("hkt_mdo.solve.casadi_driver.STUCK", (stuck,))
    driver = make_driver("casadi", "IPOPT", 1e-7, most)
    problem = om.Problem(driver=driver, reports=False)
    problem.model.add_subsystem("rough", Rough(), promotes=["*"])
    problem.model.add_design_var("x", lower=-5.0, upper=5.0)
    problem.model.add_objective("f")
    problem.setup()
    problem.run_driver()
    outcome = driver.outcome()
    assert outcome.success
    assert "no better iterate" in outcome.message
    assert outcome.iterations < 200
    assert problem.get_val("x") == pytest.approx(1.0, abs=1e-4)
    assert problem.get_val("f")[0] == pytest.approx(10.0, abs=1e-6)
