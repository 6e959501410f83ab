"""A finished design in flows it was not made for, read by a noisy sensor (paper Sec. V).

Blade and controller are held. Open loop replays its recorded torque. A feedback law is run as the
digital controller that it would be: every sample time it reads F[w + n], where n is Gaussian and F
a second-order Butterworth low-pass, and holds its torque until the next. A law with states advances
them by a sample as well; the flow speed that it uses has the noise of its own sensor, or is
estimated from the torque and the last two speeds that were read.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from hkt_mdo.case import Case
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.errors import InputError
from hkt_mdo.results.design import Design, in_flow

RATIOS = np.concatenate((np.arange(SLOWEST_RATIO, 2.0, 0.02), np.arange(2.0, 20.0, 0.004)))
"""Tip speed ratios of the tabulated torque of the noisy runs."""
LONGEST_STEP = 0.25  # of Runge-Kutta, over the rotor's smallest time constant J / |dQ/dw|
REFERENCES = ("fluctuation", "total")
MOST_SAMPLES = 1e7  # of all repeats: 2 GB
PAPER_FLOWS = {
    "design": {},
    "A": {"scale": 1.1},
    "B": {"angular_frequency": 0.225},
    "C": {"phase": 0.2 * np.pi},
}
"""How the flows of the paper (Sec. V) change the sine that a design was made for."""


@dataclass(frozen=True)
class Sensor:
    """A rotor speed sensor with noise, and the filter behind it.

    The paper gives 20 dB 'compared with the turbine rotational speed signal', and neither the rate
    nor whether the signal's mean counts. Both matter: filtered noise falls with the square root of
    the rate.

    Attributes
    ----------
    snr
        Signal-to-noise ratio, dB; infinity: no noise.
    reference
        What is the signal: the speed's `fluctuation` about its mean, which the controller has to
        follow, or the `total` speed, whose rms is some ten times larger.
    rate
        Samples of sensor and controller, Hz.
    cutoff
        Frequency of the second-order Butterworth low-pass, which delays the torque, Hz; None: no
        filter.
    """

    snr: float = 20.0
    reference: str = "fluctuation"
    rate: float = 100.0
    cutoff: float | None = 0.5

    def __post_init__(self) -> None:
        """Refuse values that are impossible, by the options of `hkt simulate`."""
        for key, value, least, most in (
            ("--noise-snr", 0.0 if self.snr == np.inf else self.snr, -200.0, 1e6),
            ("--sample-rate", self.rate, 2.0, 1e6),
            ("--filter-cutoff", self.cutoff or 0.0, 0.0, 0.4 * self.rate),  # below half of the rate
        ):
            if not least <= value <= most:
                remedy = f"give a number between {least:g} and {most:g}"
                raise InputError("is out of range", remedy, key=key, value=value)
        if self.reference not in REFERENCES:
            remedy, key = f"choose {' or '.join(REFERENCES)}", "--noise-reference"
            raise InputError("is unknown", remedy, key=key, value=self.reference)

    def deviation(self, speed):
        """Return the standard deviation of the noise.

        Parameters
        ----------
        speed : array, shape (n_times,)
            Rotor speed at even times, rad/s.

        Returns
        -------
        float
            Standard deviation, rad/s.
        """
        signal_part = speed - np.mean(speed) if self.reference == "fluctuation" else speed
        return float(np.sqrt(np.mean(signal_part**2)) * 10.0 ** (-self.snr / 20.0))


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Repeated noisy runs of one design in one flow.

    energy (J) and stopped_at (s) have one entry a repeat: NaN where the rotor stopped, and where it
    did not. quiet_energy is that of one more run, with the filter and the samples alone. samples,
    (5, n_samples), are those of all repeats, one after the other, until the rotor stops: time (s),
    speeds of flow (m/s) and rotor (rad/s), torques of flow and generator (N*m).
    """

    energy: np.ndarray
    stopped_at: np.ndarray
    quiet_energy: float
    noise_deviation: float
    samples: np.ndarray

    @property
    def energies(self) -> dict[str, float]:
        """Mean, standard deviation and smallest of the energies of the repeats that end, J.

        Returns
        -------
        dict of float
            Empty where the rotor stopped in all.
        """
        if not (ends := self.energy[np.isfinite(self.energy)]).size:
            return {}
        deviation = ends.std(ddof=ends.size > 1)
        return {"mean": ends.mean(), "standard deviation": deviation, "smallest": ends.min()}


def noisy_runs(design: Design, inflow: Inflow, sensor: Sensor, repeats: int, seed: int) -> Ensemble:
    """Run a feedback design in a flow under a noisy sensor, many times at once.

    Between samples the speed is integrated by the classical Runge-Kutta method. The plant's torque
    coefficient is direct BEM, tabulated at `RATIOS`: its error is far below what the noise changes.

    Parameters
    ----------
    design : Design
        A finished design with a feedback law.
    inflow : Inflow
        The flow.
    sensor : Sensor
        The sensor of the rotor's speed, and its filter.
    repeats, seed : int
        Number of the runs, and seed of the random numbers of all of them.

    Returns
    -------
    Ensemble
        Energies of the runs, and the samples of the first.

    Raises
    ------
    InputError
        For an open loop, and if the integration fails.
    """
    if not design.law.is_feedback:
        folder = design.solution.folder
        raise InputError("open loop reads no sensor", "leave out the noise", file=folder)
    duration = in_flow(design.physics.case, inflow).phase.duration
    quiet = design.simulate(inflow)
    deviation = sensor.deviation(quiet.speed_at(np.linspace(0.0, quiet.time[-1], 2001)))
    plant = design.plant
    tabulated = plant.tabulated(RATIOS)
    n_samples = round(duration * sensor.rate)
    if n_samples * repeats > MOST_SAMPLES:
        remedy = f"give at most {MOST_SAMPLES / n_samples:.0f}, or a lower --sample-rate"
        raise InputError("are too many for the memory", remedy, key="--repeats", value=repeats)
    period = duration / n_samples
    slopes = np.abs(plant.torque_slope(quiet.rotor_speed, quiet.inflow_speed))
    ratio = quiet.rotor_speed / quiet.inflow_speed
    # a rotor below is about to stop
    longest = LONGEST_STEP * plant.inertia / np.max(slopes[ratio >= 0.5 * ratio[0]])
    substeps = max(int(np.ceil(period / longest)), 1)
    step = period / substeps
    speed = np.full(repeats + 1, design.initial_speed(inflow))  # the last without noise
    law, estimate, before, control = design.physics.law, design.controller.estimate, None, 0.0
    states = [np.full_like(speed, state) for state in design.start(inflow, speed[0])[1:]]
    low_pass, memory = ([1.0], [1.0]), np.empty((0, speed.size))  # none
    if sensor.cutoff is not None:
        low_pass = signal.butter(2, sensor.cutoff, fs=1.0 / period)
        memory = signal.lfilter_zi(*low_pass)[:, None] * speed  # in steady state at the first speed
    random = np.random.default_rng(seed)
    energy, stopped = np.zeros_like(speed), np.full_like(speed, np.nan)
    times = period * np.arange(n_samples)
    flows = inflow.speed_at(times[:, None] + step * np.arange(0.0, substeps + 0.25, 0.5))
    slowest = SLOWEST_RATIO * flows[:, -1] / plant.blade.rotor_radius
    record = np.full((5, speed.size, n_samples), np.nan)
    for k in range(n_samples):
        measured = speed + deviation * np.append(random.standard_normal(repeats), 0.0)
        measured, memory = signal.lfilter(*low_pass, measured[None], axis=0, zi=memory)
        measured = np.maximum(measured[0], 0.1 * slowest[k])  # a law may divide by it
        heard = np.append(law.sensed(np.full(repeats, flows[k, 0]), random), flows[k, 0])
        if estimate is not None and before is not None:
            heard = estimate(measured, control, (measured - before) / period)
        before, control = measured, law.torque(measured, design.gains, *states)
        states = _advanced(law, measured, heard, design.gains, states, period)
        driving = tabulated.torque(speed, flows[k, 0])
        record[:, :, k] = np.broadcast_arrays(times[k], flows[k, 0], speed, driving, control)
        record[:, np.isfinite(stopped), k] = np.nan
        held = control + plant.generator.friction(speed)
        speed, captured = _runge_kutta(tabulated, speed, held, flows[k], step)
        energy += captured
        if not np.all(np.isfinite(speed)):  # which is not the same as a rotor that stops
            problem = f"the integration of the noisy runs fails at t = {times[k]:.6g} s"
            raise InputError(problem, "check that the control law is finite there")
        stopped[np.isnan(stopped) & (speed <= slowest[k])] = times[k] + period
        if np.all(np.isfinite(stopped)):
            break
        speed = np.where(np.isnan(stopped), speed, slowest[k])
    energy[np.isfinite(stopped)] = np.nan
    samples = record[:, :-1][:, np.isfinite(record[0, :-1])]
    return Ensemble(energy[:-1], stopped[:-1], float(energy[-1]), deviation, samples)


def _advanced(law, speed, flow, gains, states, period):
    """Return the states of a law one sample later, by implicit Euler with its inputs held.

    Linearized at the states, it is stable at any sample time.
    """
    if not states:
        return states
    slopes = np.moveaxis(law.slopes(speed, flow, gains, *states)[1:, 1:], -1, 0)
    rates = np.stack(law.rates(speed, flow, gains, *states), axis=-1)
    change = np.linalg.solve(np.eye(len(states)) - period * slopes, period * rates[..., None])
    return [state + change[:, i, 0] for i, state in enumerate(states)]


def _runge_kutta(plant, speed, control, flows, step):
    """Return the speeds after some steps with the torques held, and the energies captured.

    flows (m/s) are those at both ends and in the middle of each step (s).
    """
    captured = np.zeros_like(speed)
    for before, middle, after in zip(flows[:-2:2], flows[1::2], flows[2::2], strict=True):
        at, change = speed, np.zeros_like(speed)
        stages = (before, 1.0, 0.5), (middle, 2.0, 0.5), (middle, 2.0, 1.0), (after, 1.0, 0.0)
        for flow, weight, share in stages:
            driving = plant.torque(at, flow)
            slope = (driving - control) / plant.inertia
            change += step / 6.0 * weight * slope
            captured += step / 6.0 * weight * driving * at
            at = speed + share * step * slope
        speed = speed + change
    return speed, captured


def flow_given(text: str, case: Case, seed: int | None = None) -> Inflow:
    """Return a flow by its name, or of an inflow section in YAML.

    Parameters
    ----------
    text : str
        A name of `PAPER_FLOWS`, or a section such as ``{profile: sine, mean: 1.4}``.
    case : Case
        The case whose flow is changed.
    seed : int or None
        Seed in place of the flow's own; in a sum, each part's own grows with it.

    Returns
    -------
    Inflow
        The flow.

    Raises
    ------
    InputError
        If there is no such name, or the flow that it would change is no sine; if the flow is not
        valid, has no seed where one is given, ends before the time span of the case, stands still
        or turns back.
    """
    if text.lstrip().startswith("{"):
        inflow = case.with_overrides(f"inflow={text}").inflow
    elif text not in PAPER_FLOWS:
        remedy = "choose design, A, B, C or give an inflow section"
        raise InputError("unknown", remedy, key=f"--flow {text}")
    elif PAPER_FLOWS[text] and case.inflow.profile != "sine":
        problem = f"changes a sine, but the case's flow is {case.inflow.profile}"
        raise InputError(problem, "give an inflow section", key=f"--flow {text}")
    else:
        inflow = case.inflow.model_copy(update=PAPER_FLOWS[text])
    if seed is not None:
        if inflow.reseeded(1) == inflow:
            remedy = "give a turbulent --flow, or leave --flow-seeds out"
            raise InputError(f"the flow {inflow.profile} has no seed", remedy, key="--flow-seeds")
        inflow = inflow.reseeded(seed - getattr(inflow, "seed", 0))
        text += f", seed {seed}"
    try:
        inflow.check(in_flow(case, inflow).phase.duration)
    except InputError as error:
        if error.file:
            raise
        problem = error.problem if error.value is None else f"{error.value:.6g} s {error.problem}"
        raise InputError(problem, "give another flow", key="--flow", value=text) from None
    return inflow
