"""Draw the README's figure: the rotor of a result, and its power and torque over the flow speed.

python studies/rotor_figure.py results/first_turbine docs/images/rotor.png
"""

import io
import sys
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.image import imread

from hkt_mdo.pages.blade import bodies, picture
from hkt_mdo.results import charts, style
from hkt_mdo.results.solution import Solution

folder, image = Path(sys.argv[1]), Path(sys.argv[2])
results = charts.labelled(Solution.load(folder))
rotors, _ = bodies(results)
figure = Figure(figsize=(12.0, 3.4), layout="constrained")
rotor, power, torque = figure.subplots(1, 3, width_ratios=(2.2, 1.0, 1.0))
rotor.imshow(imread(io.BytesIO(picture(rotors))))
rotor.set_axis_off()
style.draw(charts.over_flow(results, "generator_power"), power)
style.draw(charts.over_flow(results, "control_torque"), torque)
image.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(image, dpi=120, facecolor="white")
