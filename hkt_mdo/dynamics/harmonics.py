"""Constituents of a tidal current from a record, by harmonic analysis: linear least squares."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hkt_mdo.dynamics.flows import TIDAL_HOURS, TidalConstituent, TidalInflow
from hkt_mdo.dynamics.long_record import FlowSamples
from hkt_mdo.errors import InputError, install, needed

HOUR, DAY = 3600.0, 86400.0
TINY = 1e-4  # amplitude over the largest, below which a constituent is left out of a case


@dataclass(frozen=True, eq=False)
class Tide:
    """The tide in a record.

    Attributes
    ----------
    names : tuple of str
        Of the constituents, the largest first.
    flow : TidalInflow
        The mean and the constituents, their phases at the first sample.
    explained : float
        Share of the variance of the record that it explains.
    """

    names: tuple[str, ...]
    flow: TidalInflow
    explained: float

    @property
    def section(self) -> dict[str, Any]:
        """The section `resource` of a case with this tide."""
        least, waves = TINY * self.flow.constituents[0].amplitude, self.flow.constituents
        parts = [x.model_dump(exclude_none=True) for x in waves if x.amplitude >= least]
        return {"profile": "tidal_year", "mean": self.flow.mean, "constituents": parts}


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
    size, phase, waves = np.hypot(even, odd), np.arctan2(odd, even) % (2.0 * np.pi), {}
    for index in np.argsort(-size)[:100]:
        name, wave = chosen[index], {"amplitude": size[index], "phase": phase[index]}
        wave |= {"name": name} if name in TIDAL_HOURS else {"period": 1.0 / frequency[name]}
        waves[name] = TidalConstituent(**wave)
    flow = TidalInflow(mean=fitted[0], constituents=tuple(waves.values()))
    return Tide(tuple(waves), flow, explained)


def _frequency(name: str) -> float:
    """Return the frequency of a constituent, Hz; of those a case does not know, from `utide`."""
    if name in TIDAL_HOURS:
        return 1.0 / (HOUR * TIDAL_HOURS[name])
    utide = needed("utide", install("resource"), f"the period of {name} ")
    index = utide.constit_index_dict.get(name)
    if index is None:
        problem = f"is no constituent: known are {', '.join(TIDAL_HOURS)} and others of utide"
        raise InputError(problem, "give names such as M2,S2,K1", key="constituents", value=name)
    return float(utide.ut_constants["const"]["freq"][index]) / HOUR


def _separated(frequency: dict[str, float], length: float, asked: bool) -> list[str]:
    """Return the constituents that a record of a length, s, separates, the usual order first.

    Raises InputError if a requested one is not among them.
    """
    separated: dict[str, float] = {"the mean": 0.0}
    for name, value in frequency.items():
        near = min(separated, key=lambda other: abs(separated[other] - value))
        apart = abs(separated[near] - value)
        if apart * length >= 1.0:
            separated[name] = value
        elif asked:
            problem = f"cannot be separated from {near} in a record of {length / DAY:.4g} days"
            longer = f"a record of {1.0 / apart / DAY:.4g} days at least, or " if apart else ""
            remedy = f"give {longer}fewer constituents"
            raise InputError(problem, remedy, key="constituents", value=name)
    if len(separated) == 1:
        problem = f"is too short for any constituent, with {length / DAY:.3g} days"
        raise InputError(problem, "give a longer record, or none of the tide", key="constituents")
    return [name for name in separated if name != "the mean"]
