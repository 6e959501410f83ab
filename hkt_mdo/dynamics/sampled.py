"""Flows through samples: a measured record, and turbulence that is made of waves."""

from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.sections import Flaws, Quantity

SAMPLES_PER_PERIOD = 8  # at least, of turbulence in the shortest period that it contains
MOST_WAVES = 1_000_000  # frequencies that turbulence is made of


class SampledInflow(Inflow):
    """A flow through samples: the C² cubic spline through them, not-a-knot or periodic.

    Outside a record the speed keeps its end value; the rate jumps to zero there.
    """

    def samples(self):
        """Return times (s), speeds (m/s) and the kind of spline, as SciPy calls it."""
        raise NotImplementedError

    @cached_property
    def spline(self):
        """The spline, m/s, over the time, s."""
        from scipy.interpolate import CubicSpline

        time, speed, kind = self.samples()
        return CubicSpline(time, speed, bc_type=kind)

    def speed_at(self, time):
        spline, time = self.spline, np.asarray(time)
        repeats = spline.extrapolate == "periodic"
        held = time.real if repeats else np.clip(time.real, spline.x[0], spline.x[-1])
        # exact in the imaginary part too, as long as that is a complex step
        return spline(held) + spline(held, 1) * (held == time.real) * (time - time.real)


SPECTRA = {"von_karman": (70.8, 2, 5.0 / 6.0), "kaimal": (6.0, 1, 5.0 / 3.0)}
"""a, b and c of one-sided spectra S V / (σ² L) = 4 / (1 + a n^b)^c over n = f L / V.

Von Kármán's (1948; ESDU 85020), and Kaimal's (IEC 61400-1, edition 3, Annex B).
"""


class TurbulentInflow(SampledInflow):
    """Turbulence, v = mean + sum_k sqrt(2 S(f_k) df) cos(2 pi f_k t + phase_k), df = 1/duration.

    Phases are random. Waves above the cutoff and below 1/duration are missing: the share of the
    variance that is kept is reported.
    """

    profile: Literal["turbulence"] = "turbulence"
    """The kind of flow."""
    spectrum: Literal[(*SPECTRA,)] = "von_karman"
    """Spectrum S(f) of the longitudinal velocity, n = f L/V: `von_karman`, S = 4 s^2 (L/V) / (1 +
    70.8 n^2)^(5/6); `kaimal`, S = 4 s^2 (L/V) / (1 + 6 n)^(5/3) (IEC 61400-1)."""
    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed V."""
    intensity: Annotated[float, Quantity(gt=0, lt=1)] = 0.1
    """Standard deviation s of the whole spectrum over the mean."""
    length_scale: Annotated[float, Quantity("m", gt=0)] = 5.0
    """Integral length scale L, of the order of the river's depth."""
    seed: Annotated[int, Strict(), Field(ge=0, lt=2**63)] = 1
    """Seed of the random phases and amplitudes."""
    amplitudes: Literal["fixed", "random"] = "fixed"
    """`fixed` by the spectrum, so that every seed has the same variance; `random`, Rayleigh
    distributed about it."""
    duration: Annotated[float, Quantity("s", gt=0)] = 60.0
    """Duration, after which the flow repeats; at least ten times L/V."""
    cutoff: Annotated[float, Quantity("Hz", gt=0)] | None = None
    """Highest frequency; null: 2 mean/length_scale, above which there is a tenth of the variance.
    """

    @property
    def highest_frequency(self) -> float:
        return self.cutoff or 2.0 * self.mean / self.length_scale

    def flaws(self) -> Flaws:
        shortest = 10.0 * self.length_scale / self.mean
        if self.duration < shortest:
            remedy = f"give at least 10 length_scale/mean = {shortest:g} s"
            yield "duration", "is too short for the slowest eddies", remedy
        waves = self.duration * self.highest_frequency
        if not 4 <= waves <= MOST_WAVES:
            problem = f"up to {self.highest_frequency:g} Hz there are {waves:.3g} waves, their "
            problem += "frequencies 1/duration apart"
            remedy = f"between 4 and {MOST_WAVES} are possible: change it or the duration"
            yield "cutoff", problem, remedy

    @property
    def length(self):
        return self.duration

    def spectral_density(self, frequency):
        """Return the one-sided spectrum S(f), m²/s² per Hz, whose integral over f is s²."""
        time_scale = self.length_scale / self.mean
        variance, (a, b, c) = (self.intensity * self.mean) ** 2, SPECTRA[self.spectrum]
        return variance * time_scale * (4.0 / (1.0 + a * (frequency * time_scale) ** b) ** c)

    @property
    def frequencies(self):
        """Frequencies f_k of the waves, Hz."""
        # rounding must not lose the last one where the cutoff is a whole number of df
        count = int(self.highest_frequency * self.duration * (1 + 1e-12))
        return np.arange(1, count + 1) / self.duration

    @property
    def kept_variance(self) -> float:
        """Variance of this flow as a share of s²."""
        power = np.sum(self.spectral_density(self.frequencies)) / self.duration
        return float(power / (self.intensity * self.mean) ** 2)

    @property
    def messages(self):
        deviation = self.intensity * self.mean * np.sqrt(self.kept_variance)
        return (
            f"turbulence from {1.0 / self.duration:.3g} to {self.highest_frequency:.3g} Hz has "
            f"{100 * self.kept_variance:.3g} % of the spectrum's variance: its standard deviation "
            f"is {deviation:.3g} m/s{' in the mean of seeds' * (self.amplitudes == 'random')}",
        )

    def samples(self):
        from scipy.fft import irfft, next_fast_len

        # Phases are drawn from the lowest frequency up: another cutoff leaves the slower waves as
        # they are.
        frequencies = self.frequencies
        amplitudes = np.sqrt(2.0 * self.spectral_density(frequencies) / self.duration)
        if self.amplitudes == "random":  # a stream of their own: the phases stay those of the seed
            squares = np.random.default_rng((self.seed, 1)).exponential(size=frequencies.size)
            amplitudes *= np.sqrt(squares)
        phases = np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, frequencies.size)
        count = next_fast_len(SAMPLES_PER_PERIOD * frequencies.size, real=True)
        terms = np.zeros(count // 2 + 1, dtype=complex)
        terms[0] = count * self.mean
        terms[1 : frequencies.size + 1] = 0.5 * count * amplitudes * np.exp(1j * phases)
        speed = irfft(terms, count)
        time = np.arange(count + 1) * (self.duration / count)
        return time, np.append(speed, speed[0]), "periodic"
