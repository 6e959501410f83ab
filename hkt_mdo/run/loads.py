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

Series = dict[str, Any]
"""Quantities and loads of a trajectory, (n_times,), and the scalars of the design."""


def largest(trajectories: Iterable[Series]) -> dict[str, LoadEntry]:
    """Return the largest loads of some trajectories, and the largest torque, power and speeds."""
    entries: dict[str, LoadEntry] = {}
    for series in trajectories:
        reported = {n: (series[n], QUANTITIES[n].unit) for n in LOADS if n in series}
        reported["control_torque"] = series["control_torque"], "N*m"
        reported["power"] = series["generator_power"], "W"
        reported["rotor_speed"] = series["rotor_speed"], "rad/s"
        reported["tip_speed"] = series["rotor_speed"] * series["rotor_radius"], "m/s"
        for name, (values, unit) in reported.items():
            worst = int(np.argmax(values))
            value, before = float(values[worst]), entries.get(name)
            if before is None or value > before.value:
                entries[name] = LoadEntry(value=value, unit=unit or "", **place(series, worst))
    return entries


def of_limit(limit: Limit, series: Series | None) -> LoadEntry:
    """Return a limit with its value that is closest to the bound; none where `series` is None.

    With the value, whether the limit binds, and, of one over time, when.
    """
    end = limit.end if series is None else limit.end_of(limit.reported(series))
    bound = {"limit": float(end), "lower": end == limit.lower, "unit": limit.unit or ""}
    if series is None:
        return LoadEntry(**bound)
    values, shares = np.ravel(limit.reported(series)), np.ravel(limit.share(series))
    worst = int(np.argmax(shares))
    when = place(series, worst) if limit.place == "time" else {}
    binding = bool(shares[worst] >= binds_from(limit))
    return LoadEntry(value=float(values[worst]), binding=binding, **bound, **when)


def binds_from(limit: Limit) -> float:
    """Return the share of a limit from which it counts as binding."""
    return 1.0 - (ENVELOPE if limit.name in LOADS else BINDING)


def place(series: Series, index: int) -> dict[str, float]:
    """Return when the largest value of something occurs, or in which flow, for `LoadEntry`."""
    if series.get("steady"):
        return {"flow_m_s": float(series["inflow_speed"][index])}
    return {"time_s": float(series["time"][index])}


def over_span(
    blade: Blade, pairs: list[tuple[RotorModel, Series]]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return radii (m) and values along the blade of the stress, of the suction and of the moment.

    `pairs` has trajectories, each with the rotor in its water and condition.
    `stress` (Pa) and `flapwise_moment` (N*m) are those of the time when the blade has its largest
    stress, `cavitation` that of the time of the largest suction, by the surface which has more;
    it is known at the stations only. Loads that the models lack are left out.
    """
    curves = {}
    for name in ("stress", "cavitation"):
        have = [pair for pair in pairs if name in pair[1]]
        if not have:
            continue
        rotor, series = max(have, key=lambda pair: np.max(pair[1][name]))
        worst = int(np.argmax(series[name]))
        flow = float(series["inflow_speed"][worst])
        ratio = max(float(series["tip_speed_ratio"][worst]), SLOWEST_RATIO)
        model, pressure = rotor.at_flow(flow), 0.5 * rotor.water_density * flow**2
        seen = series.get("sections")  # of a wake that is not in equilibrium
        seen = seen and type(seen)(*(values[worst : worst + 1] for values in seen))
        load = model.loads(blade, ratio, names=(name,), flow=seen)[name]
        if name == "cavitation":
            both_surfaces = load.exact[0].reshape(2, -1)
            curves[name] = blade.r, pressure * np.max(both_surfaces, axis=0)
        else:
            flapwise, _ = model.moments(blade, ratio, load.r, seen)
            curves[name] = load.r, pressure * load.exact[0]
            curves["flapwise_moment"] = load.r, pressure * flapwise[0]
    return curves


def placed(blade: Blade, pairs: list[tuple[RotorModel, Series]]) -> dict[str, LoadEntry]:
    """Return `largest`, with the places along the blade of the loads of `over_span`."""
    entries = largest(series for _, series in pairs)
    for name, (r, values) in over_span(blade, pairs).items():
        if name in entries:
            entries[name] = entries[name].model_copy(update={"r_m": float(r[np.argmax(values)])})
    return entries


def resolved(physics: Physics, blade: Blade, scenario: Scenario, series: Series) -> Series | None:
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
    coarse = blade.chord, blade.twist, blade.thickness
    shape = (values if values is None else np.interp(many.r, blade.r, values) for values in coarse)
    many, rotor = many.with_shape(*shape), finer.rotor_in(scenario)
    worst = np.unique([np.argmax(series[name]) for name in names])
    size = series["time"].size
    at = {name: x for name, x in series.items() if name != "sections"}
    chosen = {name: x[worst] if np.shape(x) == (size,) else x for name, x in at.items()}
    result = chosen | loads_along(rotor, many, chosen, names, reach=blade.r[-1])
    if "sections" in series:  # in the same proportion as with a wake in equilibrium
        steady = loads_along(physics.rotor_in(scenario), blade, chosen, names)
        result |= {name: chosen[name] * result[name] / steady[name] for name in names}
    return result


def tip_deflection(blade: Blade, pairs: list[tuple[RotorModel, Series]]) -> float | None:
    """Return the largest deflection of a tip in some trajectories as `over_span` takes them, m.

    Upstream or downstream, without a sign. None where there are none, and where polars follow the
    Reynolds number.
    """
    deflections = []
    for rotor, series in pairs:
        if rotor.polar.follows_reynolds:
            return None
        ratio, flow = np.maximum(series["tip_speed_ratio"], SLOWEST_RATIO), series["inflow_speed"]
        at = np.linspace(ratio.min(), ratio.max(), 201)
        deflection = np.interp(ratio, at, np.abs(rotor.tip_deflection(blade, at)))
        deflections.append(float(np.max(0.5 * rotor.water_density * flow**2 * deflection)))
    return max(deflections, default=None)
