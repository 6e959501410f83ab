"""Draw the README's figure from the three results of the torque-limited case.

python scripts/headline_figure.py results/cases/IPOPT docs/images/headline.png
"""

import sys
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hkt_mdo.results.plots import plot_chord, plot_control_torque, plot_rotor_speed, plot_twist
from hkt_mdo.results.solution import Solution

results, image = Path(sys.argv[1]), Path(sys.argv[2])
solutions = [
    Solution.load(results / f"sine_limited_{law}") for law in ("oloc", "linear", "quadratic")
]
figure = Figure(figsize=(10.5, 5.6), layout="constrained")
FigureCanvasAgg(figure)
axes = figure.subplots(2, 2)
for plot, ax in zip(
    (plot_chord, plot_rotor_speed, plot_twist, plot_control_torque), axes.flat, strict=True
):
    plot(solutions, ax)
    if ax is not axes[0, 0] and ax.get_legend():
        ax.get_legend().remove()
image.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(image, dpi=130)
