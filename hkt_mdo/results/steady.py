"""Steady operation of a finished design, and its simulated operation by flow speed."""

import numpy as np

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.results.solution import Solution
from hkt_mdo.rotor.scales import power_scale, torque_scale
from hkt_mdo.rotor.torque_curve import last_fall

RATED = 0.995  # of the limit of the power: laws come to it smoothly
FLOWS, BINS, FEWEST = 200, 30, 8
"""Flow speeds of a steady curve; classes of the flow speed, and the fewest instants of one."""


def binned(
    speed: np.ndarray,
    values: np.ndarray,
    steady: bool = False,
    count: int = BINS,
    fewest: int = FEWEST,
    ends: tuple[float, float] = (5.0, 95.0),
) -> np.ndarray:
    """Return the mean and the range of 90 % of some values in classes of the flow speed.

    Parameters
    ----------
    speed : numpy.ndarray, shape (n_times,)
        Flow speed, m/s, or something else that the values are over.
    values : numpy.ndarray, shape (n_times,)
        A quantity at the same instants, which count alike.
    steady : bool
        Whether they are no instants but speeds without time, each of which is a class.
    count : int
        Number of the classes.
    fewest : int
        Of the instants of a class.
    ends : tuple of float
        Percentiles at the ends of the range.

    Returns
    -------
    numpy.ndarray, shape (4, n_classes)
        Mean speed, mean value, and the range, of the classes with at least `fewest` instants.
    """
    order = np.argsort(speed)
    speed, values = speed[order], values[order]
    if steady:
        return np.stack((speed, values, values, values))
    edges = np.searchsorted(speed, np.linspace(speed[0], speed[-1], count + 1)[1:-1])
    classes = zip(np.split(speed, edges), np.split(values, edges), strict=True)
    pairs = [(x, y) for x, y in classes if x.size >= fewest]
    rows = [(np.mean(x), np.mean(y), *np.percentile(y, ends)) for x, y in pairs]
    return np.reshape(rows, (-1, 4)).T


def steady_curve(solution: Solution) -> dict[str, np.ndarray]:
    """Return the steady operation of a feedback law over the flow speed, its power curve.

    It begins near zero and ends at the cut-out, else at the largest flow speed that the result met.
    Where the torques balance at several rotor speeds, it is the fastest one. Only laws that set the
    torque by the rotor speed alone have the curve.

    Parameters
    ----------
    solution : Solution
        The result of one scenario.

    Returns
    -------
    dict of numpy.ndarray
        Columns as in `simulation`, shape (n_flows,); empty where the curve is not known. The thrust
        is there if the power curve has its coefficient.
    """
    case, curve, gain = solution.case, solution.coefficients, solution.gain
    law = solution.law
    radius, table = solution.summary.rotor_radius_m, solution.simulation or solution.trajectory
    complete = curve and table and radius and gain is not None
    if not isinstance(law, FeedbackLaw) or law.states or not complete:
        return {}
    ratio, most = curve["tip_speed_ratio"], law.cut_out or np.max(table["inflow_speed_m_s"])
    flow, gains = most * np.linspace(1.0 / FLOWS, 1.0, FLOWS), np.atleast_1d(gain)
    water = case.fluid.density, radius

    def surplus(trial, flow):
        speed = trial * flow / radius
        torque = torque_scale(*water, flow) * np.interp(trial, ratio, curve["power_coefficient"])
        return torque / trial - case.generator.friction(speed) - law.torque(speed, gains)

    at, runs = last_fall(surplus, ratio, surplus(ratio, flow[:, None]) >= 0.0, flow)
    flow, at = flow[runs], at[runs]
    speed = at * flow / radius
    torque = law.torque(speed, gains)
    columns = {
        "inflow_speed_m_s": flow,
        "rotor_speed_rad_s": speed,
        "control_torque_Nm": torque,
        "generator_power_W": speed * torque,
    }
    if "thrust_coefficient" in curve:
        thrust = np.interp(at, ratio, curve["thrust_coefficient"])
        columns["thrust_N"] = power_scale(*water, flow) / flow * thrust
    return columns


def rated_point(solution: Solution) -> tuple[float, float] | None:
    """Return the flow speed (m/s) above which steady power stays at its limit, and that power (W).

    Parameters
    ----------
    solution : Solution
        The result of one scenario.

    Returns
    -------
    tuple of float or None
        None where no steady curve is known, or no limit of the power is met within it.
    """
    levels = [level for _, level in solution.limit_levels("generator_power")]
    curve = steady_curve(solution)
    if not (levels and curve):
        return None
    below = curve["generator_power_W"] < RATED * min(levels)
    if not np.any(below) or below[-1]:
        return None
    first = int(np.flatnonzero(below)[-1]) + 1
    return float(curve["inflow_speed_m_s"][first]), float(curve["generator_power_W"][first])
