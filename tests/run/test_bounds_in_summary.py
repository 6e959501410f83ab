"""What of a design ends at a bound of its case is told, with its places along the blade."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.results.summary import LoadEntry, Summary, unasked
from hkt_mdo.results.words import texts
from hkt_mdo.run.summary import summarize

SHORT = {"inflow": "sine", "control": "quadratic", "phase": {"duration": 8.0, "segments": 8}}


def bound_rows(finished):
    """Return the rows about bounds, by their labels."""
    summary = summarize(finished)
    rows = texts(summary.rows(finished.physics.case))
    bounds = {label: text for label, text in rows.items() if " at its " in label}
    assert len(bounds) == len(summary.at_bounds)
    return bounds


def test_a_larger_rotor_and_gain_would_capture_more(solve_physics):
    """Without a limit of the torque; the best gain is 0.5 rho pi R^5 Cp / lambda^3."""
    design = {"blade": "fixed", "radius_bounds": [1.3, 1.45], "gain_bounds": [2.0, 10.0]}
    solved = solve_physics(SHORT | {"design": design, "rotor": {"cone": 10}})
    peak = solved.physics.rotor.best_operation(solved.result.point.blade)
    radius = solved.result.point.blade.rotor_radius
    best = 500.0 * np.pi * radius**5 * peak.power_coefficient / peak.tip_speed_ratio**3
    assert best > 20.0
    bounds = bound_rows(solved)
    assert bounds == {"radius at its upper bound": "1.45 m", "gain at its upper bound": "10"}


@pytest.fixture(scope="module")
def finished(solve_physics):
    design = {"chord_bounds": [0.05, 0.4], "twist_bounds": [-10, 25]}
    return solve_physics(SHORT | {"design": design})


def of_shape(finished, chord, twist):
    """Return the run with another blade in place of the found one."""
    point = finished.result.point
    blade = point.blade.with_shape(chord, np.deg2rad(twist), None)
    result = replace(finished.result, point=replace(point, blade=blade))
    return replace(finished, result=result)


def test_parts_of_the_blade_at_a_bound_are_reported(finished):
    stations = finished.result.point.blade.r / finished.result.point.blade.tip_radius
    inside, twist = np.full(9, 0.2), np.linspace(20.0, 0.0, 9)
    assert bound_rows(of_shape(finished, inside, twist)) == {}
    ends = [f"{stations[i]:.4g}" for i in range(9)]
    chord = np.array([0.4, 0.4, 0.399, 0.4, 0.4 - 1e-9, 0.4, 0.2, 0.05, 0.1])
    assert bound_rows(of_shape(finished, chord, twist)) == {
        "chord at its upper bound": f"0.4 m, from r/R = {ends[0]} to {ends[1]} and "
        f"from r/R = {ends[3]} to {ends[5]}",
        "chord at its lower bound": f"50 mm, at r/R = {ends[7]}",
    }
    twist[-1] = -10.0
    assert bound_rows(of_shape(finished, inside, twist)) == {
        "twist at its lower bound": f"-10 deg, at r/R = {ends[8]}"
    }


@pytest.mark.parametrize(
    ("name", "value", "limits", "word"),
    [
        ("cavitation", 1.05, {}, ""),
        ("cavitation", 4.2, {}, "cavitates: the case has no limits.cavitation"),
        ("stress", 239e6, {}, ""),
        ("stress", 241e6, {}, "more than the material allows: the case has no limits.stress"),
        ("tip_speed", 14.0, {}, ""),
        ("tip_speed", 30.0, {}, "fast: near the surface a usual section cavitates"),
        ("tip_speed", 30.0, {"rotor_speed": 25}, ""),
        ("tip_speed", 30.0, {"cavitation": {"depth": 3}}, ""),
        ("thrust", 1e9, {}, ""),
    ],
)
def test_a_large_load_without_a_limit_is_reported(name, value, limits, word):
    case = load_case(SHORT | {"limits": limits})
    load = LoadEntry(value=value)
    assert unasked(name, load, case).startswith(word)
    assert bool(unasked(name, load, case)) == bool(word)
    assert unasked(name, LoadEntry(), case) == ""
    summary = Summary(success=True, loads={name: load})
    row = texts(summary.rows(case))[f"largest {name.replace('_', ' ')}"]
    assert word in row
    assert ("the case has no limit" in row) == bool(word)
