"""Mass and rotational inertia of solid blades (paper Sec. II-B)."""

from dataclasses import replace

import numpy as np
import openmdao.api as om

# Three points are exact for (linear chord)² times linear shape times r², a quintic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def mass_and_inertia(blade, section_area, density, hub_inertia=0.0):
    """Return the rotor's mass and inertia, and their gradients with respect to chord.

    A section is similar to its outline, its area section_area * chord²; chord and section_area run
    linearly between stations and are carried unchanged inward to the hub and outward to the tip:
    m = B rho integral of A dr, I = B rho integral of A (r cos(cone))² dr + hub inertia, both exact.

    Parameters
    ----------
    blade : Blade
        Its chord may be complex.
    section_area : float or array, shape (n_stations,)
        Area of the outline over chord squared.
    density : float, kg/m**3
    hub_inertia : float, kg*m**2

    Returns
    -------
    mass : float, kg
    inertia : float, kg*m**2
    mass_gradient, inertia_gradient : ndarray, shape (n_stations,)
        Per metre of chord.
    """
    edges = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))

    def carried(values):
        return np.concatenate((values[:1], values, values[-1:]))

    chord = carried(np.asarray(blade.chord))
    shape = carried(np.broadcast_to(np.asarray(section_area, dtype=float), blade.r.shape))
    inner, width = edges[:-1], np.diff(edges)
    share = 0.5 * (_POINTS + 1.0)[:, None]
    local_r = (inner + share * width) * np.cos(blade.cone)
    local_c = chord[:-1] + share * np.diff(chord)
    area = _WEIGHTS[:, None] * 0.5 * width * blade.blade_count * density
    area = area * (shape[:-1] + share * np.diff(shape))
    mass = np.sum(area * local_c**2)
    inertia = np.sum(area * local_c**2 * local_r**2) + hub_inertia

    def gradient(weight):
        inside = 2.0 * weight * local_c
        by_edge = np.zeros(edges.size, dtype=inside.dtype)
        by_edge[:-1] += np.sum(inside * (1.0 - share), axis=0)
        by_edge[1:] += np.sum(inside * share, axis=0)
        by_edge[1] += by_edge[0]
        by_edge[-2] += by_edge[-1]
        return by_edge[1:-1]

    return mass, inertia, gradient(area), gradient(area * local_r**2)


class InertiaComp(om.ExplicitComponent):
    """Mass and inertia of the rotor from its chord and radius; see `mass_and_inertia`.

    Inputs chord[n_stations] (m), rotor_radius (m), with which hub, stations and tip move: mass is
    proportional to it and the blades' inertia to its cube. Outputs mass (kg), inertia (kg*m**2).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare(
            "blade", desc="the start `Blade`: stations, hub, tip, count, cone", recordable=False
        )
        self.options.declare(
            "section_area", desc="outline area over chord squared, a number or one a station"
        )
        self.options.declare("density", types=float, desc="of the material, kg/m**3")
        self.options.declare("hub_inertia", types=float, desc="kg*m**2")

    def setup(self):
        """Declare inputs and outputs."""
        blade = self.options["blade"]
        self.add_input("chord", val=blade.chord, units="m", desc="chord at the stations")
        self.add_input(
            "rotor_radius", val=blade.rotor_radius, units="m", desc="radius of the swept disc"
        )
        self.add_output("mass", units="kg", desc="mass of the blades")
        self.add_output("inertia", units="kg*m**2", desc="inertia of the rotor about its axis")

    def setup_partials(self):
        """Declare the dense rows."""
        self.declare_partials(["mass", "inertia"], ["chord", "rotor_radius"])

    def _evaluate(self, inputs):
        """Return those of the start's radius with this chord, and the stretch of the radius."""
        options = self.options
        blade = replace(options["blade"], chord=inputs["chord"])
        found = mass_and_inertia(blade, options["section_area"], options["density"])
        return *found, inputs["rotor_radius"][0] / blade.rotor_radius

    def compute(self, inputs, outputs):
        """Integrate over the blade."""
        mass, inertia, _, _, stretch = self._evaluate(inputs)
        outputs["mass"] = mass * stretch
        outputs["inertia"] = inertia * stretch**3 + self.options["hub_inertia"]

    def compute_partials(self, inputs, partials):
        """Differentiate the integrals."""
        mass, inertia, mass_by, inertia_by, stretch = self._evaluate(inputs)
        radius = self.options["blade"].rotor_radius
        partials["mass", "chord"], partials["mass", "rotor_radius"] = (
            mass_by * stretch,
            mass / radius,
        )
        partials["inertia", "chord"] = inertia_by * stretch**3
        partials["inertia", "rotor_radius"] = 3.0 * inertia * stretch**2 / radius
