"""The rotor of a case in steady operation, as a part of another OpenMDAO model."""

import re

import numpy as np
import openmdao.api as om

from hkt_mdo.case import Case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics as make_physics
from hkt_mdo.quantities import meta_of
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.components import BladeGroup, refuse_values

_POINTS = {
    "tip_speed_ratio": "rotor_speed * rotor_radius / inflow_speed",
    "rotor_speed": "tip_speed_ratio * inflow_speed / rotor_radius",
}
_PRESSURE = "0.5 * density * inflow_speed**2"
_SCALED = {
    "hydrodynamic_torque": f"{_PRESSURE} * pi * rotor_radius**3 * torque_coefficient",
    "hydrodynamic_power": f"{_PRESSURE} * inflow_speed * pi * rotor_radius**2 * tip_speed_ratio "
    "* torque_coefficient",
    "power_coefficient": "tip_speed_ratio * torque_coefficient",
    "thrust_coefficient": "thrust_table / (pi * rotor_radius**2)",
}


class RotorGroup(om.Group):
    """The rotor of a case at operating points: performance, loads, mass and inertia.

    By blade element momentum theory at each point, without a curve over the tip speed ratio.
    Partials are exact.

    Parameters
    ----------
    case : Case
        Its rotor, water, depth and design variables of the blade; the flow gives only the initial
        value of the flow's speed.
    num_points : int
        Number of operating points, n_points.
    given : str
        What defines the operating points besides the flow's speed: "tip_speed_ratio" or
        "rotor_speed"; the other one is an output.
    blade : Blade, optional
        The initial blade, such as ``solution.design().blade``; by default that of the case.

    Notes
    -----
    Inputs:

    - inflow_speed[n_points] (m/s), tip_speed_ratio[n_points] or rotor_speed[n_points] (rad/s);
      initially the mean speed of the case's flow and the blade's best tip speed ratio
    - rotor_radius (m), with which hub, stations, tip and a chord that is not designed are scaled
    - chord_control[n_chord] (m), twist_control[n_twist] (rad), thickness_control[n_thickness], as
      far as the case's section `design` lets them be designed
    - density (kg/m**3)

    Outputs:

    - torque_coefficient, power_coefficient, thrust_coefficient[n_points]
    - hydrodynamic_torque (N*m), hydrodynamic_power (W)[n_points]
    - thrust (N), root_moment (N*m)[n_points]; with an outline stress (Pa), with a depth
      cavitation[n_points], which must not exceed one. Stress and cavitation are smooth maxima along
      the blade, which are never below the largest value and at most a few per cent above it
    - chord[n_stations] (m), twist[n_stations] (rad), set angle included; thickness[n_stations]
      over chord where it is designed
    - mass (kg) of the blades, inertia (kg*m**2) of the rotor
    """

    def __init__(self, case, **options):
        super().__init__(case=case, **options)

    def initialize(self):
        declare = self.options.declare
        declare("case", types=Case, recordable=False, desc="rotor, water and what is designed")
        declare("num_points", default=1, types=int, lower=1, desc="number of operating points")
        declare("given", default="tip_speed_ratio", values=tuple(_POINTS))
        declare("blade", default=None, types=Blade, allow_none=True, recordable=False)

    def setup(self):
        physics, operand = make_physics(self.options["case"]), self.options["given"]
        if physics.rotor.polar.follows_reynolds:
            problem = "uses polars at local Reynolds numbers, for which loads have no derivatives"
            raise InputError(problem, "give invariant", key="rotor.reynolds", value="local")
        blade, points = self.options["blade"] or physics.blade, (self.options["num_points"],)
        flow = np.full(points, physics.scenarios[0].mean_flow)
        ratio = np.full(points, physics.rotor.best_operation(blade).tip_speed_ratio)
        start = {
            "tip_speed_ratio": ratio,
            "rotor_speed": ratio * flow / blade.rotor_radius,
            "inflow_speed": flow,
            "rotor_radius": blade.rotor_radius,
            "density": physics.density,
        }
        for name in {operand, "inflow_speed", "rotor_radius", "density"}:
            self.set_input_defaults(name, start[name], units=meta_of(name)["units"])
        (derived,) = _POINTS.keys() - {operand}
        points = _formulas({derived: _POINTS[derived]}, start)
        self.add_subsystem("operating_points", points, promotes=["*"])
        loads, shape = physics.rotor.load_names, physics.shape
        options = {"nodes": ratio, "names": ["torque_coefficient", *loads], "vary": True}
        blades = BladeGroup(rotor=physics.rotor, blade=blade, shape=shape, **options)
        outputs = [*shape.offsets, "mass", "inertia", *(f"{name}_table" for name in loads)]
        outputs += [("torque_coefficient_table", "torque_coefficient")]
        self.add_subsystem("blades", blades, promotes_inputs=["*"], promotes_outputs=outputs)
        start |= {"torque_coefficient": ratio} | {f"{name}_table": ratio for name in loads}
        formulas = _SCALED | {name: f"{_PRESSURE} * {name}_table" for name in loads}
        self.add_subsystem("power_and_loads", _formulas(formulas, start), promotes=["*"])


def _formulas(formulas, start):
    """Return a component of formulas, by output, of inputs with their values at the start."""
    variables = {}
    for output, formula in formulas.items():
        variables[output] = meta_of(output) | {"shape": start["inflow_speed"].shape}
        for name in start.keys() & set(re.findall(r"\w+", formula)):
            variables[name] = meta_of(name) | {"val": start[name]}
    text = [f"{output} = {formula}" for output, formula in formulas.items()]
    return _Formulas(text, has_diag_partials=True, **variables)


class _Formulas(om.ExecComp):
    """Formulas that refuse a flow, speed or radius that is not positive."""

    def compute(self, inputs, outputs):
        refuse_values(inputs)
        super().compute(inputs, outputs)
