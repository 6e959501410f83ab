"""Constituents of a tidal current from a record, by harmonic analysis: linear least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hkt_mdo.dynamics.flows import TIDAL_HOURS
from hkt_mdo.dynamics.long_record import FlowSamples
from hkt_mdo.errors import InputError, install, needed

HOUR, DAY = 3600.0, 86400.0
TINY = 1e-4  # amplitude over the largest, below which a constituent is left out of a case


@dataclass(frozen=True, eq=False)
class Tide:
    """A current as a mean and constituents, v = mean + sum_k a_k cos(2 pi f_k t - phase_k).

    Attributes
    ----------
    names : tuple of str
    frequency : np.ndarray
        Hz, (n,).
    amplitude, phase : np.ndarray
        m/s and rad at the first sample, (n,).
    mean : float
        m/s.
    explained : float
        Share of the variance of the record that it explains.
    """

    names: tuple[str, ...]
    frequency: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    mean: float
    explained: float

    def speed_at(self, time: np.ndarray) -> np.ndarray:
        """Return the predicted speed, m/s, at times since the first sample, s."""
        angle = np.multiply.outer(time, 2.0 * np.pi * self.frequency)
        return self.mean + np.cos(angle - self.phase) @ self.amplitude

    @property
    def section(self) -> dict[str, Any]:
        """The section `resource` of a case with this tide, the largest constituents first."""
        size, parts = self.amplitude, []
        order = np.argsort(-size)
        for place in order[size[order] >= TINY * np.max(size)][:100]:
            name, period = self.names[place], float(1.0 / self.frequency[place])
            about: dict[str, Any] = {"name": name} if name in TIDAL_HOURS else {"period": period}
            wave = {"amplitude": float(size[place]), "phase": float(self.phase[place])}
            parts.append(about | wave)
        return {"profile": "tidal_year", "mean": self.mean, "constituents": parts}


def constituents(samples: FlowSamples, names: Sequence[str] = ()) -> Tide:
    """Return the tidal constituents of a record, by least squares.

    Parameters
    ----------
    samples : FlowSamples
        Speed with its sign.
    names : sequence of str
        Requested constituents; by default those of `TIDAL_HOURS` that the record separates.

    Returns
    -------
    Tide

    Raises
    ------
    InputError
        If a constituent is unknown, or the record is too short to separate the requested ones: by
        Rayleigh's criterion their frequencies must differ by one over its length.
    """
    frequency = {name: _frequency(name) for name in names or TIDAL_HOURS}
    chosen = _separated(frequency, float(samples.time[-1]), asked=bool(names))
    rate = np.array([frequency[name] for name in chosen])
    angle = np.multiply.outer(samples.time, 2.0 * np.pi * rate)
    columns = np.column_stack((np.ones(samples.time.size), np.cos(angle), np.sin(angle)))
    fitted, *_ = np.linalg.lstsq(columns, samples.speed, rcond=None)
    even, odd = fitted[1:].reshape(2, -1)
    left = samples.speed - columns @ fitted
    explained = 1.0 - float(np.var(left)) / max(float(np.var(samples.speed)), 1e-300)
    phase = np.arctan2(odd, even) % (2.0 * np.pi)
    return Tide(tuple(chosen), rate, np.hypot(even, odd), phase, float(fitted[0]), explained)


def _frequency(name: str) -> float:
    """Return the frequency of a constituent, Hz; of those a case does not know, from `utide`."""
    if name in TIDAL_HOURS:
        return 1.0 / (HOUR * TIDAL_HOURS[name])
    utide = needed("utide", install("resource"), f"the period of {name} ")
    place = utide.constit_index_dict.get(name)
    if place is None:
        problem = f"is no constituent: known are {', '.join(TIDAL_HOURS)} and others of utide"
        raise InputError(problem, "give names such as M2,S2,K1", key="constituents", value=name)
    return float(utide.ut_constants["const"]["freq"][place]) / HOUR


def _separated(frequency: dict[str, float], length: float, asked: bool) -> list[str]:
    """Return the constituents that a record of a length, s, separates, the usual order first.

    Raises InputError if a requested one is not among them.
    """
    kept: dict[str, float] = {"the mean": 0.0}
    for name, value in frequency.items():
        near = min(kept, key=lambda other: abs(kept[other] - value))
        apart = abs(kept[near] - value)
        if apart * length >= 1.0:
            kept[name] = value
        elif asked:
            needed = 1.0 / max(apart, 1e-300) / DAY
            problem = f"cannot be separated from {near} in a record of {length / DAY:.4g} days"
            remedy = f"give a record of {needed:.4g} days at least, or fewer constituents"
            raise InputError(problem, remedy, key="constituents", value=name)
    if len(kept) == 1:
        problem = f"is too short for any constituent, with {length / DAY:.3g} days"
        raise InputError(problem, "give a longer record, or none of the tide", key="constituents")
    return [name for name in kept if name != "the mean"]
