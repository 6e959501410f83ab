"""Sections of a result's blade, from the outlines that its case names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution

STACKING = 0.25
"""Where the blade's axis meets the chord line, over the chord from the leading edge."""


def sections(solution: Solution, places: Sequence[float]) -> np.ndarray:
    """Return sections of a blade as mass and stress of the program have them.

    Parameters
    ----------
    solution : Solution
        The result.
    places : sequence of float
        Where, over the span from hub to tip.

    Returns
    -------
    numpy.ndarray, shape (n_places, n_points, 2)
        Points (m) along the chord, towards the trailing edge, and across it, towards the suction
        side, both from the blade's axis.

    Raises
    ------
    InputError
        If the run did not finish, or a file or an outline is missing or broken.
    """
    design = solution.design()
    outline_names(solution, design.turbine)  # refuses where there is none
    blade = design.blade
    r = blade.hub_radius + np.array(places) * (blade.tip_radius - blade.hub_radius)
    x, upper, lower = design.sides(r)
    along = np.hstack((x[:, ::-1], x[:, 1:])) - STACKING
    plane = np.stack((along, np.hstack((upper[:, ::-1], lower[:, 1:]))), axis=-1)
    return np.interp(r, blade.r, blade.chord)[:, None, None] * plane


def outline_names(solution: Solution, turbine: Any) -> str:
    """Return what the case calls its outlines.

    A case may have polars of its own without the outlines that belong to them. The program then
    takes another outline, for mass and stress only, which is none to build a blade from.

    Parameters
    ----------
    solution : Solution
        The result.
    turbine : Turbine
        The turbine of its case.

    Returns
    -------
    str
        Names of files and of shipped outlines.

    Raises
    ------
    InputError
        If a section has no outline.
    """
    several = solution.case.rotor.sections
    for number, each in enumerate(turbine.sections):
        if not each.shape:
            key = f"rotor.sections[{number}].outline" if several else "rotor.outline"
            problem = "is not given: stl, step and sections need it, since polars have no shape"
            remedy = "give the outline in the case and run it again"
            raise InputError(problem, remedy, file=solution.folder, key=key)
    return ", ".join(dict.fromkeys(Path(each.shape).name for each in turbine.sections))
