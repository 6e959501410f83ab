"""Draw the baseline's power and thrust coefficients beside those measured by Bahaj et al. (2007).

python studies/plot_measurements.py docs/images/baseline_measured.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from study_common import shipped_table

from hkt_mdo.case import Fluid, Rotor
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import PolarFamily

SETS = {
    "all 17 tabulated stations": None,
    "the nine default stations": (*np.arange(2, 10) / 10, 0.999),
}


def main():
    """Draw measured points and the curves of two sets of stations; tell the errors."""
    measured = shipped_table("bahaj2007", "measurement")
    thrust = shipped_table("bahaj2007", "thrust")
    tabulated = np.minimum(shipped_table("bahaj2007", "blade")["r_over_R"], 0.999)
    polar = PolarFamily.from_file("naca63815_Re2e5").polars[0]
    figure = Figure(figsize=(6.2, 6.4), layout="constrained")
    ax, below = figure.subplots(2, 1, sharex=True)
    text = "measured, 20° hub pitch, 1.73 m/s"
    ax.plot(measured["TSR"], measured["Cp"], "ko", markersize=4, label=text)
    below.plot(thrust["TSR"], thrust["Ct"], "ko", markersize=4, label="measured, same tests")
    ratios = np.linspace(3.5, 10.5, 141)
    for (label, stations), line in zip(SETS.items(), ("-", "--"), strict=True):
        r = tabulated if stations is None else stations
        blade = build_turbine(Rotor(stations=tuple(r), radius=0.4), Fluid(), 1.0).blade
        error = bem.rotor_coefficients(blade, polar, measured["TSR"]).power - measured["Cp"]
        rms = np.sqrt(np.mean(error**2))
        curve = bem.rotor_coefficients(blade, polar, ratios)
        text = f"BEM, {label} (rms error {rms:.3f})"
        ax.plot(ratios, curve.power, line, color="0.25", label=text)
        share = bem.rotor_coefficients(blade, polar, thrust["TSR"]).thrust / thrust["Ct"] - 1.0
        text = f"{100 * np.min(share):.1f} to {100 * np.max(share):.1f} %"
        print(f"thrust of BEM against the measured one, {label}: {text}")
        below.plot(ratios, curve.thrust, line, color="0.25", label=f"BEM, {label} ({text})")
    for axes, name, side in ((ax, "power coefficient $C_P$", "left"),
                              (below, "thrust coefficient $C_T$", "right")):  # fmt: skip
        axes.set_ylabel(f"{name} (-)")
        axes.grid(True, color="0.88", linewidth=0.6)
        axes.legend(loc=f"lower {side}", fontsize=9)
    ax.set_ylim(0.0, 0.55)
    below.set_xlabel("tip speed ratio (-)")
    image = Path(sys.argv[1])
    image.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(image, dpi=130)


if __name__ == "__main__":
    main()
