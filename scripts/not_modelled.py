"""Sizes of what the program leaves out, for docs/not_modelled.md.

python scripts/not_modelled.py RESULT ...

Prints, for the blade of each result: gravity less buoyancy at the root, the water that a flat plate
would drag along in rotation, and the times of an unsteady section; and, of formulas, blockage,
waves, a pile and small eddies.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import quad, trapezoid

from hkt_mdo.dynamics.sampled import von_karman
from hkt_mdo.results.solution import Solution

GRAVITY = 9.80665
JONES = 0.0455, 0.3  # of Wagner's function, times 2 W / c (R. T. Jones, NACA Report 681, 1940)


def main():
    """Print the sizes."""
    for folder in map(Path, sys.argv[1:]):
        print(f"{folder.name}: {'; '.join(of_blade(Solution.load(folder)))}")
    for share in (0.05, 0.1):
        more = (1.0 - share) ** -2 - 1.0
        print(f"blockage {share:.0%}: largest power coefficient {more:+.0%}")
    height, period, depth = 0.5, 4.0, 3.0
    number = (2.0 * np.pi / period) ** 2 / GRAVITY
    speed = np.pi * height / period * np.exp(-number * depth)
    print(f"waves of {height} m, {period} s: {speed:.2f} m/s at a depth of {depth} m")
    print(f"pile of 0.2 m, 0.5 m behind the blades: flow less by {(0.1 / 0.5) ** 2:.0%}")
    length, diameter = 4.0, 2.8
    small = quad(von_karman, length / diameter, np.inf)[0]
    print(
        f"eddies of {length} m: {small:.0%} of the variance is faster than V / D, D = {diameter} m"
    )


def of_blade(solution):
    """Yield the sizes of a result's blade as texts."""
    design = solution.design()
    blade, world = design.blade, design.physics
    r, hub, density = blade.edges, blade.hub_radius, world.density
    chord, twist = (np.interp(r, blade.r, each) for each in (blade.chord, blade.twist))
    area = np.interp(r, blade.r, np.broadcast_to(world.section_area, blade.r.shape)) * chord**2
    excess = world.case.rotor.blade_material.density - density
    moment = GRAVITY * trapezoid(excess * area * (r - hub), r)
    speed, flow = solution.simulation["rotor_speed_rad_s"], solution.simulation["inflow_speed_m_s"]
    mean = float(np.mean(speed)), float(np.mean(flow))
    sections = world.rotor.sections(blade, mean[0] * blade.rotor_radius / mean[1])
    load = 0.5 * density * mean[1] ** 2 * sections.tangential_load[0]
    edgewise = trapezoid(np.interp(r, blade.r, load) * (r - hub), r)
    yield (
        f"gravity less buoyancy {moment:.3g} N m at the root of a blade, reversing every turn, "
        f"mean edgewise moment {edgewise:.3g} N m"
    )
    dragged = density * np.pi * (0.5 * chord) ** 2 * (np.sin(twist) * r) ** 2
    added = blade.blade_count * trapezoid(dragged, r)
    yield (
        f"water that turns with flat plates {added:.3g} kg m², {added / design.inertia:.0%} of the "
        "inertia"
    )
    place = np.argmin(np.abs(blade.r / blade.tip_radius - 0.7))
    relative = sections.relative_speed[0, place] * mean[1]
    times = (1e3 * 0.5 * blade.chord[place] / relative / each for each in JONES)
    yield "times of an unsteady section at 0.7 R {:.0f} and {:.0f} ms".format(*times)


if __name__ == "__main__":
    main()
