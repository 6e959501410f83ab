"""Flows through samples: splines against polynomials, turbulence against its spectrum, records."""

import os

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import periodogram
from scipy.special import gamma
from scipy.stats import kstest

from hkt_mdo.dynamics import records
from hkt_mdo.dynamics.flows import ConstantInflow, SineInflow, SumInflow
from hkt_mdo.dynamics.records import RecordInflow, read_columns, read_record
from hkt_mdo.dynamics.sampled import SPECTRA, SampledInflow, TurbulentInflow
from hkt_mdo.errors import InputError
from tests.dynamics.test_flows import section
from tests.files.broken.records import SOUND

TIME = np.linspace(0.0, 60.0, 245)
SINE = SineInflow()
each_spectrum = pytest.mark.parametrize("spectrum", SPECTRA)


# Samples ------------------------------------------------------------------------------------------


class Through(SampledInflow):
    """A flow through given samples."""

    profile: str = "through"
    series: tuple

    def samples(self):
        return self.series


def through(time, speed, kind="not-a-knot"):
    return Through(series=(time, speed, kind))


_TIMES = np.linspace(0.0, 60.0, 121)
WAVES = through(_TIMES, 1.5 + 0.1 * np.sin(_TIMES**1.3))


def test_spline_of_a_cubic_is_the_cubic():
    time = 2.0 + 0.5 * np.arange(20)
    cubic = np.polynomial.Polynomial([1.5, 0.2, -0.03, 0.002])
    inflow = through(time, cubic(time))
    between = np.linspace(2.0, 11.5, 333)
    np.testing.assert_allclose(inflow.speed_at(between), cubic(between), rtol=1e-13)
    np.testing.assert_allclose(inflow.rate_at(between), cubic.deriv()(between), atol=1e-13)


def test_samples_hold_their_ends_outside():
    for time, value in ((-3.0, WAVES.series[1][0]), (1e9, WAVES.series[1][-1])):
        assert WAVES.speed_at(time) == pytest.approx(value, rel=1e-14)
        assert WAVES.speed_at(np.array([time]))[0] == pytest.approx(value, rel=1e-14)
        assert WAVES.rate_at(time) == 0.0
        assert WAVES.rate_at(np.array([time]))[0] == 0.0
        assert np.imag(WAVES.speed_at(time + 1e-30j)) == 0.0


def test_periodic_samples_go_on_smoothly():
    period = 2.0 * np.pi / 0.25
    time = np.arange(41) * (period / 40)
    speed = SINE.speed_at(time)
    inflow = through(time, np.append(speed[:-1], speed[0]), "periodic")
    far = np.linspace(-3.0 * period, 5.0 * period, 401)
    np.testing.assert_allclose(inflow.speed_at(far), SINE.speed_at(far), atol=2e-6)
    np.testing.assert_allclose(inflow.rate_at(far), SINE.rate_at(far), atol=5e-6)


# Turbulence ---------------------------------------------------------------------------------------


def long_turbulence(spectrum):
    return TurbulentInflow(
        spectrum=spectrum, intensity=0.12, length_scale=4.0, seed=3, duration=2000.0, cutoff=3.0
    )


def own_samples(inflow):
    """Return the speeds in one period and the step between them."""
    time, speed, _ = inflow.samples()
    return speed[:-1], time[1]


@each_spectrum
def test_spectra_are_those_of_their_names(spectrum):
    unit = TurbulentInflow(spectrum=spectrum, mean=1.0, intensity=0.5, length_scale=1.0)
    density = unit.spectral_density
    # the integral is the variance, 1/4, for von Karman up to the rounded constant 70.8; at f = 0 it
    # is four times that, so L is the integral scale; far up is the inertial range
    area = 2.0 * np.sqrt(np.pi / 70.8) * gamma(1.0 / 3.0) / gamma(5.0 / 6.0)
    assert area == pytest.approx(1.0, abs=2e-4)
    low, high = quad(density, 0.0, 10.0, epsrel=1e-12)[0], quad(density, 10.0, np.inf)[0]
    variance = 0.25 * {"von_karman": area, "kaimal": 1.0}[spectrum]
    assert low + high == pytest.approx(variance, rel=1e-8)
    assert density(0.0) == 1.0
    assert density(1e6) / density(1e5) == pytest.approx(10.0 ** (-5.0 / 3.0), rel=1e-4)


@each_spectrum
def test_turbulence_has_its_spectrum_and_the_variance_that_it_says(spectrum):
    inflow = long_turbulence(spectrum)
    samples, step = own_samples(inflow)
    frequency, density = periodogram(samples, 1.0 / step)
    waves = slice(1, 6001)
    np.testing.assert_allclose(frequency[waves], inflow.frequencies, rtol=1e-12)
    np.testing.assert_allclose(density[waves], inflow.spectral_density(frequency[waves]), rtol=1e-9)
    assert np.max(density[6001:]) < 1e-20
    assert frequency[-1] >= 4.0 * 3.0  # eight samples in the shortest period
    assert np.mean(samples) == pytest.approx(1.5, rel=1e-13)
    assert np.var(samples) == pytest.approx(inflow.kept_variance * 0.18**2, rel=1e-12)
    ends = 0.5 / 2000.0, 3.0 + 0.5 / 2000.0
    share = quad(inflow.spectral_density, *ends, limit=200)[0] / 0.18**2
    assert inflow.kept_variance == pytest.approx(share, rel=1e-3)
    assert f"{100 * share:.3g} %" in inflow.messages[0]


@each_spectrum
def test_random_amplitudes_are_rayleighs_about_the_spectrum_and_leave_the_phases(spectrum):
    fixed = long_turbulence(spectrum)
    samples, step = own_samples(fixed.model_copy(update={"amplitudes": "random"}))
    frequency, density = periodogram(samples, 1.0 / step)
    waves = slice(1, 6001)
    squares = density[waves] / fixed.spectral_density(frequency[waves])
    # the square of a Rayleigh amplitude is exponential, with mean and deviation 1
    assert kstest(squares, "expon").pvalue > 0.01
    phases = (np.angle(np.fft.rfft(each)[waves]) for each in (samples, own_samples(fixed)[0]))
    np.testing.assert_allclose(*phases, atol=1e-6)
    assert np.max(density[6001:]) < 1e-20
    slower = fixed.model_copy(update={"amplitudes": "random", "cutoff": 1.0})
    (samples, step), kept = own_samples(slower), squares[:2000]
    frequency, density = periodogram(samples, 1.0 / step)
    ratios = density[1:2001] / fixed.spectral_density(frequency[1:2001])
    np.testing.assert_allclose(ratios, kept, rtol=1e-6)


def test_seeds_reproduce_and_a_cutoff_leaves_what_is_slower():
    inflow = TurbulentInflow(spectrum="kaimal", seed=11, duration=300.0, cutoff=1.0)
    inflow.speed_at(0.0)  # a copy must not keep these samples
    again, other = inflow.model_copy(), inflow.model_copy(update={"seed": 12})
    np.testing.assert_array_equal(again.speed_at(TIME), inflow.speed_at(TIME))
    assert np.std(other.speed_at(TIME) - inflow.speed_at(TIME)) > 0.05
    finer = inflow.model_copy(update={"cutoff": 2.0})
    slow = [np.fft.rfft(own_samples(f)[0], norm="forward")[:301] for f in (inflow, finer)]
    np.testing.assert_allclose(slow[0], slow[1], atol=1e-14)


def test_turbulence_between_its_samples_is_the_sum_of_waves():
    inflow = TurbulentInflow(seed=2, duration=200.0, cutoff=1.0)
    frequency = inflow.frequencies
    phase = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, frequency.size)
    amplitude = np.sqrt(2.0 * inflow.spectral_density(frequency) / 200.0)
    time = np.linspace(0.0, 400.0, 5001)
    waves = np.cos(2.0 * np.pi * np.multiply.outer(time, frequency) + phase) @ amplitude
    np.testing.assert_allclose(inflow.speed_at(time), 1.5 + waves, atol=2e-4)


# Records ------------------------------------------------------------------------------------------


@pytest.fixture
def sound(tmp_path):
    name, content = SOUND
    (tmp_path / name).write_bytes(content)
    return tmp_path / name


def test_a_record_goes_through_its_samples(sound):
    flow = section("{profile: record, file: sound.csv, start: 5 s, cutoff: 0.4}", sound.parent)
    record = read_record(sound, start=5.0, cutoff=0.4)
    np.testing.assert_allclose(flow.speed_at(record.time), record.speed, rtol=1e-14)
    assert (flow.length, flow.highest_frequency) == (pytest.approx(54.5), 0.4)
    assert flow.mean_speed == pytest.approx(np.mean(record.speed))
    assert flow.messages == tuple(record.messages)
    assert any("taken from 5 s" in message for message in flow.messages)


def test_a_record_is_read_once_and_anew_when_it_is_written_anew(sound, monkeypatch):
    reads = []

    def counted(*arguments):
        reads.append(arguments)
        return read_columns(*arguments)

    monkeypatch.setattr(records, "read_columns", counted)
    first = RecordInflow(file=str(sound))
    speed = first.speed_at(10.0)
    assert RecordInflow(file=str(sound)).speed_at(10.0) == speed
    assert len(reads) == 1
    sound.write_bytes(SOUND[1].replace(b"speed_m_s", b"speed_mph"))
    os.utime(sound, ns=(1, 1))
    assert RecordInflow(file=str(sound)).speed_at(10.0) == pytest.approx(0.44704 * speed, rel=1e-12)
    later = first.model_copy(update={"start": 10.0})
    assert later.speed_at(1.0) == RecordInflow(file=str(sound), start=10.0).speed_at(1.0)
    assert first.speed_at(10.0) == speed
    lost = RecordInflow(file=str(sound), start=2.0)
    sound.unlink()
    with pytest.raises(InputError, match=r"sound\.csv: does not exist"):
        lost.check(10.0)


def test_a_record_in_a_sum_adds_its_fluctuation_alone(sound):
    record = read_record(sound)
    whole = SumInflow(parts=(ConstantInflow(speed=3.0), RecordInflow(file=str(sound))))
    expected = 3.0 + record.speed - np.mean(record.speed)
    np.testing.assert_allclose(whole.speed_at(record.time), expected, rtol=1e-13)
    assert (whole.length, whole.highest_frequency) == (pytest.approx(59.5), 0.5)
    assert whole.messages == tuple(record.messages)


def test_a_record_must_last(sound):
    record = RecordInflow(file=str(sound))
    record.check(59.5)
    for flow in (record, SumInflow(parts=(record, TurbulentInflow()))):
        with pytest.raises(InputError, match=r"is longer than the record of the flow, 59\.5 s"):
            flow.check(60.0)
    TurbulentInflow().check(200.0)  # turbulence repeats
