"""Make the computed data of the example turbines: outlines, polars and the river blade.

pip install neuralfoil==0.3.3
python scripts/make_example_data.py

Afterwards python scripts/polar_suction.py adds the polars' smallest pressures.

Writes naca63424_*.csv, naca4415_*.csv, cylinder_*.csv and river_blade.csv, and the other outlines
of cases/examples/designed_thickness.yaml. First a shipped polar is
computed again; if it differs, NeuralFoil is another one and nothing is written. For every polar the
confidence that NeuralFoil has in itself is printed. hkt_mdo/files/data/README.md says what all this
is for. rm1_blade.csv is a published table and not made here.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).parents[1] / "studies"))

from study_common import shipped_table

from hkt_mdo.files.shipped import locate

DATA = Path(__file__).parent.parent / "hkt_mdo" / "files" / "data"
EXAMPLES = Path(__file__).parent.parent / "cases" / "examples" / "files"
ALPHA = np.arange(-16.0, 24.5, 0.5)  # deg
REYNOLDS = {
    "naca63424": ("Re1e6", "Re3e6", "Re1e7"),
    "naca4415": ("Re1e5", "Re2e5", "Re5e5", "Re1e6"),
}
INTERVALS = 100  # of the outline, on each side

# Half thickness of the symmetrical sections 63(2)-015, 63(3)-018 and 63(4)-021 in percent of the
# chord: Abbott, von Doenhoff and Stivers, NACA report 824 (1945).
STATION = (
    *(0.0, 0.5, 0.75, 1.25, 2.5, 5.0, 7.5, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0),
    *(55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0),
)
HALF_THICKNESS = {
    15: (
        *(0.0, 1.204, 1.462, 1.878, 2.610, 3.648, 4.427, 5.055, 6.011, 6.693, 7.155, 7.421),
        *(7.500, 7.386, 7.099, 6.665, 6.108, 5.453, 4.721, 3.934, 3.119, 2.310, 1.541, 0.852),
        *(0.300, 0.0),
    ),
    18: (
        *(0.0, 1.404, 1.713, 2.217, 3.104, 4.362, 5.308, 6.068, 7.225, 8.048, 8.600, 8.913),
        *(9.000, 8.845, 8.482, 7.942, 7.256, 6.455, 5.567, 4.622, 3.650, 2.691, 1.787, 0.985),
        *(0.348, 0.0),
    ),
    21: (
        *(0.0, 1.583, 1.937, 2.527, 3.577, 5.065, 6.182, 7.080, 8.441, 9.410, 10.053, 10.412),
        *(10.500, 10.298, 9.854, 9.206, 8.390, 7.441, 6.396, 5.290, 4.160, 3.054, 2.021, 1.113),
        *(0.392, 0.0),
    ),
}

CYLINDER_DRAG = 0.7  # beyond Re 3.5e6: Roshko, Journal of Fluid Mechanics 10, 1961

# The river turbine: three blades of 0.8 m in 1.4 m/s, about 1 kW.
RADIUS = 0.8  # m
BLADE_COUNT = 3
DESIGN_TIP_SPEED_RATIO = 5.0
DESIGN_REYNOLDS = "Re5e5"


def cosine(count):
    """Return count + 1 numbers from 0 to 1 that crowd towards both ends."""
    return 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count + 1))


def wrap(x, thickness, mean, slope):
    """Return the outline (n, 2) of half a thickness laid perpendicular to a mean line."""
    angle = np.arctan(slope)
    upper = np.column_stack((x - thickness * np.sin(angle), mean + thickness * np.cos(angle)))
    lower = np.column_stack((x + thickness * np.sin(angle), mean - thickness * np.cos(angle)))
    return np.vstack((upper[::-1], lower[1:]))


def naca44(thickness):
    """Return the outline of a NACA 44xx of a thickness in closed form (NACA report 460, 1933).

    y_t = 5 t (0.2969 √x - 0.1260 x - 0.3516 x² + 0.2843 x³ - 0.1036 x⁴), the last coefficient the
    one that closes the trailing edge; the mean line is two parabolas that meet at x = 0.4.
    """
    camber, peak = 0.04, 0.4
    x = cosine(INTERVALS)
    half = np.polynomial.Polynomial((0.0, -0.1260, -0.3516, 0.2843, -0.1036))(x)
    half = 5.0 * thickness * (0.2969 * np.sqrt(x) + half)
    half[-1] = 0.0
    parabola = camber / np.where(x < peak, peak, 1.0 - peak) ** 2
    mean = parabola * (np.where(x < peak, 0.0, 1.0 - 2.0 * peak) + 2.0 * peak * x - x**2)
    return wrap(x, half, mean, 2.0 * parabola * (peak - x))


def naca63424():
    """Return the outline of NACA 63-424, its chord from the trailing edge to the farthest point.

    The family is published up to 21 %: its ordinates at 15, 18 and 21 % are extrapolated by a
    parabola in the thickness, y24 = y15 - 3 y18 + 3 y21. The mean line is that of uniform load
    (a = 1.0) with a design lift of 0.4, dy/dx = c_l / 4π (ln(1 - x) - ln x), its slope within 0.5 %
    of the ends held at that of 0.5 %, as the report does for the nose.
    """
    thin, middle, thick = (np.array(HALF_THICKNESS[percent]) for percent in (15, 18, 21))
    half = 0.01 * (thin - 3.0 * middle + 3.0 * thick)
    # Over √x a round nose is no more singular, and odd: no curvature at zero.
    root = np.sqrt(0.01 * np.array(STATION))
    thickness = CubicSpline(root, half, bc_type=((2, 0.0), "not-a-knot"))

    x = cosine(20 * INTERVALS)
    inside, held = x[1:-1], np.clip(x, 0.005, 0.995)
    load = 0.4 / (4.0 * np.pi)
    mean = np.zeros_like(x)
    mean[1:-1] = -load * ((1.0 - inside) * np.log1p(-inside) + inside * np.log(inside))
    slope = load * (np.log1p(-held) - np.log(held))
    return respace(wrap(x, thickness(np.sqrt(x)), mean, slope))


def cylinder():
    """Return the outline of a circle and its polar, the same from all sides."""
    angle = np.linspace(0.0, 2.0 * np.pi, 2 * INTERVALS + 1)
    outline = np.column_stack((0.5 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)))
    alpha = np.arange(-180.0, 185.0, 10.0)
    zero = np.zeros_like(alpha)
    return outline, np.column_stack((alpha, zero, np.full_like(alpha, CYLINDER_DRAG), zero))


def respace(outline):
    """Turn an outline's farthest point from the trailing edge to the origin, and space it anew."""
    length = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(outline, axis=0).T))))
    curve = CubicSpline(length, outline)
    fine = np.linspace(0.0, length[-1], 400001)
    nose = fine[np.argmax(np.hypot(*(curve(fine) - outline[0]).T))]
    places = np.concatenate(
        (nose * cosine(INTERVALS), nose + (length[-1] - nose) * cosine(INTERVALS)[1:])
    )
    chord = outline[0] - curve(nose)
    along, across = chord, np.array([-chord[1], chord[0]])
    return (curve(places) - curve(nose)) @ np.column_stack((along, across)) / (chord @ chord)


def polar(outline, reynolds):
    """Return alpha (deg), lift, drag, moment by rows, and NeuralFoil's confidence."""
    import neuralfoil

    result = neuralfoil.get_aero_from_coordinates(
        outline, alpha=ALPHA, Re=reynolds, n_crit=9.0, model_size="xlarge"
    )
    table = np.column_stack((ALPHA, result["CL"], result["CD"], result["CM"]))
    return table, result["analysis_confidence"]


def river_blade(alpha, lift):
    """Return r (m), chord (m), twist (deg) by Schmitz for a design alpha (deg) and its lift.

    With λ_r = λ r / R the flow meets an ideal rotor with wake rotation at φ = 2/3 atan(1 / λ_r);
    c = 8 π r / (B c_l) (1 - cos φ), twist φ - α (Schmitz 1956; Manwell, McGowan and Rogers 2009,
    eqs. 3.105 and 3.106).
    """
    r = RADIUS * np.concatenate((np.linspace(0.2, 0.9, 15), (0.94, 0.97, 0.99, 1.0)))
    inflow = 2.0 / 3.0 * np.arctan(RADIUS / (DESIGN_TIP_SPEED_RATIO * r))
    chord = 8.0 * np.pi * r / (BLADE_COUNT * lift) * (1.0 - np.cos(inflow))
    return np.column_stack((r, chord, np.rad2deg(inflow) - alpha))


def write(path, header, table, decimals):
    """Write a CSV table; decimals by column."""
    rows = [
        ",".join(f"{round(x, n) + 0.0:.{n}f}" for x, n in zip(row, decimals, strict=True))
        for row in table
    ]
    path.write_text("\n".join((*header, *rows)) + "\n", encoding="utf-8")


def reproduces_shipped_polar():
    """Return whether NeuralFoil gives a shipped polar again, within its rounding."""
    outline = shipped_table("naca63815", "outline")
    shipped = shipped_table("naca63815_Re2e5", "polar")
    again, _ = polar(np.column_stack([outline[name] for name in ("x_over_c", "y_over_c")]), 2e5)
    columns = [shipped[name] for name in ("alpha_deg", "cl", "cd", "cm")]
    error = np.abs(again - np.column_stack(columns)).max()
    print(f"{locate('naca63815_Re2e5', 'polar').name}: largest difference {error:.1e}")
    return error < 1e-6


def main():
    """Write all files, print what NeuralFoil thinks of them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=DATA, help="folder (default: the package's)")
    out = parser.parse_args().out
    if not reproduces_shipped_polar():
        sys.exit("the shipped polar is not reproduced: install neuralfoil==0.3.3")

    outline_header, polar_header = ("x_over_c,y_over_c",), ("alpha_deg,cl,cd,cm",)
    outline, table = cylinder()
    write(out / "cylinder_coordinates.csv", outline_header, outline, (6, 6))
    write(out / "cylinder_polar.csv", polar_header, table, (6, 6, 6, 6))

    for percent in (12, 18, 24):
        path = EXAMPLES / f"naca44{percent}.csv"
        write(path, outline_header, naca44(0.01 * percent).round(6), (6, 6))

    polars = {}
    for name, outline in (("naca63424", naca63424()), ("naca4415", naca44(0.15))):
        outline = outline.round(6)
        write(out / f"{name}_coordinates.csv", outline_header, outline, (6, 6))
        for reynolds in REYNOLDS[name]:
            table, confidence = polar(outline, float(reynolds.removeprefix("Re")))
            write(out / f"{name}_polar_{reynolds}.csv", polar_header, table, (6, 6, 6, 6))
            polars[name, reynolds] = table
            attached = confidence[(ALPHA >= -5.0) & (ALPHA <= 15.0)]
            print(
                f"{name}_polar_{reynolds}.csv: confidence {attached.min():.2f} or more from -5 to "
                f"15 deg, median {np.median(confidence):.2f}, least {confidence.min():.2f} at "
                f"{ALPHA[confidence.argmin()]:g} deg"
            )

    table = polars["naca4415", DESIGN_REYNOLDS]
    alpha, lift = table[np.argmax(table[:, 1] / table[:, 2]), :2]
    blade = river_blade(alpha, lift)
    header = (
        f"# River turbine: {BLADE_COUNT} blades of {RADIUS:g} m; NACA 4415; made by "
        "scripts/make_example_data.py",
        f"# Schmitz at tip speed ratio {DESIGN_TIP_SPEED_RATIO:g}; angle of attack {alpha:g} deg; "
        f"lift coefficient {lift:.3f}",
        "r_m,chord_m,twist_deg,thickness_percent",
    )
    table = np.column_stack((blade, np.full(len(blade), 15.0)))
    write(out / "river_blade.csv", header, table, (3, 4, 2, 1))
    print(f"river_blade.csv: angle of attack {alpha:g} deg, lift coefficient {lift:.3f}")


if __name__ == "__main__":
    main()
