"""Charts of polars, for `hkt check` and `hkt polar`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from hkt_mdo.results.panel import Curve, Panel

MOST_NAMED = 8
"""Of more polars, only the first and the last have labels."""
_TITLES = {
    "lift": "lift coefficient (-)",
    "drag": "drag coefficient (-)",
    "ratio": "lift over drag (-)",
    "suction": "largest suction, -cp (-)",
}


def polar_panels(curves: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Return lift, drag, their ratio and suction, where it is known, over the angle of attack.

    Parameters
    ----------
    curves : sequence of mapping
        `alpha_deg`, `lift`, `drag` and `suction`, NaN where it is not known, (n_angles,), a
        `label`, and where a curve is `sure`; elsewhere it is dotted.

    Returns
    -------
    list of Panel
        Of many curves only the first and the last are named.
    """
    several = len(curves) > MOST_NAMED
    shades = [to_hex(each) for each in colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))]
    panels = []
    for column, title in _TITLES.items():
        panel = Panel(title, "angle of attack (deg)")
        for number, (curve, color) in enumerate(zip(curves, shades, strict=True)):
            y = curve["lift"] / curve["drag"] if column == "ratio" else curve[column]
            if np.all(np.isnan(y)):
                continue
            name = "" if several and 0 < number < len(curves) - 1 else curve["label"]
            sure = np.where(curve["sure"], y, np.nan)
            panel.curves.append(Curve(curve["alpha_deg"], y, "", color, None))
            panel.curves.append(
                Curve(curve["alpha_deg"], sure, name, color, 0 if several else number)
            )
        panels.append(panel)
    return panels
