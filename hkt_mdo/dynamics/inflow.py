"""Inflow speed over time (paper Sec. IV and V), and its component inside the ODE.

Formulas (constant, step, sine, tide, gust), samples (a measured record, turbulence) and their sum,
all of one interface, twice continuously differentiable in time.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
import openmdao.api as om
from scipy.fft import irfft, next_fast_len
from scipy.interpolate import CubicSpline

SAMPLES_PER_PERIOD = 8
"""Samples of synthesized turbulence in the shortest period that it contains, at least."""


class Inflow(Protocol):
    """A flow: speed(t) in m/s and its rate(t) in m/s², for t in s of any shape; complex-safe.

    Two attributes tell how long and how finely to look at it; a flow may lack them, which is as if
    they were None. duration: time (s) after which it has nothing new to say, None: no end. cutoff:
    the highest frequency (Hz) that matters in it, None: none.
    """

    def speed(self, time):
        """Return the inflow speed, m/s."""

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""


@dataclass(frozen=True)
class ConstantInflow:
    """v(t) = value (m/s)."""

    value: float

    duration = cutoff = None

    def speed(self, time):
        """Return the inflow speed, m/s."""
        return self.value + 0.0 * np.asarray(time)

    def rate(self, time):
        """Return zero, m/s²."""
        return 0.0 * np.asarray(time)


@dataclass(frozen=True)
class StepInflow:
    """v(t) = before + (after - before) / (1 + exp(-(t - time) / width)), paper eq. 9 (m/s, s)."""

    before: float
    after: float
    time: float
    width: float

    duration = None

    @property
    def cutoff(self):
        """Frequency, Hz, at which the rate's spectrum, x/sinh(x) with x = 2 π² f width, is 3 %."""
        return 0.3 / self.width

    def speed(self, time):
        """Return the inflow speed, m/s."""
        # tanh form: the exponential of eq. 9 would overflow long before the step
        tanh = np.tanh(0.5 * (np.asarray(time) - self.time) / self.width)
        return 0.5 * (self.before + self.after) + 0.5 * (self.after - self.before) * tanh

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        tanh = np.tanh(0.5 * (np.asarray(time) - self.time) / self.width)
        return 0.25 * (self.after - self.before) / self.width * (1.0 - tanh**2)


@dataclass(frozen=True)
class SineInflow:
    """v(t) = scale (mean + amplitude sin(w t + phase)), paper eq. 10 and its flows A, B and C.

    Speeds in m/s, angular frequency in rad/s, phase in rad.
    """

    mean: float
    amplitude: float
    angular_frequency: float
    phase: float = 0.0
    scale: float = 1.0

    duration = None

    @property
    def cutoff(self):
        """Frequency of the sine, Hz."""
        return self.angular_frequency / (2.0 * np.pi)

    def speed(self, time):
        """Return the inflow speed, m/s."""
        angle = self.angular_frequency * np.asarray(time) + self.phase
        return self.scale * (self.mean + self.amplitude * np.sin(angle))

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        angle = self.angular_frequency * np.asarray(time) + self.phase
        return self.scale * self.amplitude * self.angular_frequency * np.cos(angle)


class Harmonic(NamedTuple):
    """One constituent of a tide: amplitude (m/s), period (s), phase (rad)."""

    amplitude: float
    period: float
    phase: float


# hours; the speeds of the equilibrium tide (deg/h) are sums of the astronomical rates
# tau = 14.4920521, s = 0.5490165, h = 0.0410686, p = 0.0046418 (Doodson 1921)
TIDAL_PERIODS = {
    name: 3600.0 * hours
    for name, hours in {
        "M2": 12.4206012,
        "S2": 12.0,
        "N2": 12.65834751,
        "K2": 11.96723606,
        "K1": 23.93447213,
        "O1": 25.81934171,
        "P1": 24.06588766,
        "Q1": 26.868357,
        "M4": 6.210300601,
        "MS4": 6.103339275,
        "M6": 4.140200401,
    }.items()
}
"""Periods of the usual tidal constituents, s."""


@dataclass(frozen=True)
class TidalInflow:
    """v(t) = scale (mean + sum_k a_k cos(2 π t / T_k - phase_k)), a tidal current.

    Speeds in m/s, times in s, phases in rad; constituents is a tuple of `Harmonic`. Whether the
    flow keeps its direction is for the caller to check: turbines here do not reverse.
    """

    mean: float
    constituents: tuple[Harmonic, ...]
    scale: float = 1.0

    duration = None

    @property
    def cutoff(self):
        """Frequency of the fastest constituent, Hz."""
        return 1.0 / min(harmonic.period for harmonic in self.constituents)

    def speed(self, time):
        """Return the inflow speed, m/s."""
        amplitude, _, angle = self._harmonics(time)
        return self.scale * (self.mean + np.cos(angle) @ amplitude)

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        amplitude, frequency, angle = self._harmonics(time)
        return -self.scale * (np.sin(angle) @ (amplitude * frequency))

    def _harmonics(self, time):
        """Return amplitudes, angular frequencies and the angles at `time`, (*time.shape, n)."""
        amplitude, period, phase = np.array(self.constituents, dtype=float).T
        frequency = 2.0 * np.pi / period
        return amplitude, frequency, np.multiply.outer(np.asarray(time), frequency) - phase


def _bump(place):
    """Return (1 - cos 2πs)²/4 and its derivative by s: a bump of height 1, C³ at s = 0 and 1."""
    angle = 2.0 * np.pi * place
    rise = 0.5 * (1.0 - np.cos(angle))
    return rise**2, 2.0 * np.pi * rise * np.sin(angle)


def _mexican_hat(place):
    """Return -0.37 sin 3πs (1 - cos 2πs) and its derivative by s; C² at s = 0 and 1."""
    fast, slow = 3.0 * np.pi * place, 2.0 * np.pi * place
    rise = 1.0 - np.cos(slow)
    slope = 3.0 * np.pi * np.cos(fast) * rise + 2.0 * np.pi * np.sin(fast) * np.sin(slow)
    return -0.37 * np.sin(fast) * rise, -0.37 * slope


_GUSTS = {"one_minus_cosine": (_bump, 2.0), "mexican_hat": (_mexican_hat, 2.5)}


@dataclass(frozen=True)
class GustInflow:
    """v(t) = mean + amplitude g((t - time) / width), one gust in a steady flow (m/s, s).

    g is 0 outside 0 <= s <= 1, and inside, by `shape`:

    - ``mexican_hat``: -0.37 sin 3πs (1 - cos 2πs), the extreme operating gust of IEC 61400-1
      (edition 3, 6.3.2.2), where `amplitude` is the V_gust there: a dip by 0.27 of it, a rise by
      0.74, a dip. All three factors vanish at the ends like s³: it is C².
    - ``one_minus_cosine``: (1 - cos 2πs)²/4, a rise by `amplitude`. The plain (1 - cos)/2 of the
      standards has a jump in its second derivative at either end; its square is C³.
    """

    mean: float
    amplitude: float
    time: float
    width: float
    shape: str = "one_minus_cosine"

    duration = None

    @property
    def cutoff(self):
        """Frequency of the fastest of the cosines that make up the gust, Hz."""
        return _GUSTS[self.shape][1] / self.width

    def speed(self, time):
        """Return the inflow speed, m/s."""
        return self.mean + self.amplitude * self._gust(time)[0]

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        return self.amplitude / self.width * self._gust(time)[1]

    def _gust(self, time):
        place = (np.asarray(time) - self.time) / self.width
        inside = (np.real(place) >= 0.0) & (np.real(place) <= 1.0)
        return [inside * part for part in _GUSTS[self.shape][0](place)]


@dataclass(frozen=True, eq=False)
class SampledInflow:
    """A flow through equally spaced samples: the C² cubic spline, not-a-knot or periodic.

    Outside the record the speed keeps its end value, or repeats if there is a period. No optimizer
    and no integration should go there: the rate jumps to zero at the ends.

    Parameters
    ----------
    time : array, shape (n,), s
        Rising in equal steps, n >= 4.
    speed_values : array, shape (n,), m/s
    period : float or None, s
        n steps: the sample after the last one is the first again.
    cutoff : float or None, Hz
        The highest frequency in the samples; None: half of Nyquist's.
    messages : tuple of str
        What was done to the samples before they came here.

    Raises
    ------
    ValueError
        If there are too few samples, or the times or the period do not rise in equal steps.
    """

    time: np.ndarray
    speed_values: np.ndarray
    period: float | None = None
    cutoff: float | None = None
    messages: tuple[str, ...] = ()
    _step: float = field(init=False, repr=False)
    _start: float = field(init=False, repr=False)
    _cubics: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        time = np.asarray(self.time, dtype=float)
        values = np.asarray(self.speed_values, dtype=float)
        if time.ndim != 1 or time.shape != values.shape or time.size < 4:
            raise ValueError("a sampled flow needs at least four times and as many speeds")
        step = (time[-1] - time[0]) / (time.size - 1)
        even = time[0] + step * np.arange(time.size)
        if not (step > 0.0 and np.max(np.abs(time - even)) < 1e-6 * step + 1e-12 * abs(time[-1])):
            raise ValueError("the times of a sampled flow must rise in equal steps")
        kind = "not-a-knot"
        if self.period is not None:
            if abs(self.period / step - time.size) > 1e-6 * time.size:
                raise ValueError("the period of a sampled flow must be as many steps as samples")
            values, kind = np.append(values, values[0]), "periodic"
        # rows d, c, b, a of a + b s + c s² + d s³, with s in steps
        cubics = CubicSpline(np.arange(float(values.size)), values, bc_type=kind).c
        for name, value in (
            ("_step", float(step)),
            ("_start", float(time[0])),
            ("_cubics", cubics),
            ("cutoff", self.cutoff or 0.25 / float(step)),
        ):
            object.__setattr__(self, name, value)

    @property
    def duration(self):
        """Length of the record or of its period, s."""
        return self._cubics.shape[1] * self._step

    def speed(self, time):
        """Return the inflow speed, m/s."""
        (d, c, b, a), s, _ = self._look_up(time)
        return a + s * (b + s * (c + s * d))

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        (d, c, b, _), s, inside = self._look_up(time)
        return inside * (b + s * (2.0 * c + s * 3.0 * d)) / self._step

    def _look_up(self, time):
        """Return the coefficients of the cubic at `time`, the place on it, and if it is inside."""
        count = self._cubics.shape[1]
        place = (time - self._start) / self._step
        if isinstance(place, float):  # an integrator's call: no array, for it comes very often
            if self.period is not None:
                place %= count
            inside = 0.0 <= place <= count
            place = min(max(place, 0.0), float(count))
            row = min(int(place), count - 1)
            return self._cubics[:, row].tolist(), place - row, inside
        place = np.asarray(place)
        if self.period is not None:
            place = place - count * np.floor(place.real / count)
        inside = (place.real >= 0.0) & (place.real <= count)
        place = np.where(inside, place, np.clip(place.real, 0.0, count))
        row = np.minimum(place.real.astype(np.intp), count - 1)
        return self._cubics[:, row], place - row, inside


def von_karman(frequency):
    """Return von Kármán's spectrum of longitudinal velocity, 4 / (1 + 70.8 n²)^(5/6).

    Of a homogeneous and isotropic flow (von Kármán 1948, in Taylor's frozen form; ESDU 85020): with
    n = f L / V, the one-sided spectrum is S(f) = σ² (L / V) times this, and L is the integral
    length scale.
    """
    return 4.0 / (1.0 + 70.8 * frequency**2) ** (5.0 / 6.0)


def kaimal(frequency):
    """Return Kaimal's spectrum of longitudinal velocity, 4 / (1 + 6 n)^(5/3).

    Of a boundary layer, in the form of IEC 61400-1 (edition 3, Annex B): with n = f L / V, the
    one-sided spectrum is S(f) = σ² (L / V) times this.
    """
    return 4.0 / (1.0 + 6.0 * frequency) ** (5.0 / 3.0)


SPECTRA = {"von_karman": von_karman, "kaimal": kaimal}


@dataclass(frozen=True)
class TurbulentInflow:
    """v(t) = mean + sum_k sqrt(2 S(f_k) df) cos(2 π f_k t + phase_k), f_k = k df up to the cutoff.

    Longitudinal turbulence at a point with df = 1/duration, so that it repeats after `duration`.
    Amplitudes follow from the spectrum, phases are random: every realization has the spectrum
    exactly. What lies above the cutoff, or below df/2, is missing, and the rest is not scaled up:
    `kept_variance` says how much there is. A rotor of diameter D averages over eddies smaller than
    itself, which is what is above V/D: a good cutoff.

    Parameters
    ----------
    spectrum : {'von_karman', 'kaimal'}
    mean : float, m/s
        Mean speed V, at which the turbulence drifts past (Taylor's hypothesis).
    intensity : float
        Standard deviation σ over V, of the whole spectrum.
    length_scale : float, m
        L; L/V is the integral time scale.
    seed : int
        Of the phases, drawn from the lowest frequency up by NumPy's default generator: another
        cutoff leaves the slower parts as they are.
    duration : float, s
    cutoff : float, Hz
    """

    spectrum: str
    mean: float
    intensity: float
    length_scale: float
    seed: int
    duration: float
    cutoff: float

    def spectral_density(self, frequency):
        """Return the one-sided spectrum S(f), m²/s² per Hz, whose integral over f is σ²."""
        time_scale = self.length_scale / self.mean
        variance = (self.intensity * self.mean) ** 2
        return variance * time_scale * SPECTRA[self.spectrum](frequency * time_scale)

    @property
    def frequencies(self):
        """Frequencies f_k that it is made of, Hz."""
        # a cutoff of a whole number of df must not lose its last one to rounding
        return np.arange(1, int(self.cutoff * self.duration * (1 + 1e-12)) + 1) / self.duration

    @property
    def kept_variance(self):
        """Variance of this flow as a share of σ²."""
        power = np.sum(self.spectral_density(self.frequencies)) / self.duration
        return float(power / (self.intensity * self.mean) ** 2)

    @property
    def messages(self):
        """What the realization has of the spectrum."""
        deviation = self.intensity * self.mean * np.sqrt(self.kept_variance)
        return (
            f"turbulence from {1.0 / self.duration:.3g} to {self.cutoff:.3g} Hz has "
            f"{100 * self.kept_variance:.3g} % of the spectrum's variance: its standard deviation "
            f"is {deviation:.3g} m/s",
        )

    @cached_property
    def samples(self):
        """The flow as a periodic `SampledInflow`."""
        frequencies = self.frequencies
        amplitudes = np.sqrt(2.0 * self.spectral_density(frequencies) / self.duration)
        phases = np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, frequencies.size)
        count = next_fast_len(max(SAMPLES_PER_PERIOD * frequencies.size, 8), real=True)
        terms = np.zeros(count // 2 + 1, dtype=complex)
        terms[0] = count * self.mean
        terms[1 : frequencies.size + 1] = 0.5 * count * amplitudes * np.exp(1j * phases)
        time = np.arange(count) * (self.duration / count)
        return SampledInflow(time, irfft(terms, count), self.duration, self.cutoff)

    def speed(self, time):
        """Return the inflow speed, m/s."""
        return self.samples.speed(time)

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        return self.samples.rate(time)


@dataclass(frozen=True)
class SumInflow:
    """v(t) = sum of the parts' speeds - offset (m/s).

    The offset takes out what parts besides the first bring along as their own means, so that only
    their fluctuation is added.
    """

    parts: tuple[Inflow, ...]
    offset: float = 0.0

    @property
    def duration(self):
        """Duration of the shortest part, s."""
        return min(self._each("duration"), default=None)

    @property
    def cutoff(self):
        """Highest frequency of all parts, Hz."""
        return max(self._each("cutoff"), default=None)

    @property
    def messages(self):
        """The parts' messages."""
        return tuple(text for part in self.parts for text in getattr(part, "messages", ()))

    def speed(self, time):
        """Return the inflow speed, m/s."""
        return sum(part.speed(time) for part in self.parts) - self.offset

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        return sum(part.rate(time) for part in self.parts)

    def _each(self, name):
        found = (getattr(part, name, None) for part in self.parts)
        return [value for value in found if value is not None]


class InflowComp(om.ExplicitComponent):
    """Inflow speed at the nodes of a phase.

    Input time[num_nodes] (s); output inflow_speed[num_nodes] (m/s).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("inflow", desc="the flow, an `Inflow`", recordable=False)

    def setup(self):
        """Declare inputs and outputs."""
        n = self.options["num_nodes"]
        self.add_input(
            "time", shape=(n,), units="s", desc="time since the start", tags=["dymos.targets:time"]
        )
        self.add_output(
            "inflow_speed", shape=(n,), units="m/s", desc="undisturbed flow speed at the rotor"
        )

    def setup_partials(self):
        """Declare the diagonal partial."""
        rows = np.arange(self.options["num_nodes"])
        self.declare_partials("inflow_speed", "time", rows=rows, cols=rows)

    def compute(self, inputs, outputs):
        """Evaluate the flow."""
        outputs["inflow_speed"] = self.options["inflow"].speed(inputs["time"])

    def compute_partials(self, inputs, partials):
        """Evaluate its rate."""
        partials["inflow_speed", "time"] = self.options["inflow"].rate(inputs["time"])
