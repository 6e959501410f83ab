"""Suction of blade sections, -Cp min, for the cavitation limit: its curves."""

import numpy as np

from hkt_mdo.errors import InputError

KINK_RANGE = np.deg2rad(10.0)  # of zero angle of attack, where the suction peak changes side
STAGNATION = -1.0  # least suction: that of a stagnation point, where Cp = 1
OUTRUN = np.deg2rad(2.0)  # range beyond the table over which a curve's slope decays
OUTWARD = np.deg2rad([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0])  # rows beyond it
STEP = np.deg2rad(5.0)  # of the rows that follow
FLAT_TO = np.deg2rad(120.0)  # from there, over 180 degrees, the curves return to their other ends


def surface_curves(alpha, suction):
    """Return alpha, upper and lower suction on one grid over a turn, periodic.

    alpha[n_rows] (rad) increases, suction[2, n_rows] is -Cp min of the upper and the lower surface,
    or suction[1, n_rows] the larger of the two, which `split_at_kink` parts. Rows beyond 90 degrees
    are not used. Beyond the last row a curve continues with its slope, which decays within a few
    degrees, so that the spline through the grid stays within the rows' magnitude; from there it is
    constant up to 120 degrees, and over 180 degrees it changes to the value of the other end.

    Parameters
    ----------
    alpha : ndarray of shape (n_rows,)
        Angle of attack (rad), increasing.
    suction : ndarray of shape (1 or 2, n_rows)
        -Cp min; see above.

    Returns
    -------
    alpha, upper, lower : ndarray of shape (n,)
        From -`FLAT_TO` over 180 degrees round to it; the same at both ends.
    """
    if suction.shape[0] == 1:
        suction = split_at_kink(alpha, suction[0])
    low, high = max(alpha[0], -0.5 * np.pi), min(alpha[-1], 0.5 * np.pi)
    rows = np.concatenate(([low], alpha[(alpha > low) & (alpha < high)], [high]))
    far = OUTWARD[-1] + 0.5 * STEP
    before = np.concatenate((np.arange(-FLAT_TO, low - far, STEP), low - OUTWARD[::-1]))
    after = np.concatenate((high + OUTWARD, np.arange(FLAT_TO, high + far, -STEP)[::-1]))
    round_back = np.linspace(FLAT_TO, 2.0 * np.pi - FLAT_TO, 25)[1:]
    share = np.linspace(0.0, 1.0, 25)[1:]
    share = share**2 * (3.0 - 2.0 * share)
    front = np.concatenate((before, rows, after))
    beyond = front - np.clip(front, low, high)
    outrun = np.sign(beyond) * OUTRUN * -np.expm1(-np.abs(beyond) / OUTRUN)
    curves = []
    for column in suction:
        values = np.interp(rows, alpha, column)
        slopes = (np.diff(values) / np.diff(rows))[[0, -1]]
        values = np.interp(front, rows, values) + outrun * np.where(beyond < 0.0, *slopes)
        curves.append(np.append(values, (1.0 - share) * values[-1] + share * values[0]))
    return np.append(front, round_back), *curves


def split_at_kink(alpha, suction):
    """Return the suction of the upper and the lower surface, [2, n_rows], of the larger of both.

    As the angle of attack alpha[n_rows] (rad) rises, the lower surface's suction falls and the
    upper one's rises; where they cross, the larger has a kink, and least suction. The lowest row
    within 10 degrees of zero goes to the side whose straight line through its two next rows meets
    it closer. Each curve continues beyond the kink with the slope s that it has there,

        q(a) = q0 - (q0 + 1) (1 - exp(-s |a - a0| / (q0 + 1))),

    which falls towards -1, the suction of a stagnation point, and is held at or below the other:
    at the rows the larger of the two is the given one. Where the lowest row has none on both sides
    (a cylinder), both surfaces have the given suction.

    Parameters
    ----------
    alpha : ndarray of shape (n_rows,)
        Angle of attack (rad), increasing.
    suction : ndarray of shape (n_rows,)
        The larger -Cp min of both surfaces.

    Returns
    -------
    ndarray of shape (2, n_rows)
        Suction of the upper and the lower surface.
    """
    near = np.flatnonzero(np.abs(alpha) <= KINK_RANGE)
    lowest = near[np.argmin(suction[near])] if near.size else 0
    if not 1 < lowest < alpha.size - 2 or lowest in (near[0], near[-1]):
        return np.stack((suction, suction))

    def miss(one, other):  # how far the line through two rows passes from the lowest one
        slope = (suction[one] - suction[other]) / (alpha[one] - alpha[other])
        return abs(suction[one] + slope * (alpha[lowest] - alpha[one]) - suction[lowest])

    begin = lowest if miss(lowest + 1, lowest + 2) <= miss(lowest - 1, lowest - 2) else lowest + 1
    upper, lower = suction.copy(), suction.copy()
    upper[:begin] = _carried_on(alpha, suction, begin, begin + 1, slice(None, begin))
    lower[begin:] = _carried_on(alpha, suction, begin - 1, begin - 2, slice(begin, None))
    return np.stack((upper, lower))


def _carried_on(alpha, suction, edge, inner, rows):
    """Return a surface's suction at rows beyond its edge row, by the slope to the inner row."""
    above = max(suction[edge] - STAGNATION, 0.0)
    slope = max((suction[inner] - suction[edge]) / abs(alpha[inner] - alpha[edge]), 0.0)
    fall = above * -np.expm1(-slope * np.abs(alpha[rows] - alpha[edge]) / above) if above else 0.0
    return np.minimum(suction[edge] - fall, suction[rows])


def require_suction(polars):
    """Raise InputError where a polar has no suction.

    Parameters
    ----------
    polars : iterable of Polar
        Polars that a limit on cavitation takes.

    Raises
    ------
    InputError
        Where a polar has none.
    """
    if any(polar.suction is None for polar in polars):
        raise InputError(
            "has no smallest pressure coefficient, from which the suction of a section is computed",
            "give a polar with the columns cpmin_upper and cpmin_lower, or cpmin (hkt polar "
            "computes one from an outline)",
            key="rotor.polar or rotor.sections",
        )
