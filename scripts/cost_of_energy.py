"""Cost of energy of RM1's rotor: as an objective, and of a result; writes docs/cost.md's numbers.

python scripts/cost_of_energy.py    # prints, and writes them into the page; about a minute
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from pathlib import Path

import openmdao.api as om

from hkt_mdo import TurbineGroup, load_case

PAGE = Path(__file__).parents[1] / "docs" / "cost.md"
BEGIN, END = "<!-- numbers -->\n", "<!-- end of numbers -->"

DEVICES, ROTORS = 10, 2  # of RM1's plant; two rotors stand on one pile
RATED = 0.5  # MW of one rotor
HOURS = 8766.0 * 0.95  # of a year that the plant works; availability is an assumption
BLADE_PRICE = 14.6  # USD/kg of a finished blade, WISDEM's turbine_costsse_2015
CHARGE = 0.108  # fixed charge rate, a year
SOFT = 0.016 + 0.011 + 0.05 + 0.01 + 0.03  # commissioning, port, contingency, insurance, reserves
EXPORT = 1000.0  # m of cable to the shore, an assumption

# USD over the plant's capacity P in MW: NRWAL's curves through RM1's costs of the Reference Model
# Project for 1 to 100 devices. The structure has the blades in it: see `Cost`.
CAPITAL = {
    "structure and blades": "284245 * P + 785137",
    "power take-off": "1527017 * P + 505548",
    "pile": "437091 * P + 433518",
    "development": "3197591 * P**0.49",
    "engineering": "850744 * P**0.5649",
    "installation": "2805302 * P**0.66",
    "cables and substation": "(4.4 * P + 162.81) * EXPORT + 147966.16 * P + 665841",
}
YEARLY = {"operations": "31250 * P + 879282", "maintenance": "116803 * P + 317719"}

CASE = {
    "rotor": {"blade": "rm1", "material": "glass_epoxy_triaxial", "wall": 0.04},
    "fluid": {"density": 1025},
    "inflow": {"profile": "sine", "mean": 1.7, "amplitude": 0.5, "angular_frequency": 0.15},
    "control": {"law": "quadratic", "torque_limit": "415 kN*m"},
    "limits": {"stress": "60 MPa"},
    "design": {"chord_points": 5, "twist_points": 5},
    "phase": {"duration": 42, "segments": 28},
}


def evaluated(formulas, capacity):
    """Return the costs (USD) of a plant's capacity (MW)."""
    known = {"P": capacity, "EXPORT": EXPORT}
    return {name: eval(formula, {}, known) for name, formula in formulas.items()}


def cost_of_energy(mean_power, blade_mass, reference_mass, capacity=DEVICES * ROTORS * RATED):
    """Return the cost of energy (USD/kWh) and its parts (USD, USD a year, kWh a year).

    mean_power (W) and blade_mass (kg) are of one rotor; `reference_mass` is that of the blades whose
    price is in RM1's structure. A year's energy is put in here: mean_power times the hours.
    """
    capital = evaluated(CAPITAL, capacity)
    more = BLADE_PRICE * (blade_mass - reference_mass) * DEVICES * ROTORS
    capital["structure and blades"] += more
    yearly = evaluated(YEARLY, capacity)
    energy = mean_power / 1e3 * HOURS * DEVICES * ROTORS
    cost = CHARGE * (1.0 + SOFT) * sum(capital.values()) + sum(yearly.values())
    return cost / energy, capital, yearly, energy


def model(case, reference_mass=None):
    """Return a problem with the turbine and, given a reference mass, the cost as its objective."""
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("turbine", TurbineGroup(case, improve=False), promotes=["*"])
    if reference_mass is None:
        problem.model.add_objective("energy", ref=-1e7)
    else:
        fixed = sum(evaluated(CAPITAL, DEVICES * ROTORS * RATED).values())
        yearly = sum(evaluated(YEARLY, DEVICES * ROTORS * RATED).values())
        number = DEVICES * ROTORS
        capital = f"({fixed!r} + {BLADE_PRICE * number!r} * (mass - {reference_mass!r}))"
        cost = f"({CHARGE * (1 + SOFT)!r} * {capital} + {yearly!r})"
        seconds = CASE["phase"]["duration"]
        formula = f"cost_of_energy = {cost} / (energy / {seconds} * {HOURS * number!r})"
        units = {"mass": {"units": "kg"}, "energy": {"units": "kJ"}}
        problem.model.add_subsystem("cost", om.ExecComp(formula, **units), promotes=["*"])
        problem.model.add_objective("cost_of_energy", ref=0.1)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-8, maxiter=300, disp=False)
    problem.driver.declare_coloring(show_summary=False)
    problem.setup()
    problem.run_model()
    return problem


def row(name, problem, reference_mass):
    """Return a line of the page's table about a design."""
    power = problem.get_val("energy", units="J")[0] / CASE["phase"]["duration"]
    mass = problem.get_val("mass", units="kg")[0]
    cost, _, _, energy = cost_of_energy(power, mass, reference_mass)
    stress = problem.get_val("loads_phase.stress", units="MPa").max()
    parts = f"{power / 1e3:.1f} | {mass / 1e3:.2f} | {stress:.0f} | {energy / 1e6:.2f}"
    return f"| {name} | {parts} | {cost:.4f} |"


def main():
    """Optimize for energy and for cost, and write what comes out."""
    case = load_case(CASE)
    given = model(case)
    reference = float(given.get_val("mass", units="kg")[0])
    rows = [row("RM1's blade", given, reference)]
    for name, mass in (("most energy", None), ("least cost of energy", reference)):
        problem = model(case, mass)
        ended = problem.run_driver()
        rows.append(row(name if ended.success else f"{name} (NOT CONVERGED)", problem, reference))
    power = given.get_val("energy", units="J")[0] / CASE["phase"]["duration"]
    _, capital, yearly, _ = cost_of_energy(power, reference, reference)
    lines = ["| part | million USD |", "|---|---|"]
    lines += [f"| {name} | {value / 1e6:.2f} |" for name, value in capital.items()]
    lines += [f"| on top: {100 * SOFT:.1f} % | {SOFT * sum(capital.values()) / 1e6:.2f} |"]
    lines += [f"| {name}, a year | {value / 1e6:.2f} |" for name, value in yearly.items()]
    head = "design | mean power of a rotor / kW | its blades / t | stress / MPa | plant / GWh a year"
    lines += ["", f"| {head} | cost of energy / USD/kWh |", "|---|---|---|---|---|---|", *rows, ""]
    text = "\n".join(lines)
    print(text)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page.split(BEGIN)[0] + BEGIN + text + END + page.split(END)[1], "utf-8")


if __name__ == "__main__":
    main()
