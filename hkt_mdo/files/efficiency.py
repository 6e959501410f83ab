"""Tables of a generator's efficiency over torque and speed, as CSV files."""

from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Csv, read_text

UNITS = {"torque_Nm": 1.0, "torque_kNm": 1e3, "speed_rpm": np.pi / 30.0, "speed_rad_s": 1.0}
UNITS |= {"efficiency": 1.0, "efficiency_percent": 0.01}
"""By the headers that a column may have, whose first word is the quantity: the unit in SI units."""


def read_efficiency(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the efficiency of a generator over torque and speed.

    Parameters
    ----------
    path : str or pathlib.Path
        CSV file with columns of the torque, the speed and the efficiency, as `UNITS` has them, and
        one row for every torque at every speed, in any order.

    Returns
    -------
    torque : numpy.ndarray, shape (n_torques,)
        Torque, N*m, increasing.
    speed : numpy.ndarray, shape (n_speeds,)
        Speed, rad/s, increasing.
    efficiency : numpy.ndarray, shape (n_torques, n_speeds)
        Electrical over mechanical power.

    Raises
    ------
    InputError
        If a row is missing or there twice, a torque or speed is negative, or an efficiency is not
        within 0 and 1, or all are 0; with the line.
    """
    path = Path(path)
    file = Csv(read_text(path, "table of efficiencies"), path, ",".join([*UNITS][::2]), UNITS)
    quantities = "torque", "speed", "efficiency"
    names = [file.one_of([x for x in UNITS if x.startswith(word)], word) for word in quantities]
    torque, speed, efficiency = file.columns(names, "table of efficiencies").values()
    for column in (torque, speed):
        column.refuse(column.values < 0.0, "must not be negative", "give its magnitude")
    share = efficiency.values * UNITS[names[2]]
    wrong = (share < 0.0) | (share > 1.0) | ~np.any(share)
    remedy = "give a fraction, or per cent in a column efficiency_percent"
    efficiency.refuse(wrong, "is not within 0 and 1, or all are 0", remedy)
    torques, i = np.unique(torque.values, return_inverse=True)
    speeds, j = np.unique(speed.values, return_inverse=True)
    for name, values in zip(names[:2], (torques, speeds), strict=True):
        if values.size < 2:
            problem = f"has {values.size} value of {name}"
            raise InputError(problem, "give a table over two or more of them", file=path)
    _, first = np.unique(i * speeds.size + j, return_index=True)
    repeated = ~np.isin(np.arange(i.size), first)
    torque.refuse(repeated, "is given twice with the same speed", "give each pair once")
    table = np.full((torques.size, speeds.size), np.nan)
    table[i, j] = share
    for row, column in np.argwhere(np.isnan(table))[:1]:
        problem = f"has no row for {names[0]} = {torques[row]:g} at {names[1]} = {speeds[column]:g}"
        remedy = "give every torque at every speed: the table must be rectangular"
        raise InputError(problem, remedy, file=path)
    return torques * UNITS[names[0]], speeds * UNITS[names[1]], table
