"""Sizes of what the program leaves out: the data of docs/not_modelled.md.

python studies/not_modelled.py RESULT ...

Writes docs/data/not_modelled.json and prints it: for the blade of each result gravity less buoyancy
at the root, the water that a flat plate would drag along in rotation, and the times of an unsteady
section; and, of formulas, blockage, waves, a pile and small eddies. `shown` has the words in which
the page, written by hand, gives them.
"""

import sys
from pathlib import Path

import numpy as np
import page_data
from scipy.integrate import quad, trapezoid

from hkt_mdo.dynamics.sampled import SPECTRA
from hkt_mdo.results.solution import Solution
from hkt_mdo.rotor import bem

GRAVITY = 9.80665
JONES = 0.0455, 0.3  # of Wagner's function, times 2 W / c (R. T. Jones, NACA Report 681, 1940)


def main():
    """Write and print the sizes."""
    blades = {Path(name).name: of_blade(Solution.load(name)) for name in sys.argv[1:]}
    page_data.record("not_modelled", formulas=of_formulas(), blades=blades)
    for text in shown(page_data.read("not_modelled")):
        print(text)


def of_formulas():
    """Return the sizes that follow from formulas alone."""
    period, depth, number = 4.0, 3.0, (2.0 * np.pi / 4.0) ** 2 / GRAVITY  # s, m, 1/m
    a, b, c = SPECTRA["von_karman"]
    smallest = 4.0 / 2.8  # length scale over diameter
    return {
        "blockage_of_5_percent": 0.95**-2 - 1.0,
        "blockage_of_10_percent": 0.9**-2 - 1.0,
        "wave_of_half_a_metre_m_s": np.pi * 0.5 / period * np.exp(-number * depth),
        "pile": (0.1 / 0.5) ** 2,  # radius over distance
        "turns_a_year": 8.0 / (2.0 * np.pi) * 365.25 * 86400.0,  # at 8 rad/s
        "small_eddies": quad(lambda n: 4.0 / (1.0 + a * n**b) ** c, smallest, np.inf)[0],
    }


def of_blade(solution):
    """Return the sizes of a result's blade."""
    design = solution.design()
    blade, model = design.blade, design.physics
    r, hub, density = blade.edges, blade.hub_radius, model.density
    chord, twist = (np.interp(r, blade.r, each) for each in (blade.chord, blade.twist))
    area = np.broadcast_to(model.rotor.structure.section_area, blade.r.shape)
    area = np.interp(r, blade.r, area) * chord**2
    excess = model.case.rotor.blade_material.density - density
    speed, flow = solution.simulation["rotor_speed_rad_s"], solution.simulation["inflow_speed_m_s"]
    mean = float(np.mean(speed)), float(np.mean(flow))
    sections = bem.sections(blade, model.rotor.polar, mean[0] * blade.rotor_radius / mean[1])
    load = 0.5 * density * mean[1] ** 2 * sections.tangential_load[0]
    dragged = density * np.pi * (0.5 * chord) ** 2 * (np.sin(twist) * r) ** 2
    station = np.argmin(np.abs(blade.r / blade.tip_radius - 0.7))
    relative = sections.relative_speed[0, station] * mean[1]
    times = [0.5 * blade.chord[station] / relative / each for each in JONES]
    sizes = {
        "weight_moment_Nm": GRAVITY * trapezoid(excess * area * (r - hub), r),
        "edgewise_moment_Nm": trapezoid(np.interp(r, blade.r, load) * (r - hub), r),
        "added_share_of_inertia": blade.blade_count * trapezoid(dragged, r) / design.inertia,
        "ellipses_share_of_inertia": model.rotor.water_inertias(blade)["ellipse"] / design.inertia,
        "slow_time_s": times[0],
        "fast_time_s": times[1],
    }
    return {name: float(value) for name, value in sizes.items()}


def shown(data):
    """Return the words in which the page gives the sizes; results as in the page's command."""
    size, (thin, power, limited) = data["formulas"], data["blades"].values()
    moments = [
        f"{one['weight_moment_Nm']:.{digits}f} N m ({text}{one['edgewise_moment_Nm']:.0f} N m)"
        for one, digits, text in (
            (thin, 1, "mean edgewise moment "),
            (power, 0, ""),
            (limited, 0, ""),
        )
    ]
    added = [f"{100 * one['added_share_of_inertia']:.0f} %" for one in (thin, limited, power)]
    ellipses = [f"{100 * one['ellipses_share_of_inertia']:.0f}" for one in (thin, limited, power)]
    times = [
        f"{1e3 * one['slow_time_s']:.0f} and {1e3 * one['fast_time_s']:.0f} ms"
        for one in (thin, power)
    ]
    return [
        f"+{100 * size['blockage_of_5_percent']:.0f} % at 5 %",
        f"+{100 * size['blockage_of_10_percent']:.0f} % at 10 %",
        f"an amplitude of {size['wave_of_half_a_metre_m_s']:.2f} m/s at 3 m",
        f"{100 * size['pile']:.0f} % for a pile of 0.2 m",
        f"{100 * size['small_eddies']:.0f} % of the variance is faster than V/D",
        *(f"{moment} for" for moment in moments),
        f"{added[0]} of the inertia of the paper's blades, {added[1]} for `all_oloc`, {added[2]}",
        f"as ellipses {ellipses[0]}, {ellipses[1]} and {ellipses[2]} %",
        f"at 0.7 R {times[0]} for the paper's blade, {times[1]} for",
        f"has {size['turns_a_year'] / 1e7:.0f}·10⁷ turns a year",
    ]


if __name__ == "__main__":
    main()
