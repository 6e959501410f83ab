"""Compare the blade element momentum solver with CCBlade over random and published rotors.

Both are given the same polar objects. Writes the tables of docs/studies/bem.md, and their data, in
minutes.
"""

import argparse
import contextlib
import io
import warnings
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import page_data
from scipy.interpolate import CubicSpline

from hkt_mdo.case import Fluid
from hkt_mdo.case import Rotor as Section
from hkt_mdo.files.shipped import shipped_names
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor import ccblade as reference
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import KNOTS_PER_DEGREE, ByStation

DATA = Path(__file__).resolve().parents[1] / "tests" / "rotor" / "data"
BEGIN, END = "<!-- by studies/compare_ccblade.py -->\n", "<!-- end -->"
SAME_ANGLE = 1e-6  # rad; CCBlade's own tolerance is 2e-12, but folds amplify it
STATIONS_5KW = np.concatenate((np.arange(0.2, 0.95, 0.1), [0.999]))

SAME = "same root"
CC_LATER = "CCBlade: a later root with 0 < phi < 90 deg; here: the first"
CC_NONE_EVEN = "CCBlade: no sign change (two roots), load 0; here: the first, 0 < phi < 90 deg"
CC_NONE_BEYOND = "CCBlade: no sign change, load 0; here: phi > 90 deg"
CC_NONE_BRAKE = "CCBlade: no sign change, load 0; here: phi < 0"
CC_LATER_BEYOND = "CCBlade: a later root with phi > 90 deg; here: the first"
CC_BACKWARDS = "CCBlade: a root with W < 0; here: another or none"
BOTH_NONE = "no root in either"
CC_ONLY = "CCBlade: a root; here: none"
OTHER = "unexplained"


class Rotor(NamedTuple):
    """A rotor to compare."""

    name: str
    blade: Blade
    polar: object
    tip_speed_ratio: np.ndarray


class Comparison(NamedTuple):
    """Kinds of section results, and the largest differences where all roots are the same.

    error is of torque, thrust and power over the largest coefficient of its curve; gradient_error
    of the torque coefficient by tip speed ratio, chord and twist over the largest of its kind.
    """

    kinds: Counter
    points: int
    same_points: int
    error: float
    gradient_error: float


def circle_polar(alpha, lift, drag):
    """Return a polar from a table over the full circle (rad); its ends are the same angle."""
    knots = np.linspace(-np.pi, np.pi, 360 * KNOTS_PER_DEGREE + 1)
    blocks = []
    for column in (lift, drag):
        column = np.array(column, dtype=float)
        column[-1] = column[0]
        values = CubicSpline(alpha, column, bc_type="periodic")(knots)
        values[-1] = values[0]
        blocks.append(CubicSpline(knots, values, bc_type="periodic").c[::-1].T)
    return Polar(np.ascontiguousarray(np.hstack(blocks)), float(alpha[0]), float(alpha[-1]))


def plate_polar(lift_slope=2.0 * np.pi, drag=0.01, plate=2.0):
    """Return a smooth made-up polar: thin section at small angles, flat plate at large ones."""
    alpha = np.linspace(-np.pi, np.pi, 721)
    attached = 1.0 / (1.0 + np.exp((np.abs(np.sin(alpha)) - 0.25) / 0.03))
    lift = attached * lift_slope * np.sin(alpha) * np.cos(alpha) + (1.0 - attached) * np.sin(
        2.0 * alpha
    )
    return circle_polar(alpha, lift, drag + plate * (1.0 - attached) * np.sin(alpha) ** 2)


def nrel_5mw_polars():
    """Return the sections of the NREL 5 MW turbine by name."""
    names = ("DU40", "DU35", "DU30", "DU25", "DU21", "NACA64")
    table = np.genfromtxt(DATA / "nrel5mw_polars.csv", delimiter=",", names=True, skip_header=2)
    alpha = np.deg2rad(table["alpha_deg"])
    polars = {name: circle_polar(alpha, table[f"{name}_cl"], table[f"{name}_cd"]) for name in names}
    for name, drag in (("Cylinder1", 0.5), ("Cylinder2", 0.35)):
        polars[name] = circle_polar(alpha, np.zeros(alpha.size), np.full(alpha.size, drag))
    return polars


def nrel_5mw():
    """Return the NREL offshore 5 MW reference rotor (126 m), without cone and tilt."""
    lines = (DATA / "nrel5mw_blade.csv").read_text().splitlines()[2:]
    rows = [line.split(",") for line in lines]
    r, chord, twist = np.array([row[:3] for row in rows], dtype=float).T
    polars = nrel_5mw_polars()
    blade = Blade(r, chord, np.deg2rad(twist), 1.5, 63.0, 3)
    polar = ByStation.of(polars[row[3]] for row in rows)
    return Rotor("NREL 5 MW, 126 m", blade, polar, np.arange(0.5, 15.1, 0.25))


def bahaj(stations=STATIONS_5KW, polar="naca63815_Re2e5", ratios=None):
    """Return the Bahaj rotor at 2.8 m diameter, 5 degrees added to its pitch."""
    blade = build_turbine(Section(stations=tuple(stations)), Fluid(), 1.0).blade
    ratios = np.arange(0.5, 15.1, 0.25) if ratios is None else ratios
    return Rotor("Bahaj, 2.8 m", blade, PolarFamily.from_file(polar).polars[0], ratios)


def all_polars():
    """Return the polars that random rotors draw from."""
    return [
        *(PolarFamily.from_file(name).polars[0] for name in shipped_names("polar")),
        *nrel_5mw_polars().values(),
        plate_polar(),
        plate_polar(drag=0.2),
    ]


def random_rotor(rng, polars):
    """Return a random rotor, most like a turbine, 0.5 <= TSR <= 15."""
    tip_radius = np.exp(rng.uniform(np.log(0.2), np.log(60.0)))
    hub_radius = rng.uniform(0.05, 0.35) * tip_radius
    n = int(rng.integers(3, 13))
    share = np.sort(rng.uniform(0.0, 1.0, n))
    share = 0.002 + 0.996 * (
        0.5 * share + 0.5 * (np.arange(n) + 0.5) / n
    )  # no two stations coincide
    if rng.random() < 0.3:
        share[-1] = 0.999
    r = hub_radius + share * (tip_radius - hub_radius)
    count = int(rng.choice([1, 2, 3, 3, 3, 4, 5, 10]))
    if rng.random() < 0.7:  # like a turbine
        chord = tip_radius * rng.uniform(0.03, 0.25) * (1.0 - rng.uniform(0.0, 0.8) * share)
        twist = np.deg2rad(rng.uniform(-5.0, 10.0) + rng.uniform(0.0, 25.0) * (1.0 - share) ** 2)
    else:
        chord = tip_radius * rng.uniform(0.01, 0.6, n)
        twist = np.deg2rad(
            rng.uniform(-90.0, 90.0, n) if rng.random() < 0.3 else rng.uniform(-30.0, 30.0, n)
        )
    polar = polars[rng.integers(len(polars))]
    if rng.random() < 0.2:
        polar = ByStation.of(polars[index] for index in rng.integers(len(polars), size=n))
    blade = Blade(r, chord, twist, hub_radius, tip_radius, count)
    return Rotor("random", blade, polar, np.sort(rng.uniform(0.5, 15.0, 10)))


def wild_rotor(rng, polars):
    """Return a random rotor of no use: any solidity, twist to +-90 degrees, 0.1 <= TSR <= 30."""
    tip_radius = np.exp(rng.uniform(np.log(0.2), np.log(60.0)))
    hub_radius = rng.uniform(0.02, 0.5) * tip_radius
    n = 6
    share = (np.arange(n) + rng.uniform(0.2, 0.8, n)) / n
    share[[0, -1]] = 0.001, 0.999
    r = hub_radius + share * (tip_radius - hub_radius)
    chord = tip_radius * np.exp(rng.uniform(np.log(0.003), np.log(3.0), n))
    twist = np.deg2rad(rng.uniform(-90.0, 90.0, n))
    blade = Blade(r, chord, twist, hub_radius, tip_radius, int(rng.integers(1, 11)))
    ratios = np.sort(np.exp(rng.uniform(np.log(0.1), np.log(30.0), 10)))
    return Rotor("wild", blade, polars[rng.integers(len(polars))], ratios)


def ccblade(rotor, derivatives=False):
    """Run CCBlade; return its coefficients, their gradients, and the loads of its sections."""
    blade, ratios = rotor.blade, rotor.tip_speed_ratio
    solver = reference.ccblade(blade, rotor.polar, derivatives)
    recorded = []
    loads = solver.distributedAeroLoads

    def record(*arguments):
        result = loads(*arguments)
        recorded.append(result)
        return result

    solver.distributedAeroLoads = record
    rpm = ratios * 30.0 / (np.pi * blade.tip_radius)
    quiet = np.zeros(ratios.size)
    with (
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
        np.errstate(all="ignore"),
    ):
        warnings.simplefilter("ignore")
        outputs, gradients = solver.evaluate(quiet + 1.0, rpm, quiet, coefficients=True)
    return outputs, gradients, recorded


def kind_of(branch, phi, phi_cc, load_cc, residual_cc, speed_cc):
    """Return what happened at one section; see the constants above."""
    failed_cc = not np.any(load_cc)
    if failed_cc:
        return {-1: BOTH_NONE, 2: CC_NONE_BEYOND, 3: CC_NONE_BRAKE}.get(int(branch), CC_NONE_EVEN)
    if branch >= 0 and abs(phi - phi_cc) < SAME_ANGLE:
        return SAME
    if speed_cc <= 0.0:
        return CC_BACKWARDS
    if abs(residual_cc) > 1e-6:
        return OTHER
    if branch < 0:
        return CC_ONLY
    if 0.0 < phi < phi_cc:
        return CC_LATER if phi_cc < 0.5 * np.pi else CC_LATER_BEYOND
    return OTHER


def compare(rotor, derivatives=False):
    """Solve a rotor with both and return a `Comparison`."""
    blade, ratios = rotor.blade, rotor.tip_speed_ratio
    sections = bem.sections(blade, rotor.polar, ratios)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ours = bem.rotor_coefficients(blade, rotor.polar, ratios, derivatives)
    outputs, gradients, recorded = ccblade(rotor, derivatives)
    phi_cc = np.array([np.deg2rad(loads["alpha"]) for loads, _ in recorded]) + blade.twist
    load_cc = np.array(
        [(loads["Np"], loads["Tp"]) for loads, _ in recorded]
    )  # (points, 2, stations)
    kinds = np.empty(phi_cc.shape, dtype=object)
    *arguments, polars, section, _ = bem._arguments(blade, rotor.polar, ratios)
    for i, j in np.ndindex(kinds.shape):
        station = (blade.chord[j], blade.twist[j], blade.r[j], *arguments[3:], polars[section[j]])
        s, c, _, _ = bem._terms(float(phi_cc[i, j]), *station)[0]
        residual = (s - c * blade.tip_radius / (ratios[i] * blade.r[j])) / s if s else np.inf
        kinds[i, j] = kind_of(
            sections.branch[i, j],
            sections.inflow_angle[i, j],
            phi_cc[i, j],
            load_cc[i, :, j],
            residual,
            s,
        )
    same = np.all((kinds == SAME) | (kinds == BOTH_NONE), axis=1)
    error = gradient_error = 0.0
    if same.any():
        for mine, theirs in ((ours.torque, "CQ"), (ours.thrust, "CT"), (ours.power, "CP")):
            difference = np.abs(mine - outputs[theirs])[same]
            error = np.maximum(error, _ratio(difference, outputs[theirs]))
        if derivatives:
            by = gradients["dCQ"]
            pairs = (
                (
                    ours.torque_table.by_tip_speed_ratio,
                    np.diag(by["dOmega"]) * 30.0 / (np.pi * blade.tip_radius),
                ),
                (ours.torque_table.by_chord, by["dchord"]),
                (ours.torque_table.by_twist, np.rad2deg(by["dtheta"])),
            )
            for mine, theirs in pairs:
                difference = np.abs(mine - theirs)[same]
                gradient_error = np.maximum(gradient_error, _ratio(difference, theirs[same]))
    return Comparison(
        Counter(kinds.ravel()), ratios.size, int(same.sum()), float(error), float(gradient_error)
    )


def _ratio(difference, reference):
    """Return the largest difference over the largest reference; 0 for 0 / 0, as of cylinders."""
    largest = np.max(difference)
    return largest if largest == 0.0 else largest / np.max(np.abs(reference))


def study(count, seed):
    """Compare `count` random rotors and the published ones; return (name, Comparison) pairs."""
    rng, polars = np.random.default_rng(seed), all_polars()
    published = [(rotor.name, compare(rotor, True)) for rotor in (bahaj(), nrel_5mw())]
    published += [("random", compare(random_rotor(rng, polars), i % 5 == 0)) for i in range(count)]
    return published + [
        ("wild", compare(wild_rotor(rng, polars), i % 5 == 0)) for i in range(count // 4)
    ]


def summed(results):
    """Return the comparisons of rotors with one name as one, by name, for the data of the page."""
    groups = {name: [x for other, x in results if other == name] for name, _ in results}
    return {
        name if len(group) == 1 else f"{len(group)} {name}": {
            "points": sum(each.points for each in group),
            "same_points": sum(each.same_points for each in group),
            "error": max(each.error for each in group),
            "gradient_error": max(each.gradient_error for each in group),
            "kinds": dict(sum((each.kinds for each in group), Counter()).most_common()),
        }
        for name, group in groups.items()
    }


def from_data(data):
    """Return the page with the tables of its data: agreement, and what became of the sections."""
    lines = [
        "| rotors | points | all roots the same | error of values | error of derivatives |",
        "|---|---|---|---|---|",
    ]
    details = ["", "| rotors | sections and points | share | what |", "|---|---|---|---|"]
    for name, result in data["comparisons"].items():
        errors = f"{result['error']:.1e} | {result['gradient_error']:.1e}"
        lines.append(f"| {name} | {result['points']} | {result['same_points']} | {errors} |")
        total = sum(result["kinds"].values())
        details += [
            f"| {name} | {number} | {100.0 * number / total:.3f} % | {kind} |"
            for kind, number in result["kinds"].items()
        ]
    text = "\n".join(lines + details) + "\n"
    return page_data.between(page_data.text_of("bem"), BEGIN, END, text)


def main():
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=2400, help="random rotors (default: 2400)")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default: 0)")
    options = parser.parse_args()
    comparisons = summed(study(options.count, options.seed))
    page_data.page_from("bem", from_data, comparisons=comparisons)


if __name__ == "__main__":
    main()
