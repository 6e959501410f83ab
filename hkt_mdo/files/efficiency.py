"""Tables of a generator's efficiency over torque and speed, as CSV files."""

from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Csv, read_text

SPEEDS = {"speed_rad_s": 1.0, "speed_rpm": np.pi / 30.0}
"""rad/s in the unit of each header that a column of speeds may have."""


def read_efficiency(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the efficiency of a generator over torque and speed.

    Parameters
    ----------
    path : str or pathlib.Path
        CSV file with the columns torque_Nm, speed_rpm or speed_rad_s, and efficiency, and one row
        for every torque at every speed, in any order.

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
        in (0, 1]; with the line.
    """
    path = Path(path)
    header = "torque_Nm,speed_rpm,efficiency"
    file = Csv(read_text(path, "table of efficiencies"), path, header)
    names = "torque_Nm", file.one_of(SPEEDS, "speed"), "efficiency"
    torque, speed, efficiency = file.columns(names, "table of efficiencies").values()
    for column in (torque, speed):
        column.refuse(column.values < 0.0, "must not be negative", "give its magnitude")
    wrong = (efficiency.values <= 0.0) | (efficiency.values > 1.0)
    efficiency.refuse(wrong, "is not above 0 and at most 1", "give a fraction, not per cent")
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
    table[i, j] = efficiency.values
    for row, column in np.argwhere(np.isnan(table))[:1]:
        problem = f"has no row for {names[0]} = {torques[row]:g} at {names[1]} = {speeds[column]:g}"
        remedy = "give every torque at every speed: the table must be rectangular"
        raise InputError(problem, remedy, file=path)
    return torques, speeds * SPEEDS[names[1]], table
