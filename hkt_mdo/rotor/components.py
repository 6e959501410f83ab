"""The rotor in OpenMDAO: shape, tables of torque and loads, mass and inertia; all as one Group."""

from dataclasses import replace

import numpy as np
import openmdao.api as om

from hkt_mdo.errors import InputError
from hkt_mdo.quantities import meta_of
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.shape import Shape

INPUTS = "chord", "twist", "thickness", "rotor_radius"
"""Quantities of a blade that may change in an optimization."""
_POSITIVE = {"chord", "thickness", "rotor_radius", "density", "inflow_speed"}
_POSITIVE |= {"tip_speed_ratio", "rotor_speed"}
_SCALARS = "rotor_radius", "hub_inertia"


def refuse_values(inputs):
    """Refuse inputs of which no rotor can be computed.

    Parameters
    ----------
    inputs : om.Vector
        Inputs of a component.

    Raises
    ------
    AnalysisError
        A driver may then try another point.
    """
    for name, value in inputs.items():
        allowed = np.isfinite(value) & ((value.real > 0.0) | (name not in _POSITIVE))
        if not np.all(allowed):
            what = "positive" if name in _POSITIVE else "finite"
            raise om.AnalysisError(f"{name} = {value.real[~allowed][0]:g} is not {what}")


def refuse_complex_step(component):
    """Refuse complex step through blade element momentum theory, which drops imaginary parts.

    Parameters
    ----------
    component : om.ExplicitComponent
        The component that solves it.

    Raises
    ------
    InputError
        If the component is under complex step.
    """
    if component.under_complex_step:
        problem = "takes no complex numbers, and its derivatives by complex step would be zero"
        remedy = "use its exact partials (no approx_totals, approx_group or method='cs'), or 'fd'"
        raise InputError(problem, remedy, key=component.pathname)


def rotor_inputs(blade):
    """Return the names of the quantities of a blade that change in an optimization.

    Parameters
    ----------
    blade : Blade
        The blade.

    Returns
    -------
    list of str
        Names of `INPUTS`; without the thickness if that is not designed.
    """
    return [name for name in INPUTS if getattr(blade, name) is not None]


class ShapeComp(om.ExplicitComponent):
    """Chord, twist and thickness at the stations from the design variables; see `Shape`.

    Inputs chord_control[n_chord] (m), twist_control[n_twist] (rad), thickness_control[n_thickness]
    (over chord), as far as they are designed, and rotor_radius (m), with which a chord that is not
    designed is scaled; outputs chord, twist[n_stations] (m, rad) and, where it is designed,
    thickness[n_stations].

    Parameters
    ----------
    shape : Shape
        What is designed, and its control points.
    """

    def __init__(self, shape: Shape):
        super().__init__()
        self._shape = shape

    def setup(self):
        shape = self._shape
        for name, offset in shape.offsets.items():
            self.add_output(name, shape=offset.shape, **meta_of(name))
        for name, basis in shape.bases.items():
            control, (rows, cols) = f"{name}_control", np.nonzero(basis)
            meta = meta_of(name) | {"desc": f"control points of the {name}"}
            self.add_input(control, shape=basis.shape[1], **meta)
            self.declare_partials(name, control, rows=rows, cols=cols, val=basis[rows, cols])
        self.add_input("rotor_radius", **meta_of("rotor_radius"))
        if not shape.designs_chord:
            by_radius = shape.offsets["chord"] / shape.blade.rotor_radius
            self.declare_partials("chord", "rotor_radius", val=by_radius[:, None])

    def compute(self, inputs, outputs):
        control = {name: inputs[f"{name}_control"] for name in self._shape.bases}
        for name, value in self._shape.stations(control, inputs["rotor_radius"]).items():
            outputs[name] = value


class BladeComp(om.ExplicitComponent):
    """Base of the components below, whose inputs describe the blade of a rotor.

    Inputs chord[n_stations] (m), twist[n_stations] (rad), thickness[n_stations] (over chord) where
    it is designed, and rotor_radius (m), with which hub, stations and tip move.

    Parameters
    ----------
    rotor : RotorModel
        The rotor.
    blade : Blade
        Its blade at the start.
    """

    def __init__(self, rotor: RotorModel, blade: Blade):
        super().__init__()
        self._rotor, self._blade, self._inputs_of_blade = rotor, blade, rotor_inputs(blade)

    def setup(self):
        for name in self._inputs_of_blade:
            self.add_input(name, val=getattr(self._blade, name), **meta_of(name))


class TablesComp(BladeComp):
    """Tables of a blade over tip speed ratios, by BEM: its torque coefficient and its loads.

    Inputs are those of `BladeComp`, and tip_speed_ratio[n_nodes] if the nodes vary. Outputs are
    <name>_table[n_nodes] for each name (`RotorModel.tables`), loads over the dynamic pressure
    0.5 rho v²; and, if asked for, weight_stress (Pa) of `LoadModel.weight_stress`.

    Parameters
    ----------
    rotor, blade : RotorModel, Blade
        Those of `BladeComp`.
    nodes : numpy.ndarray
        Tip speed ratios, or their initial values.
    names : sequence of str
        What has a table: torque_coefficient, and loads of the rotor's `load_names`.
    vary : bool
        Whether the nodes are an input.
    band : Band or None
        With it, the tables are those of `Band.solve`.
    weight : bool
        Whether the stress by the weight in water is computed, where the nodes do not vary.
    """

    def __init__(self, rotor, blade, nodes, names, *, vary=False, band=None, weight=False):
        super().__init__(rotor, blade)
        self._nodes, self._names, self._vary = nodes, names, vary
        self._band, self._weight = band, weight

    def setup(self):
        super().setup()
        self._latest = b"", {}
        rows = np.arange(self._nodes.size)
        if self._vary:
            self.add_input("tip_speed_ratio", val=self._nodes, desc="Omega R / V of the disc")
        for name, table in self._solve(self._blade, self._nodes).items():
            self.add_output(name, shape=table.values.shape, **meta_of(name))
            self.declare_partials(name, self._inputs_of_blade)
            if self._vary:
                self.declare_partials(name, "tip_speed_ratio", rows=rows, cols=rows)

    def _tables(self, inputs):
        """Return the tables by name, with their derivatives, which an optimizer asks for next."""
        at = inputs.asarray().tobytes()
        if at != self._latest[0]:
            refuse_complex_step(self)
            refuse_values(inputs)
            shape = {name: inputs[name] for name in self._inputs_of_blade if name != "rotor_radius"}
            blade = self._blade.with_rotor_radius(inputs["rotor_radius"][0]).with_shape(**shape)
            ratio = inputs["tip_speed_ratio"] if self._vary else self._nodes
            self._latest = at, self._solve(blade, ratio)
        return self._latest[1]

    def _solve(self, blade, ratio):
        """Return the tables of a blade over tip speed ratios."""
        rotor = self._rotor
        weight = {"weight_stress": rotor.weight_stress(blade).envelope()} if self._weight else {}
        if self._band is not None:
            return weight | self._band.solve(rotor, blade, self._names, derivatives=True)
        tables = rotor.tables(blade, ratio, self._names, derivatives=True)
        return weight | {f"{name}_table": table for name, table in tables.items()}

    def compute(self, inputs, outputs):
        for name, table in self._tables(inputs).items():
            outputs[name] = table.values

    def compute_partials(self, inputs, partials):
        by_ratio = ["tip_speed_ratio"] if self._vary else []
        for output, table in self._tables(inputs).items():
            for name in (*self._inputs_of_blade, *by_ratio):
                partials[output, name] = getattr(table, f"by_{name}")


class InertiaComp(BladeComp):
    """Mass, inertia and planform of a rotor; see `mass_and_inertia` and `Blade.area_weights`.

    Inputs are those of `BladeComp`, and hub_inertia (kg*m**2) where it is designed. Hub, stations
    and tip move with the radius: mass and area are proportional to it and the blades' inertia to
    its cube. Outputs mass (kg), inertia (kg*m**2), blade_area (m**2).
    """

    def setup(self):
        super().setup()
        for name in ("mass", "inertia", "blade_area"):
            self.add_output(name, **meta_of(name))
        if (hub := self._blade.hub_inertia) is not None:
            self.add_input("hub_inertia", val=hub, **meta_of("hub_inertia"))
        self.declare_partials("*", "*")

    def _evaluate(self, inputs, **moved):
        """Return the outputs by name of the blade of the inputs, some of which are moved."""
        values = {name: x[0] if name in _SCALARS else x for name, x in inputs.items()} | moved
        blade = replace(self._blade.with_rotor_radius(values.pop("rotor_radius")), **values)
        area = {"blade_area": blade.chord @ blade.area_weights}
        return self._rotor.mass_and_inertia(blade)._asdict() | area

    def compute(self, inputs, outputs):
        for name, value in self._evaluate(inputs).items():
            outputs[name] = value

    def compute_partials(self, inputs, partials):
        for name, value in inputs.items():
            moved = value + 1j * bem.STEP * np.eye(value.size)
            moved = self._evaluate(inputs, **{name: moved[0, 0] if name in _SCALARS else moved})
            for output, result in moved.items():
                partials[output, name] = np.imag(result) / bem.STEP


class BladeGroup(om.Group):
    """The blades of a rotor: mass, inertia and tables over the tip speed ratio from their shape.

    It needs no flow and no trajectory, so that any model may have it.

    Inputs are rotor_radius (m) and the inputs of `ShapeComp`; without a shape rotor_radius, chord,
    twist[n_stations] (m, rad), and thickness[n_stations] (over chord) where the blade has one; and
    tip_speed_ratio[n_nodes] if it varies. Outputs are chord, twist and thickness (with a shape);
    mass (kg), inertia (kg*m**2), blade_area (m**2) and the tables of `TablesComp`. Partials are
    exact.

    Parameters
    ----------
    rotor : RotorModel
        The rotor.
    blade : Blade
        Its blade at the start.
    shape : Shape or None
        The shape of the blade, if it is designed by control points.
    **tables : dict
        `nodes`, `names`, `vary`, `band` and `weight` of `TablesComp`.
    """

    def __init__(self, rotor: RotorModel, blade: Blade, shape: Shape | None = None, **tables):
        super().__init__()
        self._rotor, self._blade, self._shape, self._tables = rotor, blade, shape, tables

    def setup(self):
        rotor, blade, shape, tables = self._rotor, self._blade, self._shape, self._tables
        self.set_input_defaults("rotor_radius", blade.rotor_radius, units="m")
        if shape is not None:
            self.add_subsystem("shape", ShapeComp(shape=shape), promotes=["*"])
            for name, values in shape.within(blade).items():
                self.set_input_defaults(f"{name}_control", values)
        mass = InertiaComp(rotor=rotor, blade=blade)
        self.add_subsystem("mass_and_inertia", mass, promotes=["*"])
        if tables["names"] or tables.get("weight"):
            self.add_subsystem("tables", TablesComp(rotor, blade, **tables), promotes=["*"])
