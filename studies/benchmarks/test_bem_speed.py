"""Speed of the blade element momentum solver beside CCBlade, in one run, values checked as well.

The derivative with respect to the Reynolds number is exactly zero for a polar without one.
"""

import itertools
import time

import numpy as np
import pytest

from hkt_mdo.case import Fluid, Rotor
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import PolarFamily

NINE = np.concatenate((np.arange(0.2, 0.95, 0.1), [0.999]))
FIFTY = np.linspace(0.2, 0.99, 50)


def rotor(stations, points):
    blade = build_turbine(Rotor(stations=tuple(stations)), Fluid(), 1.0).blade
    return blade, PolarFamily.from_file("naca63815_Re2e5").polars[0], np.linspace(1.0, 14.0, points)


def have_one_root(blade, polar, ratio):
    """Tell for each point whether the residual of every station has one sign change."""
    angles, single = np.linspace(1e-3, np.pi - 1e-3, 2001), np.ones(ratio.size, dtype=bool)
    for j, r in enumerate(blade.r):
        station = blade.chord[j], blade.twist[j], r, blade.hub_radius, blade.tip_radius
        terms = [
            bem._terms(angle, *station, blade.blade_count, polar.coefficients)[0]
            for angle in angles
        ]
        s, c, _, _ = np.transpose(terms)
        f = s - c * blade.tip_radius / (ratio[:, None] * r)
        single &= np.count_nonzero(np.diff(np.sign(f)), axis=1) == 1
    return single


def check(mine, theirs, blade, polar, ratio, derivatives):
    """Compare the benchmarked numbers with CCBlade's, where every section has one root only."""
    single = have_one_root(blade, polar, ratio)
    assert np.mean(single) > 0.8
    both = mine, theirs
    pairs = [[getattr(each, name) for each in both] for name in ("torque", "power", "thrust")]
    if derivatives:
        pairs += zip(*(each.torque_table[1:] for each in both), strict=True)
    for index, (ours, reference) in enumerate(pairs):
        limit = 1e-8 if index < 3 else 1e-6
        assert np.max(np.abs(ours - reference)[single]) <= limit * np.max(np.abs(reference))


@pytest.mark.parametrize(
    ("stations", "points", "derivatives", "least"),
    [
        (NINE, 27, False, 50),
        (NINE, 27, True, 50),
        (FIFTY, 200, False, 200),
        (FIFTY, 200, True, 200),
    ],
    ids=["27x9", "27x9 derivatives", "200x50", "200x50 derivatives"],
)
def test_faster_than_ccblade(benchmark, full, stations, points, derivatives, least):
    """CCBlade is timed just before, twice: it takes 20 ms to 1 s."""
    if not full:
        stations, points = stations[:: len(stations) // 9], 27
    arguments = (*rotor(stations, points), derivatives)
    start = time.perf_counter()
    theirs = ccblade.rotor_coefficients(*arguments)
    seconds = time.perf_counter() - start
    start = time.perf_counter()
    theirs = ccblade.rotor_coefficients(*arguments)
    seconds = min(seconds, time.perf_counter() - start)
    mine = benchmark(bem.rotor_coefficients, *arguments)
    check(mine, theirs, *arguments)
    fastest = benchmark.stats.stats.min if full else np.nan
    benchmark.extra_info |= {
        "times_faster_than_ccblade": seconds / fastest,
        "seconds": fastest,
        "seconds_per_section": fastest / (points * len(stations)),
    }
    if full:
        assert seconds / fastest > least


def test_cost_per_section_and_point_falls_with_size(full):
    """Until memory bandwidth rules: each size within noise no dearer than the one before."""
    cost = []
    sizes = ((3, 3), (9, 27), (50, 200), (100, 1000))
    for stations, points in sizes if full else sizes[:2]:
        blade, polar, ratio = rotor(np.linspace(0.2, 0.99, stations), points)
        bem.rotor_coefficients(blade, polar, ratio)
        times = []
        for _ in range(15):
            start = time.perf_counter()
            bem.rotor_coefficients(blade, polar, ratio)
            times.append(time.perf_counter() - start)
        cost.append(min(times) / (stations * points))
    if full:
        assert all(later < 1.1 * earlier for earlier, later in itertools.pairwise(cost))
