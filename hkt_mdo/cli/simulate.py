"""The command that simulates a result in another flow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from hkt_mdo.cli.parts import Extend, ResultFolder, extensions

if TYPE_CHECKING:
    from rich.console import Console

    from hkt_mdo.results.solution import Solution

_Flow = Annotated[
    str,
    Option(
        metavar="FLOW",
        help="design: the result's own; A, B or C: the paper's uncertain flows (amplitude x 1.1, "
        "frequency 0.225 rad/s, phase 0.2 pi); or an inflow section in YAML, such as "
        "'{profile: sine, mean: 1.4}'.",
    ),
]
_Reference = Annotated[
    str,
    Option(
        "--noise-reference",
        metavar="NAME",
        help="What is the signal: the speed's fluctuation about its mean, or the total speed.",
    ),
]


def simulate(
    result: ResultFolder,
    flow: _Flow = "design",
    snr: Annotated[
        float | None,
        Option("--noise-snr", metavar="DB", help="Signal-to-noise ratio of the speed sensor."),
    ] = None,
    reference: _Reference = "fluctuation",
    rate: Annotated[
        float, Option("--sample-rate", metavar="HZ", help="Samples of the sensor a second.")
    ] = 100.0,
    repeats: Annotated[int, Option(min=1, max=100_000, help="Noisy runs.")] = 20,
    seed: Annotated[int, Option(min=0, help="Seed of the noise.")] = 1,
    extend: Extend = None,
) -> None:
    """Simulate a result in another flow, with sensor noise.

    Blade and controller of a finished result are held and simulated with direct BEM. Open loop
    replays its recorded torque; feedback reads a noisy, filtered speed sensor when --noise-snr is
    given, many times over. A rotor that stops is said to stop, and its energy is not counted.
    """
    from rich.console import Console

    from hkt_mdo.errors import InputError
    from hkt_mdo.results.solution import Solution

    solution = Solution.load(result, **extensions(extend))
    for name, value in (("--noise-snr", snr or 0.0), ("--sample-rate", rate)):
        if not -200.0 <= value <= 1e6:
            raise InputError(
                "is out of range", "give a number between -200 and 1e6", key=name, value=value
            )
    from hkt_mdo.problem.flow import build_inflow
    from hkt_mdo.studies.uncertainty import REFERENCES, Design, Sensor

    if reference not in REFERENCES:
        raise InputError(
            "is unknown", "choose fluctuation or total", key="--noise-reference", value=reference
        )
    section = _section(flow, solution)
    console, design, inflow = Console(highlight=False), Design.of(solution), build_inflow(section)
    quiet = design.fly(inflow)
    told = f"{quiet.energy:.1f} J captured, {quiet.generator_energy:.1f} J generated"
    if quiet.stopped_at is not None:
        told = f"rotor stops at t = {quiet.stopped_at:.2f} s, not generating; energy n/a"
    console.print(f"{solution.name} in flow {section.model_dump()}", markup=False)
    console.print(f"  without noise: {told}")
    if snr is not None and design.law is None:
        console.print("  open loop reads no sensor: the noise changes nothing")
    elif snr is not None:
        _simulate_noise(
            console, design, inflow, Sensor(snr, reference, rate), repeats, seed, quiet.energy
        )


def _section(flow: str, solution: Solution) -> Any:
    """Return the inflow section that --flow names or gives in YAML."""
    if flow.lstrip().startswith("{"):
        return solution.case.with_overrides(f"inflow={flow}").inflow
    from hkt_mdo.studies.uncertainty import flow_named

    return flow_named(flow, solution.case.inflow)


def _simulate_noise(
    console: Console, design: Any, inflow: Any, sensor: Any, repeats: int, seed: int, energy: float
) -> None:
    """Run a feedback design under a noisy sensor and print the energies beside that without (J)."""
    from rich.progress import Progress

    from hkt_mdo.studies.uncertainty import fly_noisy

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"{repeats} noisy runs", total=1.0)

        def report(share: float) -> None:
            bar.update(task, completed=share)

        noisy = fly_noisy(design, inflow, sensor, repeats, seed, report)
    console.print(
        f"  sensor: {sensor.snr:g} dB of the {sensor.reference} speed, sigma = "
        f"{noisy.noise_deviation:.4f} rad/s, {sensor.rate:g} Hz, seed {seed}; BEM table within "
        f"{noisy.torque_error:.1e}"
    )
    console.print(f"  rotor stopped in {noisy.stalled} of {repeats} runs")
    finished = noisy.energy[noisy.energy == noisy.energy]  # NaN where the rotor stopped
    if finished.size:
        mean, spread = finished.mean(), finished.std(ddof=1) if finished.size > 1 else 0.0
        console.print(
            f"  energy of the others: mean {mean:.1f} J, standard deviation {spread:.1f} J, worst "
            f"{finished.min():.1f} J ({100.0 * (mean / energy - 1.0):+.3f} % of the run without "
            "noise)"
        )
