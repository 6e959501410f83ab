"""Sections of a result's blade, from the outlines that its case names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.outline import FRACTIONS

STACKING = 0.25
"""Where the blade's axis meets the chord line, over the chord from the leading edge."""


def sections(solution: Any, places: Sequence[float]) -> np.ndarray:
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
    from hkt_mdo.problem.turbine import build_turbine

    case = solution.case
    turbine = build_turbine(case.rotor, case.fluid, 1.0, case.design)  # outlines know no flow
    outline_names(solution, turbine)  # refuses where there is none
    blade = blade_of(solution, turbine.blade)
    r = blade.hub_radius + np.array(places) * (blade.tip_radius - blade.hub_radius)
    plane = around(*sides(turbine._replace(blade=blade), r)) - (STACKING, 0.0)
    return np.interp(r, blade.r, blade.chord)[:, None, None] * plane


def sides(turbine: Any, r: np.ndarray, fractions: np.ndarray = FRACTIONS) -> np.ndarray:
    """Return the sections at some radii as mass and stress of the program have them.

    Parameters
    ----------
    turbine : Turbine
        The turbine with its blade.
    r : numpy.ndarray, shape (n_radii,)
        Radii along the blade, m.
    fractions : numpy.ndarray, shape (n_fractions,)
        Where, over the chord, from 0 to 1.

    Returns
    -------
    numpy.ndarray, shape (3, n_radii, n_fractions)
        x, and y of the upper and the lower side, over the chord.
    """
    outlines = [outline.resampled(fractions) for outline in turbine.outlines]
    return np.moveaxis(turbine.along_span(outlines, r), 1, 0)


def around(x: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """Return the points of sections, from the trailing edge over the upper side round to it.

    Parameters
    ----------
    x, upper, lower : numpy.ndarray, shape (n_sections, n_fractions)
        As of `sides`.

    Returns
    -------
    numpy.ndarray, shape (n_sections, n_points, 2)
        x and y of the points, that of the leading edge once.
    """
    over, under = np.stack((x, upper), -1), np.stack((x, lower), -1)
    return np.concatenate((over[:, ::-1], under[:, 1:]), axis=1)


def blade_of(solution: Any, blade: Blade) -> Blade:
    """Return the blade of a case with the radius and the shape of its result.

    Parameters
    ----------
    solution : Solution
        The result, whose summary has a blade.
    blade : Blade
        The blade of its case.

    Returns
    -------
    Blade
        The blade of the result.

    Raises
    ------
    InputError
        If the case has other stations.
    """
    summary = solution.summary
    chord = summary.chord_m or []
    if len(chord) != blade.r.size:
        problem = f"makes {blade.r.size} stations, and the result has a chord at {len(chord)}"
        remedy = "give rotor.stations or rotor.station_count of the run, or run the case again"
        raise InputError(problem, remedy, file="case.yaml")
    blade = blade.with_rotor_radius(summary.rotor_radius_m or blade.rotor_radius)
    return blade.with_shape(chord, np.deg2rad(summary.twist_deg), summary.thickness_over_chord)


def outline_names(solution: Any, turbine: Any) -> str:
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
    listed = solution.case.rotor.sections
    for number, section in enumerate(turbine.sections):
        if not section.shape:
            key = f"rotor.sections[{number}].outline" if listed else "rotor.outline"
            problem = "is not given: stl, step and sections need it, since polars have no shape"
            remedy = "give the outline in the case and run it again"
            raise InputError(problem, remedy, file=solution.folder, key=key)
    return ", ".join(dict.fromkeys(Path(section.shape).name for section in turbine.sections))
