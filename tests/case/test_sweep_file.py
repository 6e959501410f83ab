"""The file of a sweep: its points, and what is refused."""

import numpy as np
import pytest
from scipy.stats import qmc

from hkt_mdo.case.sweep import load_sweep
from hkt_mdo.errors import InputError


def read(put, over, more=""):
    """Return the sweep of a file with some axes and more."""
    return load_sweep(put("s.yaml", f"case: sine_limited_quadratic\nover: {over}\n{more}"))


def test_a_grid_has_every_combination(put):
    mean = "{from: 1.3 m/s, to: 1.5 m/s, count: 3}"
    power = "{from: 1, to: 100, count: 3, spacing: log}"
    over = f"{{control.torque_limit: [600 N m, 700], inflow.mean: {mean}, limits.power: {power}}}"
    sweep = read(put, over)
    assert (sweep.shape, sweep.size) == ((2, 3, 3), 18)
    points = list(sweep.points())
    assert len(points) == 18
    keys = "control.torque_limit", "inflow.mean", "limits.power"
    assert points[0] == dict(zip(keys, ("600 N m", "1.3 m/s", 1.0), strict=True))
    assert points[4] == dict(zip(keys, ("600 N m", "1.4 m/s", 10.0), strict=True))
    case = sweep.case_at(points[-1])
    assert case.control.torque_limit == 700.0  # in place of the case's own
    assert case.inflow.mean == 1.5
    assert case.limits.power.bound == 100.0
    again = read(put, sweep.to_yaml().partition("over:")[2].partition("seed")[0])
    assert list(again.points()) == points
    assert "name: '1e3'" in read(put, "{rotor.radius: [1]}", "set: {name: '1e3'}").to_yaml()


def test_objectives_laws_and_whole_sections_are_axes(put):
    laws = "[{law: quadratic}, {law: curve, knots: 6}]"
    over = f"{{objective: [captured, electrical], control: {laws}, limits.power: [4 kW, null]}}"
    sweep = read(put, over)
    cases = [sweep.case_at(point) for point in sweep.points()]
    assert [case.objective.kind for case in cases] == ["captured"] * 4 + ["electrical"] * 4
    assert [case.control.law for case in cases[::2]] == ["quadratic", "curve"] * 2
    assert cases[2].control.knots == 6
    assert [case.limits.power and case.limits.power.bound for case in cases] == [4000.0, None] * 4


def test_samples_are_a_latin_hypercube_with_their_seed(put):
    over = "{rotor.radius: {from: 1.2, to: 1.5}, limits.power: {from: 1, to: 100, spacing: log}}"
    sweep = read(put, over, "samples: 8\nseed: 3\n")
    points = list(sweep.points())
    assert sweep.size == 8
    drawn = qmc.LatinHypercube(2, seed=3).random(8)
    assert [x["rotor.radius"] for x in points] == pytest.approx(1.2 + 0.3 * drawn[:, 0])
    assert [x["limits.power"] for x in points] == pytest.approx(100.0 ** drawn[:, 1])
    for column in drawn.T:  # one in each eighth
        assert sorted(np.floor(8 * column)) == [*range(8)]
    assert [[*position.values()] for position in sweep.places()] == drawn.tolist()


def test_a_sweep_that_is_not_there_is_told():
    with pytest.raises(InputError, match=r"no.yaml: does not exist"):
        load_sweep("no.yaml")
