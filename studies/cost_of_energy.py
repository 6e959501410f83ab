"""Cost of energy of RM1's plant, of its blade and as an objective; for docs/studies/cost.md.

python studies/cost_of_energy.py    # seconds
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import openmdao.api as om
import page_data

from hkt_mdo import RotorGroup, load_case

BEGIN, END = "<!-- numbers -->\n", "<!-- end of numbers -->"
SAYING = "## What the numbers say\n"
OWN = "RM1's blade"
RATED = "RM1's blade, rated power for the least cost"
MOST, LEAST = "blade for the most energy", "blade for the least cost"
BOTH = "blade and rated power for the least cost"

NUMBER = 10 * 2  # rotors of the plant: ten devices of two
AVAILABILITY, EFFICIENCY = 0.95, 0.9  # of the plant, and from the shaft to the grid: assumptions
BLADE_PRICE = 14.6  # USD/kg of a finished blade
CHARGE = 0.108  # fixed charge rate, a year
SOFT = 0.016 + 0.011 + 0.05 + 0.01 + 0.03  # commissioning, port, contingency, insurance, reserves
CABLE = 1000.0  # m to the shore, an assumption

# USD and USD a year: of N MW of RM1's devices, and of the rated power of P MW in all
NOMINAL = 0.55  # MW of one rotor of RM1, by which the curves count devices
CAPITAL = {
    "structure, with RM1's blades": "284245 * N + 785137",
    "power take-off": "1527017 * P + 505548",
    "pile": "437091 * N + 433518",
    "development": "3197591 * N**0.49",
    "engineering": "850744 * N**0.5649",
    "assembly and installation": "2805302 * N**0.66",
    "export cable": f"{CABLE} * (4.4 * P + 162.81)",
    "substation and other electrical": "147966.16 * P + 665841",
}
YEARLY = {"operations": "31250 * N + 879282", "maintenance": "116803 * N + 317719"}

# a year of the flow: speeds in m/s and hours, an assumption
FLOW = [0.6, 1.0, 1.4, 1.8, 2.2, 2.6]
HOURS = [2000.0, 2200.0, 2100.0, 1500.0, 750.0, 216.0]

CASE = {
    "rotor": {"blade": "rm1", "material": "glass_epoxy_triaxial", "wall": 0.04},
    "fluid": {"density": 1025},
    "inflow": {"profile": "constant", "speed": 1.8},
    "control": "open_loop",
    "design": {"chord_points": 5, "twist_points": 5},
}


def parts(formulas, rated):
    """Return the costs of a plant by name; `rated` is the rated power of one rotor in MW."""
    variables = {"P": NUMBER * rated, "N": NUMBER * NOMINAL}
    return {name: eval(text, variables) for name, text in formulas.items()}


def cost_of_energy(annual_energy, blade_mass, rated, reference_mass):
    """Return the cost of energy in USD/kWh.

    The year's energy of one rotor goes in here, kWh: of a case it is the mean electrical power
    times the hours of a year in which the plant works. blade_mass (kg) is that of one rotor, as
    `reference_mass`, that of the blades whose price is in RM1's structure; rated (MW) of one rotor.
    """
    capital = sum(parts(CAPITAL, rated).values())
    capital += NUMBER * BLADE_PRICE * (blade_mass - reference_mass)
    yearly = CHARGE * (1.0 + SOFT) * capital + sum(parts(YEARLY, rated).values())
    return yearly / (NUMBER * annual_energy)


def cost_model(reference_mass):
    """Return a group: energy of a year (kWh) of a rotor, and cost of energy in USD/kWh."""

    def written(formulas):
        text = " + ".join(formulas.values()).replace("P", f"({NUMBER} * rated)")
        return text.replace("N", f"{NUMBER * NOMINAL}")

    capital, yearly = written(CAPITAL), written(YEARLY)
    blades = f"{NUMBER * BLADE_PRICE} * (mass - {reference_mass!r})"
    # no more than the rated power, with a round corner 4 kW wide
    power = f"{EFFICIENCY} * hydrodynamic_power / 1e3"
    limited = f"0.5 * ({power} + 1e3 * rated - (({power} - 1e3 * rated)**2 + 16)**0.5)"
    names = {
        "energy": om.ExecComp(
            f"annual_energy = {AVAILABILITY} * sum(hours * {limited})",
            hours={"val": HOURS},
            hydrodynamic_power={"shape": len(FLOW), "units": "W"},
            rated={"val": NOMINAL},
        ),
        "cost": om.ExecComp(
            f"cost_of_energy = ({CHARGE * (1 + SOFT)} * ({capital} + {blades}) + {yearly})"
            f" / ({NUMBER} * annual_energy)",
            mass={"units": "kg"},
            rated={"val": NOMINAL},
        ),
    }
    group = om.Group()
    for name, part in names.items():
        group.add_subsystem(name, part, promotes=["*"])
    return group


def designed(objective, reference_mass, ref, free=()):
    """Return the optimum of an objective; `free` are design variables besides the operation."""
    problem = om.Problem(reports=False)
    model = problem.model
    rotor = RotorGroup(load_case(CASE), num_points=len(FLOW))
    model.add_subsystem("rotor", rotor, promotes=["*"])
    model.add_subsystem("plant", cost_model(reference_mass), promotes=["*"])
    model.set_input_defaults("inflow_speed", FLOW, units="m/s")
    model.set_input_defaults("rated", NOMINAL)
    bounds = {
        "tip_speed_ratio": {"lower": 3, "upper": 10, "ref": 6},
        "chord_control": {"lower": 0.3, "upper": 3.0},
        "twist_control": {"lower": -10, "upper": 35, "ref": 10, "units": "deg"},
        "rated": {"lower": 0.1, "upper": 1.5, "ref": 0.5},
    }
    for name in ("tip_speed_ratio", *free):
        model.add_design_var(name, **bounds[name])
    if "chord_control" in free:
        model.add_constraint("stress", upper=100, ref=100, units="MPa")
    model.add_objective(objective, ref=ref)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-8, maxiter=300, disp=False)
    problem.setup()
    problem.run_model()
    assert problem.run_driver().success, objective
    return problem


def shown(problem):
    """Return what the page shows of a design."""
    names = ("rated", "annual_energy", "mass", "cost_of_energy")
    values = {name: float(problem.get_val(name)[0]) for name in names}
    return values | {"stress": float(problem.get_val("stress").max())}


def row(name, rated, annual_energy, mass, cost_of_energy, stress):
    """Return a line of the page's table about a design."""
    share = annual_energy / (1e3 * rated * 8766.0)
    cells = f"{1e3 * rated:.0f} | {annual_energy / 1e6:.3f} | {100 * share:.0f} | {mass / 1e3:.2f}"
    return f"| {name} | {cells} | {stress / 1e6:.0f} | {cost_of_energy:.4f} |"


def found():
    """Return what the page shows of each design; seconds."""
    blade = "chord_control", "twist_control"
    kept = designed("annual_energy", 0.0, -1e6)
    mass = float(kept.get_val("mass")[0])
    kept = designed("annual_energy", mass, -1e6)
    cost = cost_of_energy(float(kept.get_val("annual_energy")[0]), mass, NOMINAL, mass)
    assert abs(cost / kept.get_val("cost_of_energy")[0] - 1.0) < 1e-12  # the model, the function
    designs = {
        OWN: kept,
        RATED: designed("cost_of_energy", mass, 0.1, ("rated",)),
        MOST: designed("annual_energy", mass, -1e6, blade),
        LEAST: designed("cost_of_energy", mass, 0.1, blade),
        BOTH: designed("cost_of_energy", mass, 0.1, (*blade, "rated")),
    }
    return {name: shown(problem) for name, problem in designs.items()}


def from_data(data):
    """Return the page with the tables, and what they say, of the designs of its data."""
    designs, capital = data["designs"], parts(CAPITAL, NOMINAL)
    lines = [f"| part of the plant of {NUMBER * NOMINAL:g} MW | million USD |", "|---|---|"]
    lines += [f"| {name} | {value / 1e6:.2f} |" for name, value in capital.items()]
    lines += [f"| on top, {100 * SOFT:.1f} % | {SOFT * sum(capital.values()) / 1e6:.2f} |"]
    yearly = parts(YEARLY, NOMINAL).items()
    lines += [f"| {name}, a year | {value / 1e6:.2f} |" for name, value in yearly]
    head = "design | rated power of a rotor / kW | its energy / GWh a year | capacity factor / %"
    head += " | its blades / t | stress / MPa | cost of energy / USD/kWh"
    lines += ["", f"| {head} |", "|" + "---|" * 7]
    lines += [row(name, **each) for name, each in designs.items()]
    page = page_data.between(page_data.text_of("cost"), BEGIN, END, "\n".join(lines) + "\n")
    return page.split(SAYING)[0] + SAYING + said(designs, sum(capital.values()))


def said(designs, capital):
    """Return what the numbers say."""
    cost = {name: each["cost_of_energy"] for name, each in designs.items()}
    lower = {name: 100.0 * (1.0 - each / cost[OWN]) for name, each in cost.items()}
    lighter = designs[MOST]["mass"] - designs[LEAST]["mass"]
    blades = NUMBER * BLADE_PRICE * designs[LEAST]["mass"]
    text = f"""
- **Rated power affects the cost of energy more than blade shape.** A generator of
  {designs[RATED]["rated"]:.2f} MW in place of {NOMINAL} MW lowers the cost of energy by
  {lower[RATED]:.1f} % with RM1's blade; the best blade alone, by {lower[LEAST]:.1f} %; both
  together, by {lower[BOTH]:.1f} %.
- **The mass of the blades affects it little.** The blade for the least cost weighs
  {100 * lighter / designs[MOST]["mass"]:.0f} % less than the blade for the most energy, and its
  energy costs {100 * (1 - cost[LEAST] / cost[MOST]):.2f} % less: twenty sets of blades cost
  {blades / 1e6:.1f} million USD, the plant {(1 + SOFT) * capital / 1e6:.0f} million.
- **What is missing.** In this model structure, pile and installation do not depend on the thrust,
  and the hours of the flow are assumed. RM1's own blade has a stress of
  {designs[OWN]["stress"] / 1e6:.0f} MPa with the wall that was assumed, so the designed blades must
  keep a lower stress than it has.
"""
    return text.replace("\n  ", " ")  # one line a bullet


if __name__ == "__main__":
    page_data.page_from("cost", from_data, designs=found())
