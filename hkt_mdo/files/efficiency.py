"""Tables of a generator's efficiency over torque and speed, as CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Csv, read_text

SPEEDS = {"speed_rad_s": 1.0, "speed_rpm": np.pi / 30.0}
"""rad/s in the unit of each header that a column of speeds may have."""


def read_efficiency(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return torque[n_torques] (N*m), speed[n_speeds] (rad/s) and efficiency[n_torques, n_speeds].

    The file has the columns torque_Nm, speed_rpm or speed_rad_s, and efficiency, and one row for
    every torque at every speed, in any order. Raises InputError, with the line, if a row is missing
    or there twice, a torque or speed is negative, or an efficiency is not in (0, 1].
    """
    path = Path(path)
    header = "torque_Nm,speed_rpm,efficiency"
    file = Csv(read_text(path, "table of efficiencies"), path, header)
    given = [name for name in SPEEDS if name in file.header]
    if len(given) != 1:
        problem = "names two columns of speeds" if given else "lacks a column of speeds"
        raise file.refuse(problem, f"give one of {' and '.join(SPEEDS)}")
    names = "torque_Nm", given[0], "efficiency"
    torque, speed, efficiency = file.columns(names, "table of efficiencies").values()
    for column in (torque, speed):
        column.refuse(column.values < 0.0, "must not be negative", "give its magnitude")
    wrong = (efficiency.values <= 0.0) | (efficiency.values > 1.0)
    efficiency.refuse(wrong, "is not above 0 and at most 1", "give a fraction, not per cent")
    torques, row = np.unique(torque.values, return_inverse=True)
    speeds, column = np.unique(speed.values, return_inverse=True)
    for name, values in zip(names[:2], (torques, speeds), strict=True):
        if values.size < 2:
            problem = f"has {values.size} value of {name}"
            raise InputError(problem, "give a table over two or more of them", file=path)
    _, first = np.unique(row * speeds.size + column, return_index=True)
    again = np.ones(row.size, dtype=bool)
    again[first] = False
    torque.refuse(again, "is there again with the same speed", "give each pair once")
    table = np.full((torques.size, speeds.size), np.nan)
    table[row, column] = efficiency.values
    if np.any(np.isnan(table)):
        i, j = np.argwhere(np.isnan(table))[0]
        problem = f"has no row for {names[0]} = {torques[i]:g} at {names[1]} = {speeds[j]:g}"
        remedy = "give every torque at every speed: the table must be rectangular"
        raise InputError(problem, remedy, file=path)
    return torques, speeds * SPEEDS[given[0]], table
