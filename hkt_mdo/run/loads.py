"""The largest loads and limited values of a result, or a starting blade, and their places."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.problem.evaluation import loads_along
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import STATIONS, with_many_stations
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.quantities import LOADS, QUANTITIES
from hkt_mdo.results.summary import LoadEntry
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import RotorModel

# relative distance from its bound within which a limit counts as binding; that of a load, of whose
# values along the blade the optimization has a smooth largest that is up to as much above them
BINDING, ENVELOPE = 1e-3, 1e-2

Known = dict[str, Any]
"""Quantities and loads of a trajectory, (n_times,), and the scalars of the design."""


def largest(trajectories: Iterable[Known]) -> dict[str, LoadEntry]:
    """Return the largest loads of some trajectories, and the largest torque, power and speeds."""
    found: dict[str, LoadEntry] = {}
    for known in trajectories:
        reported = {n: (known[n], QUANTITIES[n].unit) for n in LOADS if n in known}
        reported["control_torque"] = known["control_torque"], "N*m"
        reported["power"] = known["generator_power"], "W"
        reported["rotor_speed"] = known["rotor_speed"], "rad/s"
        reported["tip_speed"] = known["rotor_speed"] * known["rotor_radius"], "m/s"
        for name, (values, unit) in reported.items():
            worst = int(np.argmax(values))
            value, before = float(values[worst]), found.get(name)
            if before is None or value > before.value:
                found[name] = LoadEntry(value=value, unit=unit or "", **place(known, worst))
    return found


def of_limit(limit: Limit, known: Known | None) -> LoadEntry:
    """Return a limit with its value that is closest to the bound; none where `known` is None.

    With the value, whether the limit binds, and, of one over time, when.
    """
    end = limit.end if known is None else limit.end_of(limit.reported(known))
    about = {"limit": float(end), "lower": end == limit.lower, "unit": limit.unit or ""}
    if known is None:
        return LoadEntry(**about)
    values, shares = np.ravel(limit.reported(known)), np.ravel(limit.share(known))
    worst = int(np.argmax(shares))
    when = place(known, worst) if limit.place == "time" else {}
    binding = bool(shares[worst] >= binds_from(limit))
    return LoadEntry(value=float(values[worst]), binding=binding, **about, **when)


def binds_from(limit: Limit) -> float:
    """Return the share of a limit from which it counts as binding."""
    return 1.0 - (ENVELOPE if limit.name in LOADS else BINDING)


def place(known: Known, at: int) -> dict[str, float]:
    """Return when the largest value of something occurs, or in which flow, for `LoadEntry`."""
    if known.get("steady"):
        return {"flow_m_s": float(known["inflow_speed"][at])}
    return {"time_s": float(known["time"][at])}


def over_span(
    blade: Blade, several: list[tuple[RotorModel, Known]]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return radii (m) and values along the blade of the stress, of the suction and of the moment.

    `several` has trajectories, each with the rotor in its water and condition.
    `stress` (Pa) and `flapwise_moment` (N*m) are those of the time when the blade has its largest
    stress, `cavitation` that of the time of the largest suction, by the surface which has more;
    it is known at the stations only. Loads that the models lack are left out.
    """
    found = {}
    for name in ("stress", "cavitation"):
        have = [pair for pair in several if name in pair[1]]
        if not have:
            continue
        rotor, known = max(have, key=lambda pair: np.max(pair[1][name]))
        worst = int(np.argmax(known[name]))
        flow = float(known["inflow_speed"][worst])
        ratio = max(float(known["tip_speed_ratio"][worst]), SLOWEST_RATIO)
        model, pressure = rotor.at_flow(flow), 0.5 * rotor.water_density * flow**2
        seen = known.get("sections")  # of a wake that is not in equilibrium
        seen = seen and type(seen)(*(each[worst : worst + 1] for each in seen))
        load = model.loads(blade, ratio, names=(name,), flow=seen)[name]
        if name == "cavitation":
            both_surfaces = load.exact[0].reshape(2, -1)
            found[name] = blade.r, pressure * np.max(both_surfaces, axis=0)
        else:
            flapwise, _ = model.moments(blade, ratio, load.r, seen)
            found[name] = load.r, pressure * load.exact[0]
            found["flapwise_moment"] = load.r, pressure * flapwise[0]
    return found


def placed(blade: Blade, several: list[tuple[RotorModel, Known]]) -> dict[str, LoadEntry]:
    """Return `largest`, with the places along the blade of the loads of `over_span`."""
    found = largest(known for _, known in several)
    for name, (r, values) in over_span(blade, several).items():
        if name in found:
            where = {"r_m": float(r[np.argmax(values)])}
            found[name] = found[name].model_copy(update=where)
    return found


def resolved(physics: Physics, blade: Blade, scenario: Scenario, known: Known) -> Known | None:
    """Return a trajectory at the times of its largest loads, with those of a resolved blade.

    The resolved blade has `STATIONS` stations; between those of the blade itself chord, twist and a
    designed thickness are linear. Loads count up to the blade's own last station: closer to the
    tip, its loss alone decides the angle of attack. Only loads that limits need; None if there are
    no such loads or the blade has as many stations.
    """
    names = physics.load_names
    if not names or blade.r.size >= STATIONS:
        return None
    finer = with_many_stations(physics)
    many = finer.blade.with_rotor_radius(blade.rotor_radius)
    given = blade.chord, blade.twist, blade.thickness
    shape = (each if each is None else np.interp(many.r, blade.r, each) for each in given)
    many, rotor = many.with_shape(*shape), finer.rotor_in(scenario)
    worst = np.unique([np.argmax(known[name]) for name in names])
    size = known["time"].size
    at = {name: x for name, x in known.items() if name != "sections"}
    own = {name: x[worst] if np.shape(x) == (size,) else x for name, x in at.items()}
    found = own | loads_along(rotor, many, own, names, reach=blade.r[-1])
    if "sections" in known:  # in the same proportion as with a wake in equilibrium
        steady = loads_along(physics.rotor_in(scenario), blade, own, names)
        found |= {name: own[name] * found[name] / steady[name] for name in names}
    return found


def tip_deflection(blade: Blade, several: list[tuple[RotorModel, Known]]) -> float | None:
    """Return the largest deflection of a tip in some trajectories as `over_span` takes them, m.

    None where there are none, and where polars follow the Reynolds number.
    """
    found = []
    for rotor, known in several:
        if rotor.polar.follows_reynolds:
            return None
        ratio, flow = np.maximum(known["tip_speed_ratio"], SLOWEST_RATIO), known["inflow_speed"]
        at = np.linspace(ratio.min(), ratio.max(), 201)
        deflection = np.interp(ratio, at, rotor.tip_deflection(blade, at))
        found.append(float(np.max(0.5 * rotor.water_density * flow**2 * deflection)))
    return max(0.0, *found) if found else None
