"""Draw the README's figure from the three results of the torque-limited case.

python studies/headline_figure.py results/cases/IPOPT docs/images/headline.png
"""

import sys
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure
from study_plots import plot_chord, plot_control_torque, plot_rotor_speed, plot_twist

from hkt_mdo.results.solution import Solution

results, image = Path(sys.argv[1]), Path(sys.argv[2])
LAWS = {"oloc": "open loop", "quadratic": "quadratic feedback", "linear": "linear feedback"}
solutions = []
for name, law in LAWS.items():
    solution = Solution.load(results / f"sine_limited_{name}")
    label = f"{law}: {1e-3 * solution.summary.simulated_energy_J:.1f} kJ"
    case = solution.case.model_copy(update={"name": label})
    solutions.append(replace(solution, case=case))
figure = Figure(figsize=(10.5, 6.0), layout="constrained")
axes = figure.subplots(2, 2)
for plot, ax in zip(
    (plot_chord, plot_rotor_speed, plot_twist, plot_control_torque), axes.flat, strict=True
):
    plot(solutions, ax)
    handles, labels = ax.get_legend_handles_labels()
    if ax is axes[0, 0]:
        look = {"fontsize": 10, "frameon": False, "ncols": 4, "loc": "outside upper center"}
        title = "Energy captured in 60 s of a sinusoidal flow, torque limited to 700 N m"
        kept = [x for x in zip(handles, labels, strict=True) if "smallest" not in x[1]]
        figure.legend(*zip(*kept, strict=True), title=title, title_fontsize=12, **look)
image.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(image, dpi=130)
