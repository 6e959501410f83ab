"""Inflow profiles: against formulas and spectra, and their rates by complex step."""

from dataclasses import replace

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials
from scipy.integrate import quad, trapezoid
from scipy.signal import periodogram
from scipy.special import gamma, kv

from hkt_mdo.dynamics.inflow import (
    SPECTRA,
    TIDAL_PERIODS,
    ConstantInflow,
    GustInflow,
    Harmonic,
    InflowComp,
    SampledInflow,
    SineInflow,
    StepInflow,
    SumInflow,
    TidalInflow,
    TurbulentInflow,
)

TIME = np.linspace(0.0, 60.0, 245)
HAT = GustInflow(1.5, 0.4, 20.0, 10.5, "mexican_hat")
BUMP = GustInflow(1.5, 0.3, 20.0, 10.5)
WAVES = SampledInflow(
    np.linspace(0.0, 60.0, 121), 1.5 + 0.1 * np.sin(np.linspace(0.0, 60.0, 121) ** 1.3)
)
PROFILES = [
    ConstantInflow(1.3),
    StepInflow(1.2, 1.4, 30.0, 1.0),
    SineInflow(1.5, 0.2, 0.25),
    SineInflow(1.5, 0.2, 0.225, 0.2 * np.pi, 1.1),
    TidalInflow(1.5, (Harmonic(0.3, 600.0, 0.4), Harmonic(0.1, 40.0, -1.0)), 1.2),
    BUMP,
    HAT,
    WAVES,
    TurbulentInflow("von_karman", 1.5, 0.1, 2.0, 7, 50.0, 1.0),
    TurbulentInflow("kaimal", 1.5, 0.1, 2.0, 7, 70.0, 1.0),
]
SUM = SumInflow((PROFILES[2], HAT), 1.5)
PROFILES.append(SUM)
SINE = PROFILES[2].speed(TIME)


def test_step_is_equation_9():
    expected = 1.2 + 0.2 / (1.0 + np.exp(-(TIME - 30.0)))
    np.testing.assert_allclose(PROFILES[1].speed(TIME), expected, rtol=1e-14)


def test_step_does_not_overflow_far_from_the_step():
    with np.errstate(all="raise"):
        assert StepInflow(1.2, 1.4, 1e6, 1.0).speed(0.0) == pytest.approx(1.2)


def test_sine_is_equation_10():
    np.testing.assert_allclose(PROFILES[2].speed(TIME), 0.2 * np.sin(0.25 * TIME) + 1.5, rtol=1e-15)


def test_uncertain_flows_are_those_of_section_5():
    v0 = 0.2 * np.sin(0.25 * TIME) + 1.5
    np.testing.assert_allclose(SineInflow(1.5, 0.2, 0.25, scale=1.1).speed(TIME), 1.1 * v0)
    np.testing.assert_allclose(
        SineInflow(1.5, 0.2, 0.25, phase=0.2 * np.pi).speed(TIME),
        0.2 * np.sin(0.25 * TIME + 0.2 * np.pi) + 1.5,
    )


@pytest.mark.parametrize("inflow", PROFILES)
def test_rate_is_the_derivative(inflow):
    by_complex_step = np.imag(inflow.speed(TIME + 1e-30j)) / 1e-30
    np.testing.assert_allclose(inflow.rate(TIME), by_complex_step, rtol=1e-13, atol=5e-14)


@pytest.mark.parametrize("inflow", PROFILES)
def test_partials(inflow):
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("flow", InflowComp(num_nodes=7, inflow=inflow), promotes=["*"])
    problem.setup(force_alloc_complex=True)
    problem.set_val("time", np.linspace(0.0, 60.0, 7))
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=1e-12, rtol=1e-12)


# Samples ------------------------------------------------------------------------------------------


def test_spline_of_a_cubic_is_the_cubic():
    time = 2.0 + 0.5 * np.arange(20)
    cubic = np.polynomial.Polynomial([1.5, 0.2, -0.03, 0.002])
    inflow = SampledInflow(time, cubic(time))
    between = np.linspace(2.0, 11.5, 333)
    np.testing.assert_allclose(inflow.speed(between), cubic(between), rtol=1e-13)
    np.testing.assert_allclose(inflow.rate(between), cubic.deriv()(between), atol=1e-13)
    assert inflow.duration == pytest.approx(9.5)


def test_spline_is_twice_differentiable_at_its_samples():
    def curvature(time):
        return np.imag(WAVES.rate(time + 1e-30j)) / 1e-30

    inner = WAVES.time[1:-1]
    jump = curvature(inner + 1e-9) - curvature(inner - 1e-9)
    assert np.max(np.abs(jump)) < 1e-6 * np.max(np.abs(curvature(inner)))
    assert np.max(np.abs(WAVES.rate(inner + 1e-9) - WAVES.rate(inner - 1e-9))) < 1e-8


def test_spline_converges_with_the_fourth_power_of_the_step():
    def error(count):
        time = np.linspace(0.0, 60.0, count)
        return np.max(np.abs(SampledInflow(time, PROFILES[2].speed(time)).speed(TIME) - SINE))

    assert error(61) / error(121) == pytest.approx(16.0, rel=0.2)


def test_samples_hold_their_ends_outside():
    for time, value in ((-3.0, WAVES.speed_values[0]), (1e9, WAVES.speed_values[-1])):
        assert WAVES.speed(time) == pytest.approx(value, rel=1e-14)
        assert WAVES.speed(np.array([time]))[0] == pytest.approx(value, rel=1e-14)
        assert WAVES.rate(time) == 0.0
        assert WAVES.rate(np.array([time]))[0] == 0.0
        assert np.imag(WAVES.speed(time + 1e-30j)) == 0.0


def test_periodic_samples_go_on_smoothly():
    period = 2.0 * np.pi / 0.25
    time = np.arange(40) * (period / 40)
    inflow = SampledInflow(time, PROFILES[2].speed(time), period)
    far = np.linspace(-3.0 * period, 5.0 * period, 401)
    np.testing.assert_allclose(inflow.speed(far), PROFILES[2].speed(far), atol=2e-6)
    np.testing.assert_allclose(inflow.rate(far), PROFILES[2].rate(far), atol=5e-6)
    assert inflow.duration == pytest.approx(period)


@pytest.mark.parametrize(
    ("time", "period", "told"),
    [
        ([0.0, 1.0, 2.0], None, "at least four"),
        ([0.0, 1.0, 2.1, 3.0], None, "equal steps"),
        ([3.0, 2.0, 1.0, 0.0], None, "equal steps"),
        ([0.0, 1.0, 2.0, 3.0], 3.0, "as many steps"),
    ],
)
def test_samples_must_be_even(time, period, told):
    with pytest.raises(ValueError, match=told):
        SampledInflow(np.array(time), np.ones(len(time)), period)


@pytest.mark.parametrize("inflow", PROFILES)
def test_one_time_is_as_many(inflow):
    times = TIME[::7]
    for function in (inflow.speed, inflow.rate):
        many = function(times)
        np.testing.assert_allclose([function(t) for t in times.tolist()], many, atol=1e-14)
        np.testing.assert_array_equal(function(times.reshape(5, 7)), many.reshape(5, 7))
        assert np.shape(function(1.0)) == ()


# Turbulence ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_spectra_are_those_of_their_names(spectrum):
    density = SPECTRA[spectrum]
    # the integral is 1, for von Karman up to the rounded constant 70.8; at f = 0 it is 4, so L is
    # the integral scale; far up is the inertial range
    area = 2.0 * np.sqrt(np.pi / 70.8) * gamma(1.0 / 3.0) / gamma(5.0 / 6.0)
    assert area == pytest.approx(1.0, abs=2e-4)
    low, high = quad(density, 0.0, 10.0, epsrel=1e-12)[0], quad(density, 10.0, np.inf)[0]
    assert low + high == pytest.approx({"von_karman": area, "kaimal": 1.0}[spectrum], rel=1e-8)
    assert density(0.0) == 4.0
    assert density(1e6) / density(1e5) == pytest.approx(10.0 ** (-5.0 / 3.0), rel=1e-4)


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_turbulence_has_its_spectrum(spectrum):
    inflow = TurbulentInflow(spectrum, 1.5, 0.12, 4.0, 3, 2000.0, 3.0)
    samples, step = inflow.samples.speed_values, inflow.samples.time[1]
    frequency, density = periodogram(samples, 1.0 / step)
    waves = slice(1, 6001)
    np.testing.assert_allclose(frequency[waves], inflow.frequencies, rtol=1e-12)
    np.testing.assert_allclose(density[waves], inflow.spectral_density(frequency[waves]), rtol=1e-9)
    assert np.max(density[6001:]) < 1e-20
    assert frequency[-1] >= 4.0 * 3.0  # eight samples in the shortest period


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_turbulence_has_the_variance_that_it_says(spectrum):
    inflow = TurbulentInflow(spectrum, 1.5, 0.12, 4.0, 3, 2000.0, 3.0)
    assert np.mean(inflow.samples.speed_values) == pytest.approx(1.5, rel=1e-13)
    variance = np.var(inflow.samples.speed_values)
    assert variance == pytest.approx(inflow.kept_variance * 0.18**2, rel=1e-12)
    ends = 0.5 / 2000.0, 3.0 + 0.5 / 2000.0
    share = quad(inflow.spectral_density, *ends, limit=200)[0] / 0.18**2
    assert inflow.kept_variance == pytest.approx(share, rel=1e-3)
    assert f"{100 * share:.3g} %" in inflow.messages[0]


def test_autocorrelation_is_von_karmans():
    # the spectrum's transform: 2^(2/3) / gamma(1/3) z^(1/3) K_1/3(z), z = tau V / (1.339 L)
    inflow = TurbulentInflow("von_karman", 1.5, 0.1, 3.0, 5, 4000.0, 40.0)
    samples, step = inflow.samples.speed_values, inflow.samples.time[1]
    power = np.abs(np.fft.rfft(samples - 1.5)) ** 2
    correlation = np.fft.irfft(power, samples.size) / (samples.size * 0.15**2)
    lags = np.round(np.array([0.5, 1.0, 2.0, 4.0, 6.0]) / step).astype(int)
    z = lags * step * 1.5 / (3.0 * np.sqrt(70.8) / (2.0 * np.pi))
    expected = 2.0 ** (2.0 / 3.0) / gamma(1.0 / 3.0) * z ** (1.0 / 3.0) * kv(1.0 / 3.0, z)
    np.testing.assert_allclose(correlation[lags], expected, atol=2e-3)
    # and its integral is L / V
    window = int(30.0 / step)
    assert trapezoid(correlation[:window], dx=step) == pytest.approx(3.0 / 1.5, rel=0.02)


def test_seeds_reproduce_and_a_cutoff_leaves_what_is_slower():
    inflow = TurbulentInflow("kaimal", 1.5, 0.1, 5.0, 11, 300.0, 1.0)
    again, other = replace(inflow), replace(inflow, seed=12)
    np.testing.assert_array_equal(again.speed(TIME), inflow.speed(TIME))
    assert np.std(other.speed(TIME) - inflow.speed(TIME)) > 0.05
    finer = replace(inflow, cutoff=2.0)
    slow = [np.fft.rfft(f.samples.speed_values, norm="forward")[:301] for f in (inflow, finer)]
    np.testing.assert_allclose(slow[0], slow[1], atol=1e-14)


def test_turbulence_between_its_samples_is_the_sum_of_waves():
    inflow = TurbulentInflow("von_karman", 1.5, 0.1, 5.0, 2, 200.0, 1.0)
    frequency = inflow.frequencies
    phase = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, frequency.size)
    amplitude = np.sqrt(2.0 * inflow.spectral_density(frequency) / 200.0)
    time = np.linspace(0.0, 400.0, 5001)
    waves = np.cos(2.0 * np.pi * np.multiply.outer(time, frequency) + phase) @ amplitude
    np.testing.assert_allclose(inflow.speed(time), 1.5 + waves, atol=2e-4)


def test_turbulence_is_gaussian():
    samples = TurbulentInflow("kaimal", 1.5, 0.1, 2.0, 1, 5000.0, 5.0).samples.speed_values
    normal = (samples - 1.5) / np.std(samples)
    assert np.mean(normal**3) == pytest.approx(0.0, abs=0.05)
    assert np.mean(normal**4) == pytest.approx(3.0, abs=0.1)


# Gusts, tides, sums -------------------------------------------------------------------------------


def test_mexican_hat_is_the_extreme_operating_gust():
    time = np.linspace(20.0, 30.5, 201)
    place = (time - 20.0) / 10.5
    expected = 1.5 - 0.37 * 0.4 * np.sin(3 * np.pi * place) * (1 - np.cos(2 * np.pi * place))
    np.testing.assert_allclose(HAT.speed(time), expected, rtol=1e-14)
    fine = HAT.speed(np.linspace(20.0, 30.5, 100_001))
    assert np.max(fine) - 1.5 == pytest.approx(0.74 * 0.4, rel=1e-9)
    assert np.min(fine) - 1.5 == pytest.approx(-0.27 * 0.4, rel=0.01)


def test_bump_rises_by_its_amplitude():
    assert BUMP.speed(25.25) == pytest.approx(1.5 + 0.3, rel=1e-14)
    assert BUMP.speed(22.625) == pytest.approx(1.5 + 0.3 / 4.0, rel=1e-14)


@pytest.mark.parametrize("name", ["HAT", "BUMP"])
def test_gusts_begin_and_end_without_a_jump(name):
    inflow = {"HAT": HAT, "BUMP": BUMP}[name]
    for end, inwards in ((20.0, 1.0), (30.5, -1.0)):
        for distance, height in ((1e-2, 1e-8), (1e-3, 1e-11)):
            inside = end + inwards * distance
            assert abs(inflow.speed(inside) - 1.5) < 20 * height  # third power at least
            curvature = np.imag(inflow.rate(inside + 1e-30j)) / 1e-30
            assert abs(curvature) < 0.5 * distance
        assert inflow.speed(end - inwards) == 1.5
        assert inflow.rate(end - inwards) == 0.0


def test_periods_are_sums_of_the_astronomical_rates():
    tau, s, h, p = 14.4920521, 0.5490165, 0.0410686, 0.0046418  # deg/h
    rates = {
        "M2": 2 * tau,
        "S2": 2 * (tau + s - h),
        "N2": 2 * tau - s + p,
        "K2": 2 * (tau + s),
        "K1": tau + s,
        "O1": tau - s,
        "P1": tau + s - 2 * h,
        "Q1": tau - 2 * s + p,
        "M4": 4 * tau,
        "MS4": 4 * tau + 2 * (s - h),
        "M6": 6 * tau,
    }
    assert set(rates) == set(TIDAL_PERIODS)
    for name, rate in rates.items():
        assert TIDAL_PERIODS[name] == pytest.approx(3600.0 * 360.0 / rate, rel=2e-7), name


def test_spring_follows_neap():
    fortnight = 354.3670666 * 3600.0  # the period of MSf
    tide = TidalInflow(
        3.0,
        (Harmonic(1.0, TIDAL_PERIODS["M2"], 0.0), Harmonic(0.4, TIDAL_PERIODS["S2"], 0.0)),
        0.5,
    )
    assert tide.speed(0.0) == pytest.approx(0.5 * 4.4, rel=1e-15)
    half = np.linspace(-0.5, 0.5, 2001) * TIDAL_PERIODS["M2"]
    assert np.ptp(tide.speed(fortnight + half)) == pytest.approx(2.8 * 0.5, rel=2e-3)
    assert np.ptp(tide.speed(0.5 * fortnight + half)) == pytest.approx(1.2 * 0.5, rel=2e-2)


def test_a_sum_is_the_sum():
    expected = PROFILES[2].speed(TIME) + HAT.speed(TIME) - 1.5
    np.testing.assert_allclose(SUM.speed(TIME), expected, rtol=1e-14)
    assert SUM.duration is None
    assert SUM.cutoff == HAT.cutoff
    turbulence = TurbulentInflow("kaimal", 1.5, 0.1, 1.0, 1, 40.0, 2.0)
    whole = SumInflow((turbulence, HAT, WAVES), 3.0)
    assert (whole.duration, whole.cutoff) == (40.0, 2.0)
    assert whole.messages == turbulence.messages


@pytest.mark.parametrize(
    ("inflow", "share"),
    [(PROFILES[1], 0.03), (HAT, 0.03), (BUMP, 0.01), (PROFILES[2], 0.03)],
)
def test_little_lies_above_the_cutoff(inflow, share):
    # of the rate's spectrum, through a window without edges
    time = np.linspace(0.0, 60.0, 2**14)
    window = np.blackman(time.size) if inflow is PROFILES[2] else 1.0
    power = np.abs(np.fft.rfft(inflow.rate(time) * window)) ** 2
    frequency = np.fft.rfftfreq(time.size, time[1])
    above = np.sum(power[frequency > inflow.cutoff + 0.06])
    assert above < share * np.sum(power)
