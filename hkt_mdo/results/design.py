"""The design of a result as objects: blade, polars, outlines, control law and turbine.

Nothing else in this package needs the rotor, its files or the optimization's modules.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.problem.evaluation import steady_plant
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.turbine import Turbine
from hkt_mdo.results.sections import blade_of
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.outline import Outline


@dataclass(frozen=True, eq=False)
class Design:
    """The design of a run.

    Attributes
    ----------
    solution : Solution
        The result of the run.
    blade : Blade
        The blade, its twist with the set angle.
    polars : Polar, tuple of Polar or LocalReynolds
        One polar for all stations, or one a station.
    outlines : tuple of Outline
        One for all stations, or one a station; where the thickness is designed, those of the
        case's sections, from thin to thick.
    law : Law
        The control law with the torque that it demands; the torque of an open loop is in the
        trajectory.
    gains : ndarray, shape (n_gains,)
        Gains of the law, in its `gain_units`; empty for open loop.
    inertia : float
        Inertia of the rotor, kg m^2.
    turbine : Turbine
        The turbine of the case (`hkt_mdo.problem.turbine`), with the blade of the result.
    physics : Physics
        The physics of the case, with the blade at the start.
    """

    solution: Any
    blade: Blade
    polars: Any
    outlines: tuple[Outline, ...]
    law: Law
    gains: np.ndarray
    inertia: float
    turbine: Turbine
    physics: Physics

    @classmethod
    def of(cls, solution: Any) -> Design:
        """Build the design of a result from its case and the files that this names.

        Parameters
        ----------
        solution : Solution
            The result, whose summary has a blade.

        Returns
        -------
        Design

        Raises
        ------
        InputError
            If a file of the case is gone or broken, or the case has other stations.
        """
        summary, world = solution.summary, physics(solution.case)
        blade = replace(blade_of(solution, world.blade), hub_inertia=summary.hub_inertia_kg_m2)
        polars, turbine = world.rotor.as_built(blade).polar, world.turbine
        gains = np.atleast_1d([] if summary.gain is None else summary.gain).astype(float)
        return cls(
            solution,
            blade,
            polars,
            turbine.outlines,
            world.law.applied(1.0),
            gains,
            world.mass_and_inertia(blade)[1],
            turbine._replace(blade=blade, polar=polars),
            world,
        )

    @property
    def thickness(self) -> np.ndarray:
        """Largest thickness over chord at the stations, shape (n_stations,)."""
        return self.physics.rotor.thickness_of(self.blade)

    @property
    def plant(self) -> Plant:
        """The rotor in the water with its generator, by direct BEM."""
        return steady_plant(self.physics, self.physics.rotor, self.blade)
