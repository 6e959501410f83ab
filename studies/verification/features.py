"""The part of the verification study on flows with features that a coarse mesh would not see."""

import numpy as np

from studies.study_common import LAWS, case_file, markdown_table

SEGMENTS, DURATION = 30, 30.0  # s: segments of a second
WRONG = 2e-4  # relative difference of energies above which a success is false


def features(study) -> list[str]:
    """Design for flows with a gust, a lull or a step at a random place, of a random width.

    Widths are from a hundredth of a segment to ten segments; laws and torque limits are random. A
    success is false if its energies, collocated or integrated, differ by more than 2e-4 from an
    integration in steps of a two-hundredth of a segment, which samples the flow sixteen times a
    step. Goal: no false success, 99 % success.
    """
    plan, widths = {}, {}
    for i in range(study.count):
        rng = np.random.default_rng([study.seed, i])
        law = LAWS[i % len(LAWS)]
        width = widths[f"features/{i:03d}_{law}"] = float(
            np.exp(rng.uniform(*np.log((0.01, 10.0))))
        )
        overrides = [f"inflow={_flow(rng, width)}", f"phase.segments={SEGMENTS}"]
        overrides += [f"phase.duration={DURATION}", f"name=features{i:03d}"]
        overrides += [f"control.torque_limit={rng.uniform(400.0, 1200.0):.6g}"]
        plan[f"features/{i:03d}_{law}"] = case_file(None, f"sine_limited_{law}", overrides)
    solutions = study.run(plan)
    rows, wrong = [], []
    groups = ("below 0.1", 0.0, 0.1), ("0.1 to 1", 0.1, 1.0), ("1 to 10", 1.0, np.inf)
    for title, low, high in groups:
        runs = [run for run in plan if low <= widths[run] < high]
        good = [run for run in runs if solutions[run] and solutions[run].success]
        errors = {run: _error(solutions[run], widths[run]) for run in good}
        wrong += [
            f"- `{run}`: off by {error:.1e}" for run, error in errors.items() if error > WRONG
        ]
        false = sum(error > WRONG for error in errors.values())
        worst = f"{max(errors.values(), default=0.0):.1e}"
        segments = [len(solutions[run].trajectory["time_s"]) // 3 for run in good]
        most = f"{np.median(segments):.0f} ({max(segments)})" if segments else "-"
        rows.append([title, f"{len(good)}/{len(runs)}", worst, most, str(false)])
    header = (
        "width over a segment", "success", "largest error", "segments, median (largest)",
        "false successes",
    )  # fmt: skip
    refused = [
        f"- `{run}`: {solution.message if solution else 'could not be run'}"
        for run, solution in solutions.items()
        if solution is None or not solution.success
    ]
    return [*markdown_table(header, rows), "", *wrong, *refused]


def _flow(rng, width) -> str:
    """Return a random flow with one feature of a width, s, as a case has it."""
    time, amplitude = rng.uniform(0.0, DURATION), rng.uniform(0.2, 1.0)
    base = "{profile: sine, mean: 1.5, amplitude: 0.1}"
    sign = rng.choice([-0.5, 1.0])
    shape = rng.choice(["one_minus_cosine", "mexican_hat", "step"])
    if shape == "step":
        after = 1.5 + 0.4 * sign * amplitude
        part = f"{{profile: step, before: 1.5, after: {after:.6g}, time: {time:.6g}, "
        part += f"width: {0.1 * width:.6g}}}"
    else:
        part = f"{{profile: gust, shape: {shape}, amplitude: {sign * amplitude:.6g}, "
        part += f"time: {time:.6g}, width: {width:.6g}}}"
    return f"{{profile: sum, parts: [{base}, {part}]}}"


def _error(solution, width) -> float:
    """Return the relative difference of a result's energies from a finer integration."""
    first, design = float(solution.trajectory["rotor_speed_rad_s"][0]), solution.design()
    refined = 200 if width < 0.5 else 20
    energy = design.simulate(design.physics.inflow, first, refined=refined).energy
    summary = solution.summary
    return max(abs(each / energy - 1.0) for each in (summary.energy_J, summary.simulated_energy_J))
