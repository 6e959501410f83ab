"""The verification study: can results be trusted, from any start, under change, against physics.

Each part runs cases and returns its figures as Markdown; `hkt verify` keeps them in the study's
folder and makes the report. Runs that the folder already holds are reused, so an interrupted study
goes on. Goals are stated beside the figures; nothing here makes a run succeed.
"""

import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from hkt_mdo.case import Case, load_case
from hkt_mdo.dynamics.simulation import simulate
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.shipped import data_path, shipped_names
from hkt_mdo.problem.build import physics
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.run.batch import run_batch
from hkt_mdo.studies.uncertainty import Design

OPTIMIZERS = ("IPOPT", "SLSQP")
CODESIGN = tuple(
    f"{flow}_{law}"
    for flow in ("step", "sine", "sine_limited")
    for law in ("oloc", "linear", "quadratic")
)
LAWS = {"open_loop": "oloc", "linear": "linear", "quadratic": "quadratic"}
POLARS = tuple(f"naca63815_Re{re}" for re in ("1e5", "2e5", "3e5", "5e5", "1e6", "2e6"))
PEAK_TORQUE_COEFFICIENT = 0.065  # of a good rotor: Cp 0.47 at a tip speed ratio of 7.2
FALSE_SUCCESS = 5e-4  # of the best energy of a case: a success further below it is false

Done = Callable[[Path, str], None]


# Cases --------------------------------------------------------------------------------------------


def random_start(case: Case, rng: np.random.Generator) -> Case:
    """Return a case that starts from a random smooth blade: chord × 0.6 to 1.6, twist ± 6°."""
    blade = physics(case).blade
    knots, place = [0.0, 0.5, 1.0], blade.r / blade.tip_radius
    factor = np.exp(PchipInterpolator(knots, rng.uniform(np.log(0.6), np.log(1.6), 3))(place))
    offset = PchipInterpolator(knots, rng.uniform(-6.0, 6.0, 3))(place)
    chord = np.clip(blade.chord * factor, *case.design.chord_bounds)
    twist = np.clip(np.rad2deg(blade.twist) + offset, *case.design.twist_bounds)
    rotor = case.rotor.model_copy(update={"chord": tuple(chord), "twist": tuple(twist)})
    return case.model_copy(update={"rotor": rotor})


def single_changes() -> dict[str, list[str]]:
    """Return the overrides of the sweep that change one factor of a paper's case, by name."""
    changes = {
        f"limit_{limit}": [f"control.torque_limit={limit}"] for limit in (300, 500, 1000, 1500)
    }
    changes |= {f"mean_{mean}": [f"inflow.mean={mean}"] for mean in (0.8, 1.2, 2.0, 3.0)}
    for frequency, segments in ((0.05, 60), (0.1, 60), (0.5, 60), (1.0, 80), (2.0, 160)):
        changes[f"frequency_{frequency}"] = [
            f"inflow.angular_frequency={frequency}", f"phase.segments={segments}",
        ]  # fmt: skip
    changes |= {f"blades_{n}": [f"rotor.blade_count={n}"] for n in (4, 5)}
    changes |= {
        f"radius_{radius}": [
            f"rotor.radius={radius}", f"control.torque_limit={700 * (radius / 1.4) ** 3:.6g}",
        ]
        for radius in (0.4, 0.8, 3.0, 5.0, 10.0)
    }  # fmt: skip
    changes |= {f"density_{rho}": [f"fluid.density={rho}"] for rho in (998, 1027)}
    changes |= {f"segments_{n}": [f"phase.segments={n}"] for n in (20, 150, 300)}
    for duration, segments in ((10, 20), (300, 100), (1200, 300)):
        changes[f"duration_{duration}"] = [
            f"phase.duration={duration}", f"phase.segments={segments}",
            f"inflow.angular_frequency={min(0.25, 0.25 * 600 / duration)}",
        ]  # fmt: skip
    return changes | {polar: [f"rotor.polar={polar}"] for polar in POLARS}


def random_change(rng: np.random.Generator, law: str) -> list[str]:
    """Return overrides that change everything at once, within the range of the sweep.

    The torque limit is 0.4 to 1.5 times what a good rotor would ask for without one.
    """
    mean, radius = rng.uniform(0.8, 3.0), np.exp(rng.uniform(np.log(0.4), np.log(10.0)))
    amplitude, density = mean * rng.uniform(0.02, 0.25), rng.uniform(998.0, 1027.0)
    frequency = np.exp(rng.uniform(np.log(0.05), np.log(2.0)))
    longest = min(1200.0, 300 / 8 * 2.0 * np.pi / frequency)
    duration = np.exp(rng.uniform(np.log(10.0), np.log(longest)))
    periods = duration * frequency / (2.0 * np.pi)
    segments = int(np.clip(np.ceil(periods * rng.uniform(8.0, 24.0)), 10, 300))
    torque = (
        0.5 * np.pi * density * radius**3 * (mean + amplitude) ** 2 * PEAK_TORQUE_COEFFICIENT
    ) * rng.uniform(0.4, 1.5)
    values = {
        "control": f"{{law: {law}, torque_limit: {torque:.6g}}}",
        "inflow.mean": f"{mean:.6g}",
        "inflow.amplitude": f"{amplitude:.6g}",
        "inflow.angular_frequency": f"{frequency:.6g}",
        "inflow.phase": f"{rng.uniform(0.0, 2.0 * np.pi):.6g}",
        "rotor.radius": f"{radius:.6g}",
        "rotor.blade_count": f"{rng.integers(3, 6)}",
        "rotor.polar": str(rng.choice(POLARS)),
        "fluid.density": f"{density:.6g}",
        "phase.duration": f"{duration:.6g}",
        "phase.segments": f"{segments}",
    }
    return [f"{key}={value}" for key, value in values.items()]


# Parts --------------------------------------------------------------------------------------------


def starts(
    out: Path, cases: Path, count: int, seed: int, jobs: int | None, done: Done, method: str
) -> list[str]:
    """Run the co-design cases from random blades; see `random_start`.

    Parameters
    ----------
    out, cases : Path
        Folder of the study; folder of the case files.
    count, seed : int
        Starts a case and optimizer; seed of the random numbers.
    jobs : int or None
        Number of processes.
    done : callable
        As in `run_batch`.
    method : {"quasi_steady", "blade"}
        The case's start.method: the program's own start, or the blade as given.

    Returns
    -------
    list of str
        Markdown.
    """
    runs = {}
    for name in CODESIGN:
        for i in range(count):
            for optimizer in OPTIMIZERS:
                case = load_case(
                    cases / f"{name}.yaml",
                    [f"driver.optimizer={optimizer}", f"start.method={method}"],
                )
                rng = np.random.default_rng([seed, CODESIGN.index(name), i])
                runs[out / method / optimizer / name / f"{i:03d}"] = random_start(case, rng)
    found = run_batch(runs, jobs, done, records=False)
    best = _keep_best(out, {folder: folder.parent.name for folder in runs}, found)
    rows = [
        "| case | optimizer | success | spread of energy (%) | furthest below best (%) "
        "| iterations, median (largest) | false successes |",
        "|---|---|---|---|---|---|---|",
    ]
    failures, totals = [], {optimizer: np.zeros(3, int) for optimizer in OPTIMIZERS}
    for name in CODESIGN:
        for optimizer in OPTIMIZERS:
            group = {
                folder: solution
                for folder, solution in found.items()
                if folder.parent == out / method / optimizer / name
            }
            good = [solution for solution in group.values() if solution and solution.success]
            energy = np.array([solution.summary["simulated_energy_J"] for solution in good])
            iterations = [solution.summary["iterations"] for solution in good]
            false = int(np.sum(energy < best[name] * (1.0 - FALSE_SUCCESS)))
            totals[optimizer] = [
                a + b
                for a, b in zip(totals[optimizer], (len(good), len(group), false), strict=True)
            ]
            failures += _failures(group, out)
            figures = ("-", "-", "-")
            if good:
                figures = (
                    f"{100.0 * np.ptp(energy) / best[name]:.5f}",
                    f"{100.0 * (1.0 - np.min(energy) / best[name]):.5f}",
                    f"{np.median(iterations):.0f} ({max(iterations)})",
                )
            rows.append(
                f"| {name} | {optimizer} | {len(good)}/{len(group)} | {' | '.join(figures)} "
                f"| {false} |"
            )
    for optimizer, (good, total, false) in totals.items():
        rows.append(
            f"| **all** | {optimizer} | **{good}/{total}, {100.0 * good / total:.1f} %** | | | "
            f"| **{false}** |"
        )
    return [*rows, "", *failures]


def sweep(out: Path, cases: Path, count: int, seed: int, jobs: int | None, done: Done) -> list[str]:
    """Run changed cases with both optimizers: one factor at a time, then `count` random mixtures.

    Parameters and result are those of `starts`.
    """
    problems = {
        f"{change}_{LAWS[law]}": (f"sine_limited_{LAWS[law]}", overrides)
        for change, overrides in single_changes().items()
        for law in LAWS
    }
    for i in range(count):
        law = tuple(LAWS)[i % len(LAWS)]
        overrides = random_change(np.random.default_rng([seed, i]), law)
        problems[f"random{i:03d}_{LAWS[law]}"] = "sine_oloc", overrides
    runs = {
        out / "sweep" / optimizer / name: load_case(
            cases / f"{base}.yaml", [*overrides, f"driver.optimizer={optimizer}", f"name={name}"]
        )
        for name, (base, overrides) in problems.items()
        for optimizer in OPTIMIZERS
    }
    found = run_batch(runs, jobs, done, records=False)
    best = _keep_best(out, {folder: f"sweep {folder.name}" for folder in runs}, found)
    rows = [
        "| change | "
        + " | ".join(f"success, {o}" for o in OPTIMIZERS)
        + " | furthest below best (%) "
        "| false successes |",
        "|---|---|---|---|---|",
    ]
    groups = dict.fromkeys(name.partition("_")[0].rstrip("0123456789") for name in problems)
    totals = Counter()
    for group in groups:
        members = [name for name in problems if name.startswith(group)]
        cells, below = [], []
        for optimizer in OPTIMIZERS:
            solutions = {name: found[out / "sweep" / optimizer / name] for name in members}
            good = {name: s for name, s in solutions.items() if s and s.success}
            below += [
                1.0 - s.summary["simulated_energy_J"] / best[f"sweep {name}"]
                for name, s in good.items()
            ]
            cells.append(f"{len(good)}/{len(members)}")
            totals[optimizer] += len(good)
        false = sum(value > FALSE_SUCCESS for value in below)
        totals["false"] += false
        worst = f"{100.0 * max(below):.5f}" if below else "-"
        rows.append(f"| {group} | {' | '.join(cells)} | {worst} | {false} |")
    cells = [
        f"**{totals[o]}/{len(problems)}, {100.0 * totals[o] / len(problems):.1f} %**"
        for o in OPTIMIZERS
    ]
    rows.append(f"| **all** | {' | '.join(cells)} | | **{totals['false']}** |")
    return [*rows, "", *_failures(found, out)]


def against_physics(
    out: Path, cases: Path, count: int, seed: int, jobs: int | None, done: Done
) -> list[str]:
    """Hold optima to physics: stationarity, energy balance, refinement, another transcription.

    Parameters and result are those of `starts`; `count` and `seed` are of no use here.
    """
    variants = {
        "shipped": [],
        "segments_x2": ["phase.segments=120"],
        "segments_x4": ["phase.segments=240"],
        "radau": ["phase.transcription=radau"],
    }

    def overrides(name, variant):
        # Dymos' Radau does not collocate a segment's right end: under feedback it needs segments
        # of no more than about two time constants (docs/theory.md)
        short = variant == "radau" and not name.endswith("oloc")
        return [*variants[variant], *(["phase.segments=1200"] if short else [])]

    runs = {
        out / "physics" / variant / name: load_case(
            cases / f"{name}.yaml", overrides(name, variant)
        )
        for name in CODESIGN
        for variant in variants
    }
    found = run_batch(runs, jobs, done, records=False)
    for name in CODESIGN:  # the open loop answers a changed blade by a control of its own
        if name.endswith("oloc"):
            perturbed = {
                out / "physics" / "perturbed" / name / key: _fixed(found, out, name, chord, twist)
                for key, chord, twist, _ in _perturbations(Design.of(found[_shipped(out, name)]))
            }
            found |= run_batch(perturbed, jobs, done, records=False)
    rows = [
        "| case | largest rise when perturbed | energy balance | segments ×2 (%) | segments ×4 (%) "
        "| finer integration | Radau (%) |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in CODESIGN:
        solution = found[_shipped(out, name)]
        energy = solution.summary["simulated_energy_J"]

        def change(variant, name=name, energy=energy):
            other = found[out / "physics" / variant / name]
            if other is None or not other.success:
                return "refused"
            return f"{100.0 * (other.summary['simulated_energy_J'] / energy - 1.0):+.5f}"

        design = Design.of(solution)
        if design.law is None:
            folder = out / "physics" / "perturbed" / name
            risen = {
                path.name: other.summary["simulated_energy_J"] / energy - 1.0
                for path, other in found.items()
                if path.parent == folder and other is not None and other.success
            }
        else:
            reference = _fly(design, *_design_point(design)).energy
            risen = {
                key: _fly(design, chord, twist, gains).energy / reference - 1.0
                for key, chord, twist, gains in _perturbations(design)
            }
        worst = max(risen, key=risen.get)
        coarse = _fly(design, *_design_point(design)).energy
        fine = _fly(design, *_design_point(design), tolerance=1e-11, refined=4).energy
        rows.append(
            f"| {name} | {risen[worst]:+.1e} ({worst}, of {len(risen)}) "
            f"| {solution.summary['energy_balance_error']:.1e} | {change('segments_x2')} "
            f"| {change('segments_x4')} | {abs(fine / coarse - 1.0):.1e} | {change('radau')} |"
        )
    return [*rows, "", *_failures(found, out)]


def _shipped(out, name):
    return out / "physics" / "shipped" / name


def _design_point(design):
    return design.plant.blade.chord, design.plant.blade.twist, design.gains


def _perturbations(design):
    """Yield (name, chord, twist, gains) for each design variable a little up and down."""
    chord, twist, gains = _design_point(design)
    limits = design.solution.case.design
    for sign in (1.0, -1.0):
        for i in range(chord.size):
            step = np.arange(chord.size) == i
            changed = chord * (1.0 + 0.01 * sign * step)
            if limits.chord_bounds[0] <= changed[i] <= limits.chord_bounds[1]:
                yield f"chord{sign:+.0f}_{i}", changed, twist, gains
            changed = twist + np.deg2rad(0.1) * sign * step
            if limits.twist_bounds[0] <= np.rad2deg(changed[i]) <= limits.twist_bounds[1]:
                yield f"twist{sign:+.0f}_{i}", chord, changed, gains
        for i in range(gains.size):
            step = np.arange(gains.size) == i
            yield f"gain{sign:+.0f}_{i}", chord, twist, gains * (1.0 + 0.01 * sign * step)


def _fixed(found, out, name, chord, twist):
    """Return a shipped case with the blade fixed at a given shape."""
    case = found[_shipped(out, name)].case
    changed = {
        "rotor": {"chord": tuple(chord), "twist": tuple(np.rad2deg(twist))},
        "design": {"blade": "fixed"},
    }
    return case.model_copy(
        update={
            key: getattr(case, key).model_copy(update=values) for key, values in changed.items()
        }
    )


def _fly(design, chord, twist, gains, tolerance=1e-9, refined=1):
    """Integrate a design with a given blade and gains, from its equilibrium if it has feedback."""
    case, plant = design.solution.case, design.plant
    blade = plant.blade.with_shape(chord, twist)
    inertia = [mass_and_inertia(each, 1.0, 1.0)[1] for each in (blade, plant.blade)]
    solid = plant.inertia - case.rotor.hub_inertia
    plant = replace(
        plant, blade=blade, inertia=case.rotor.hub_inertia + solid * inertia[0] / inertia[1]
    )
    speed = design.initial_speed(design.inflow)
    controller = design.recorded_torque if design.law is None else None
    if controller is None:
        flow = np.array([design.inflow.speed(0.0)])

        def controller(_, speed):
            return design.law.torque(speed, gains)

        def excess(w):
            return float(plant.torque(np.array([w]), flow)[0] - controller(0.0, w))

        speed = brentq(excess, 0.95 * speed, 1.05 * speed, xtol=1e-12)
    return simulate(
        plant,
        design.inflow,
        controller,
        speed,
        case.phase.duration,
        samples=2,
        max_step=case.phase.duration / case.phase.segments / refined,
        tolerance=tolerance,
    )


DATA = {
    "polar": PolarFamily.from_file,
    "outline": Outline.from_file,
    "blade": read_blade,
}


def fuzz(out: Path, cases: Path, count: int, seed: int, jobs: int | None, done: Done) -> list[str]:
    """Read mutilated case and data files: each is accepted, or refused in one line in a second.

    Parameters and result are those of `starts`; `count` is the number of examples that Hypothesis
    makes for each kind of file.
    """
    files = {"case": [path.read_bytes() for path in sorted(cases.glob("*.yaml"))]}
    files["case"] += [load_case(path).to_yaml().encode() for path in sorted(cases.glob("*.yaml"))]
    files |= {
        kind: [data_path(name, kind).read_bytes() for name in shipped_names(kind)] for kind in DATA
    }
    folder = out / "fuzz"
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        "| file | examples | accepted | refused in one line | anything else | slowest (ms) |",
        "|---|---|---|---|---|---|",
    ]
    broken = []
    for kind, originals in files.items():
        path = folder / ("case.yaml" if kind == "case" else f"{kind}.csv")
        words, slowest, errors = _fuzz_one(kind, originals, path, count, seed)
        done(path, f"{count} examples")
        broken += [f"- {kind}: {error}" for error in errors[:5]]
        other = sum(words.values()) - words["accepted"] - words["refused"]
        rows.append(
            f"| {kind} | {sum(words.values())} | {words['accepted']} | {words['refused']} "
            f"| {other} | {1e3 * slowest:.0f} |"
        )
    return [*rows, "", *broken]


def _fuzz_one(kind, originals, path, count, seed):
    """Return how often a reader said what, its longest time (s) and the errors it let through."""
    try:
        import hypothesis
    except ImportError as error:
        raise InputError("hypothesis is not installed", "pip install hypothesis") from error
    words, times, errors = Counter(), [], []

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=count,
        database=None,
        deadline=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(mutilated(originals))
    def read(content):
        path.write_bytes(content)
        began = time.perf_counter()
        try:
            physics(load_case(path)) if kind == "case" else DATA[kind](path)
            word = "accepted"
        except InputError as error:
            word = "refused" if str(error).isprintable() else "unprintable"
        except Exception as error:
            word = type(error).__name__
            errors.append(f"{word}: {str(error)[:200]} in `{content[:200]!r}`")
        times.append(time.perf_counter() - began)
        words[word] += 1

    read()
    return words, max(times), errors


def mutilated(originals: list[bytes]):
    """Return Hypothesis' strategy of files with a few bytes, lines or numbers made worse."""
    from hypothesis import strategies as st

    junk = st.one_of(
        st.binary(max_size=8),
        st.text(max_size=8).map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.floats().map(lambda number: repr(number).encode()),
        st.sampled_from(
            [b"nan", b"1e999", b"-0", b"{", b"]", b"&a", b"*a", b"!!python/name:os", b"\x00", b"\n",
             b"\r", b",", b":", b"#", b"1 m/s", b"1e-320 m", b"null", b"[]", b"9" * 400]
        ),
    )  # fmt: skip
    edit = st.tuples(st.integers(0, 10**6), st.integers(0, 30), junk)

    def apply(original, edits):
        content = original
        for place, length, insertion in edits:
            place %= len(content) + 1
            content = content[:place] + insertion + content[place + length :]
        return content

    edited = st.builds(apply, st.sampled_from(originals), st.lists(edit, min_size=1, max_size=6))
    return edited | st.binary(max_size=200)


# The study ----------------------------------------------------------------------------------------


def _keep_best(out, names, found):
    """Return the best energy of any success, by name, over this study and what it was before."""
    path = out / "best.json"
    best = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for folder, solution in found.items():
        if solution is not None and solution.success:
            name = names[folder]
            best[name] = max(best.get(name, 0.0), solution.summary["simulated_energy_J"])
    _replace(path, json.dumps(best, indent=1) + "\n")
    return best


def _failures(found, out):
    """Return a line for each run that did not succeed, with its reason."""
    return [
        f"- `{folder.relative_to(out)}`: {solution.message if solution else 'could not be run'}"
        for folder, solution in found.items()
        if solution is None or not solution.success
    ]


def _replace(path, text):
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


PARTS = {
    "starts": (
        "From random blades",
        partial(starts, method="quasi_steady"),
        30,
        "Each co-design case from random smooth starting blades (chord × 0.6 to × 1.6, twist "
        "± 6°). Goal: 99 % success with IPOPT, 95 % with SLSQP, spread at most 0.02 %, no false "
        "success: none more than 0.05 % below the best energy of its case. The start tries steady-"
        "optimal blades beside the random one and mostly prefers those; the next part does not.",
    ),
    "blades": (
        "From random blades, without the quasi-steady start",
        partial(starts, method="blade"),
        30,
        "The same blades with `start.method: blade`: the dynamic optimization begins at the random "
        "blade itself. No goal; it shows what the quasi-steady start is worth.",
    ),
    "sweep": (
        "Under change",
        sweep,
        30,
        "One factor at a time from the torque-limited cases, each under the three laws, then "
        "random mixtures. Goal: 95 % success.",
    ),
    "physics": (
        "Against physics",
        against_physics,
        1,
        "Each design variable a little off (chord ± 1 %, twist ± 0.1°, gain ± 1 %) and integrated "
        "again with direct BEM; the open loop re-solves its control. Goals: no rise above 1e-5; "
        "energy balance 1e-6; segments × 2 and × 4 within 0.02 %; finer integration 1e-6; Radau "
        "within 0.02 %, under feedback with 1200 segments (docs/theory.md tells why).",
    ),
    "fuzz": (
        "Hostile input",
        fuzz,
        1500,
        "Mutilated case and data files, made by Hypothesis. Goal: accepted, or refused in one line "
        "(exit code 2) within a second.",
    ),
}
"""Title, function, default count and explanation of each part, in the order of the report."""


def run_part(
    part: str, out: Path, cases: Path, count: int | None, seed: int, jobs: int | None, done: Done
) -> str:
    """Run a part of the study and return its figures, which `out` keeps for the report.

    Raises
    ------
    InputError
        If there is no such part, or a file cannot be read or written.
    """
    if part not in PARTS:
        raise InputError("unknown part", f"choose from {', '.join(PARTS)}", value=part)
    title, function, usual, explanation = PARTS[part]
    count = count or usual
    try:
        out.mkdir(parents=True, exist_ok=True)
        figures = "\n".join(function(out, cases, count, seed, jobs, done)).rstrip()
        command = f"`hkt verify {part} --count {count} --seed {seed}`"
        text = f"## {title}\n\n{explanation}\n\n{command}\n\n{figures}\n"
        _replace(out / f"{part}.md", text)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from error
    return text


def report(out: Path) -> str:
    """Return the report of all parts that a study's folder holds figures of."""
    from importlib.metadata import version

    parts = [
        path.read_text(encoding="utf-8")
        for name in (*PARTS, "kills")
        if (path := out / f"{name}.md").exists()
    ]
    head = (
        "# Verification\n\nGenerated by `hkt verify --report docs/verification.md` with version "
        f"{version('hkt_mdo')}; each section names its command. Nothing here is edited by hand.\n"
    )
    return "\n".join([head, *parts])
