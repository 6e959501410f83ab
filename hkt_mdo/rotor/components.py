"""The rotor as OpenMDAO components: shape, tables of torque and loads, mass and inertia."""

from dataclasses import replace

import numpy as np
import openmdao.api as om

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.loads import COEFFICIENT_UNITS, LoadModel
from hkt_mdo.rotor.shape import Shape

QUANTITIES = {
    "chord": {"units": "m", "desc": "chord at the stations"},
    "twist": {"units": "rad", "desc": "twist at the stations, set angle included"},
    "thickness": {"desc": "thickness over chord at the stations, where it is designed"},
    "rotor_radius": {"units": "m", "desc": "radius of the swept disc"},
}
SIZES = "chord", "thickness"


def rotor_inputs(blade):
    """Return the names of what changes of a `Blade`: without thickness if that is not designed."""
    return [name for name in QUANTITIES if getattr(blade, name) is not None]


def _blade(start, inputs):
    """Return the blade of some inputs, like another at the start."""
    thickness = (inputs["thickness"],) if start.thickness is not None else ()
    blade = start.with_rotor_radius(inputs["rotor_radius"][0])
    return blade.with_shape(inputs["chord"], inputs["twist"], *thickness)


class ShapeComp(om.ExplicitComponent):
    """Chord, twist and thickness at the stations from what is designed; see `Shape`.

    Inputs chord_control[n_chord] (m), twist_control[n_twist] (rad), thickness_control[n_thickness]
    (over chord), rotor_radius (m), as far as they are designed or scale the blade; outputs chord,
    twist[n_stations] (m, rad) and, where it is designed, thickness[n_stations].
    """

    def initialize(self):
        self.options.declare("shape", types=Shape, recordable=False)

    def setup(self):
        shape = self.options["shape"]
        for name, basis in shape.bases.items():
            if name == "thickness" and not basis.size:
                continue
            self.add_output(name, shape=basis.shape[0], **QUANTITIES[name])
            if basis.size:
                control, (rows, cols) = f"{name}_control", np.nonzero(basis)
                meta = QUANTITIES[name] | {"desc": f"control points of the {name}"}
                self.add_input(control, shape=basis.shape[1], **meta)
                self.declare_partials(name, control, rows=rows, cols=cols, val=basis[rows, cols])
        if not shape.designs_chord:
            self.add_input("rotor_radius", **QUANTITIES["rotor_radius"])
            by_radius = shape.chord_offset / shape.blade.rotor_radius
            self.declare_partials("chord", "rotor_radius", val=by_radius[:, None])

    def compute(self, inputs, outputs):
        shape = self.options["shape"]
        control = [
            inputs[f"{name}_control"] if points else np.empty(0)
            for name, points in shape.points.items()
        ]
        outputs["chord"], outputs["twist"], *thickness = shape.stations(*control)
        for each in thickness:
            outputs["thickness"] = each
        if not shape.designs_chord:
            outputs["chord"] *= shape.stretch(inputs["rotor_radius"])


class TorqueTable(om.ExplicitComponent):
    """Torque coefficient of a blade at the nodes of a `TorqueSpline`, by BEM.

    Inputs chord[n_stations] (m), twist[n_stations] (rad), thickness[n_stations] (over chord) where
    it is designed, rotor_radius (m), with which hub, stations and tip move; output
    torque_coefficient_table[n_nodes]. Q = 0.5 rho V² pi R³ Cq.
    """

    def initialize(self):
        declare = self.options.declare
        declare("blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False)
        declare("polar", desc="section `Polar`", recordable=False)
        declare("nodes", types=np.ndarray, desc="tip speed ratios of the table")
        declare("coefficients", desc="rotor_coefficients of bem or ccblade", recordable=False)

    def setup(self):
        blade = self.options["blade"]
        for name in rotor_inputs(blade):
            self.add_input(name, val=getattr(blade, name), **QUANTITIES[name])
        self.add_output(
            "torque_coefficient_table",
            shape=self.options["nodes"].shape,
            desc="Q / (0.5 rho V^2 pi R^3) at the nodes",
        )
        self.declare_partials("*", "*")

    def compute(self, inputs, outputs):
        outputs["torque_coefficient_table"] = self._solve(inputs, derivatives=False).torque

    def compute_partials(self, inputs, partials):
        found = self._solve(inputs, derivatives=True)
        for name in rotor_inputs(self.options["blade"]):
            partials["torque_coefficient_table", name] = getattr(found, f"torque_by_{name}")

    def _solve(self, inputs, derivatives):
        options, blade = self.options, _blade(self.options["blade"], inputs)
        return options["coefficients"](blade, options["polar"], options["nodes"], derivatives)


class LoadTable(om.ExplicitComponent):
    """Loads of a blade over the dynamic pressure 0.5 rho v², at tip speed ratios; see `LoadModel`.

    Inputs are those of `TorqueTable`. For each of the names thrust, root_moment, stress and
    cavitation that are chosen, an output <name>_table[n_nodes]: the smooth largest load along the
    blade (`Envelope`).
    """

    def initialize(self):
        declare = self.options.declare
        declare("blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False)
        declare("model", types=LoadModel, desc="polar, structure, cavitation", recordable=False)
        declare("names", types=tuple, desc="names of the loads")
        declare("nodes", types=np.ndarray, desc="tip speed ratios of the table")

    def setup(self):
        blade = self.options["blade"]
        for name in rotor_inputs(blade):
            self.add_input(name, val=getattr(blade, name), **QUANTITIES[name])
        for name in self.options["names"]:
            self.add_output(
                f"{name}_table",
                shape=self.options["nodes"].shape,
                units=COEFFICIENT_UNITS[name],
                desc=f"{name} / (0.5 rho v^2) at the nodes",
            )
        self.declare_partials("*", "*")

    def compute(self, inputs, outputs):
        for name, found in self._solve(inputs).items():
            outputs[f"{name}_table"] = found.values

    def compute_partials(self, inputs, partials):
        for name, found in self._solve(inputs, derivatives=True).items():
            for by in rotor_inputs(self.options["blade"]):
                partials[f"{name}_table", by] = getattr(found, f"by_{by}")

    def _solve(self, inputs, derivatives=False):
        options, blade = self.options, _blade(self.options["blade"], inputs)
        found = options["model"].coefficients(
            blade, options["nodes"], derivatives, options["names"]
        )
        return {name: load.envelope(options["model"].exponent) for name, load in found.items()}


class AngleComp(om.ExplicitComponent):
    """Angle of attack at some stations, `slowed` below the lowest tip speed ratio of a rotor.

    Inputs chord[n_stations] (m), twist[n_stations] (rad), rotor_radius (m), with which hub,
    stations and tip move, and lowest_ratio; output angle_of_attack[n] (rad).
    """

    def initialize(self):
        declare = self.options.declare
        declare("blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False)
        declare("polar", desc="one `Polar` a station", recordable=False)
        declare("stations", types=np.ndarray, desc="indices of the stations")
        declare("slowed", types=float, desc="factor on the tip speed ratio")

    def setup(self):
        blade, stations = self.options["blade"], self.options["stations"]
        for name in rotor_inputs(blade):
            self.add_input(name, val=getattr(blade, name), **QUANTITIES[name])
        self.add_input("lowest_ratio", desc="below every w R / v of the trajectories")
        self.add_output("angle_of_attack", shape=stations.shape, units="rad", desc="at stations")
        rows = np.arange(stations.size)
        self.declare_partials("*", ("chord", "twist"), rows=rows, cols=stations)
        self.declare_partials("*", ("lowest_ratio", "rotor_radius"))

    def compute(self, inputs, outputs):
        outputs["angle_of_attack"] = self._solve(inputs)[0]

    def compute_partials(self, inputs, partials):
        _, by_ratio, by_chord, by_twist = self._solve(inputs, derivatives=True)
        share = inputs["chord"][self.options["stations"]] / inputs["rotor_radius"]
        partials["angle_of_attack", "lowest_ratio"] = self.options["slowed"] * by_ratio[:, None]
        partials["angle_of_attack", "chord"] = by_chord
        partials["angle_of_attack", "twist"] = by_twist
        partials["angle_of_attack", "rotor_radius"] = -(by_chord * share)[:, None]

    def _solve(self, inputs, derivatives=False):
        options, blade = self.options, _blade(self.options["blade"], inputs)
        ratio = options["slowed"] * inputs["lowest_ratio"][0]
        found = bem.angles_of_attack(blade, options["polar"], ratio, derivatives)
        return [each[options["stations"]] for each in found]


class InertiaComp(om.ExplicitComponent):
    """Mass and inertia of the rotor from its chord and radius; see `mass_and_inertia`.

    Inputs chord[n_stations] (m), thickness[n_stations] (over chord) where it is designed,
    rotor_radius (m), with which hub, stations and tip move: mass is proportional to it and the
    blades' inertia to its cube. Outputs mass (kg), inertia (kg*m**2).
    """

    def initialize(self):
        declare = self.options.declare
        declare("blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False)
        declare("section_area", desc="as mass_and_inertia takes it", recordable=False)
        declare("density", types=float, desc="of the material, kg/m**3")
        declare("hub_inertia", types=float, desc="kg*m**2")

    def setup(self):
        blade = self.options["blade"]
        for name in (*self._sizes, "rotor_radius"):
            self.add_input(name, val=getattr(blade, name), **QUANTITIES[name])
        self.add_output("mass", units="kg", desc="mass of the blades")
        self.add_output("inertia", units="kg*m**2", desc="inertia of the rotor about its axis")
        self.declare_partials("*", "*")

    @property
    def _sizes(self):
        """Names of what decides the sections' areas."""
        return [name for name in rotor_inputs(self.options["blade"]) if name in SIZES]

    def _evaluate(self, inputs):
        """Return the results at the start's radius, and the ratio of the radius to the start's."""
        options = self.options
        blade = replace(options["blade"], **{name: inputs[name] for name in self._sizes})
        found = mass_and_inertia(blade, options["section_area"], options["density"])
        return found, inputs["rotor_radius"][0] / blade.rotor_radius

    def compute(self, inputs, outputs):
        found, stretch = self._evaluate(inputs)
        outputs["mass"] = found.mass * stretch
        outputs["inertia"] = found.inertia * stretch**3 + self.options["hub_inertia"]

    def compute_partials(self, inputs, partials):
        found, stretch = self._evaluate(inputs)
        radius = self.options["blade"].rotor_radius
        for power, name in ((1, "mass"), (3, "inertia")):
            for by in self._sizes:
                partials[name, by] = getattr(found, f"{name}_by_{by}") * stretch**power
            slope = power * getattr(found, name) * stretch ** (power - 1) / radius
            partials[name, "rotor_radius"] = slope
