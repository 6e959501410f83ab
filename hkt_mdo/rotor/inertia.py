"""Mass and rotational inertia of solid blades (paper Sec. II-B)."""

import numpy as np
import openmdao.api as om

# Three points are exact for (linear chord)² r², a quartic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def mass_and_inertia(
    r, chord, hub_radius, tip_radius, blade_count, section_area, density, hub_inertia=0.0
):
    """Return the rotor's mass and inertia, and their gradients with respect to chord.

    A section is similar to the outline, its area section_area * chord²; chord runs linearly between
    stations and is carried unchanged inward to the hub and outward to the tip:
    m = B rho integral of A dr, I = B rho integral of A r² dr + hub inertia, both exact.

    Parameters
    ----------
    r, chord : array, shape (n_stations,), m
    hub_radius, tip_radius : float, m
    blade_count : int
    section_area : float
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
    edges = np.concatenate(([hub_radius], r, [tip_radius]))
    carried = np.concatenate((chord[:1], chord, chord[-1:]))
    inner, width = edges[:-1], np.diff(edges)
    c0, rise = carried[:-1], np.diff(carried)
    share = 0.5 * (_POINTS + 1.0)[:, None]
    local_r = inner + share * width
    local_c = c0 + share * rise
    area = _WEIGHTS[:, None] * 0.5 * width * blade_count * density * section_area
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
    """Mass and inertia of the rotor from its chord; see `mass_and_inertia`.

    Input chord[n_stations] (m); outputs mass (kg), inertia (kg*m**2).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare(
            "blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False
        )
        self.options.declare("section_area", types=float, desc="outline area over chord squared")
        self.options.declare("density", types=float, desc="of the material, kg/m**3")
        self.options.declare("hub_inertia", types=float, desc="kg*m**2")

    def setup(self):
        """Declare inputs and outputs."""
        self.add_input(
            "chord", val=self.options["blade"].chord, units="m", desc="chord at the stations"
        )
        self.add_output("mass", units="kg", desc="mass of the blades")
        self.add_output("inertia", units="kg*m**2", desc="inertia of the rotor about its axis")

    def setup_partials(self):
        """Declare the dense rows."""
        self.declare_partials(["mass", "inertia"], "chord")

    def _evaluate(self, inputs):
        options = self.options
        blade = options["blade"]
        return mass_and_inertia(
            blade.r,
            inputs["chord"],
            blade.hub_radius,
            blade.tip_radius,
            blade.blade_count,
            options["section_area"],
            options["density"],
            options["hub_inertia"],
        )

    def compute(self, inputs, outputs):
        """Integrate over the blade."""
        outputs["mass"], outputs["inertia"], _, _ = self._evaluate(inputs)

    def compute_partials(self, inputs, partials):
        """Differentiate the integrals."""
        _, _, partials["mass", "chord"], partials["inertia", "chord"] = self._evaluate(inputs)
