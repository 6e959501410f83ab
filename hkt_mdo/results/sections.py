"""Sections of a result's blade, from the outlines that its case names."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
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
    outline_names(solution)  # refuses where there is none
    table, case = solution.blade, solution.case
    if "chord_m" not in table:
        raise InputError("holds no blade", "run the case again", file=solution.folder)
    from hkt_mdo.problem.turbine import build_turbine

    turbine = build_turbine(case.rotor, case.fluid, 1.0, case.design)  # outlines know no flow
    if turbine.blade.r.size != table["r_m"].size:
        raise InputError(
            "has other stations than its files", "run the case again", file=solution.folder
        )
    before = turbine.blade.with_rotor_radius(
        solution.summary.rotor_radius_m or turbine.blade.rotor_radius
    )
    r = before.hub_radius + np.array(places) * (before.tip_radius - before.hub_radius)
    thickness = table.get("thickness_over_chord", before.thickness)
    turbine = turbine._replace(blade=replace(before, r=table["r_m"], thickness=thickness))
    sides = turbine.along_span([each.resampled() for each in turbine.outlines], r)
    x, upper, lower = np.moveaxis(sides, 1, 0)
    along = np.hstack((x[:, ::-1], x[:, 1:])) - STACKING
    plane = np.stack((along, np.hstack((upper[:, ::-1], lower[:, 1:]))), axis=-1)
    return np.interp(r, table["r_m"], table["chord_m"])[:, None, None] * plane


def outline_names(solution: Solution) -> str:
    """Return what the case calls its outlines.

    A case may have polars of its own without the outlines that belong to them. The program then
    takes another outline, for mass and stress only, which is none to build a blade from.

    Parameters
    ----------
    solution : Solution
        The result.

    Returns
    -------
    str
        Names of files and of shipped outlines.

    Raises
    ------
    InputError
        If a section has no outline.
    """
    from hkt_mdo.problem.turbine import OUTLINE

    rotor, key = solution.case.rotor, ""
    names = [each.outline or rotor.outline for each in rotor.sections]
    if None in names:
        key = f"rotor.sections[{names.index(None)}].outline"
    elif not names and rotor.outline is None and rotor.polar is not None:
        key = "rotor.outline"
    elif not names and rotor.outline is None and rotor.chord is None:
        own = read_blade(rotor.blade).sections
        key = "rotor.outline" if any(each.outline_x is None for each in own) else ""
        names = [rotor.blade] if own else []
    if key:
        problem = "is not given: stl, step and sections need it, since polars have no shape"
        remedy = "give the outline in the case and run it again"
        raise InputError(problem, remedy, file=solution.folder, key=key)
    names = names or [rotor.outline or OUTLINE]
    return ", ".join(Path(name).name for name in dict.fromkeys(filter(None, names)))
