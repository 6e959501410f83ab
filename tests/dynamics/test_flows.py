"""Flow profiles: against their formulas, and their rates by differences."""

import numpy as np
import pytest

from hkt_mdo.case import read_case
from hkt_mdo.dynamics.flows import (
    TIDAL_HOURS,
    ConstantInflow,
    GustInflow,
    Inflow,
    SineInflow,
    StepInflow,
    SumInflow,
    TidalInflow,
)
from hkt_mdo.dynamics.sampled import TurbulentInflow
from hkt_mdo.errors import InputError

TIME = np.linspace(0.0, 60.0, 245)
STEP, SINE = StepInflow(), SineInflow()
HAT = GustInflow(shape="mexican_hat", amplitude=0.4)
BUMP = GustInflow(amplitude=0.3)
TIDE = TidalInflow(
    mean=1.5,
    constituents=[
        {"amplitude": 0.3, "period": 600.0, "phase": 0.4},
        {"amplitude": 0.1, "period": 40.0, "phase": -1.0},
    ],
    scale=1.2,
)
SUM = SumInflow(parts=(SINE, HAT))
S2 = {"amplitude": 0.5, "period": 43200.0, "phase": np.pi / 3.0}
PROFILES = {
    "constant": ConstantInflow(speed=1.3),
    "step": STEP,
    "sine": SINE,
    "sine of section V": SineInflow(angular_frequency=0.225, phase=0.2 * np.pi, scale=1.1),
    "tide": TIDE,
    "bump": BUMP,
    "hat": HAT,
    "von Karman": TurbulentInflow(length_scale=2.0, seed=7, duration=50.0, cutoff=1.0),
    "Kaimal": TurbulentInflow(spectrum="kaimal", length_scale=2.0, duration=70.0, cutoff=1.0),
    "sum": SUM,
}
each_profile = pytest.mark.parametrize("inflow", PROFILES.values(), ids=PROFILES)


def section(text, folder="."):
    return read_case(f"inflow: {text}\ncontrol: {{law: linear}}", file=f"{folder}/case.yaml").inflow


# What every profile has ---------------------------------------------------------------------------


@each_profile
def test_rate_is_the_derivative(inflow):
    after, before = (inflow.speed_at(TIME + step) for step in (1e-5, -1e-5))
    np.testing.assert_allclose(inflow.rate_at(TIME), (after - before) / 2e-5, atol=1e-7)


@pytest.mark.parametrize(
    ("text", "flow", "highest_frequency"),
    [
        ("{profile: constant, speed: 1.3}", ConstantInflow(speed=1.3), None),
        ("step", StepInflow(before=1.2, after=1.4, time=30.0, width=1.0), 0.3),
        ("sine", SINE, 0.25 / (2 * np.pi)),
        (
            "{profile: gust, shape: mexican_hat, amplitude: -0.1, width: 0.5 min}",
            GustInflow(shape="mexican_hat", amplitude=-0.1, width=30.0),
            2.5 / 30.0,
        ),
        ("{profile: turbulence, length_scale: 2}", TurbulentInflow(length_scale=2.0), 1.5),
        (
            "{profile: tide, mean: 2, scale: 0.9, constituents: [{name: S2, amplitude: 0.5, phase: "
            "60 deg}, {period: 10 min, amplitude: 10 cm/s}]}",
            TidalInflow(mean=2.0, constituents=[S2, {"amplitude": 0.1, "period": 600}], scale=0.9),
            1.0 / 600.0,
        ),
    ],
)
def test_a_section_of_a_case_is_its_flow(text, flow, highest_frequency):
    read, repeats = section(text), "turbulence" in text
    assert type(read) is type(flow)
    np.testing.assert_allclose(read.speed_at(TIME), flow.speed_at(TIME), rtol=1e-13)
    assert read.length == (60.0 if repeats else None)
    assert read.highest_frequency == pytest.approx(highest_frequency)
    assert bool(read.messages) == repeats


def test_a_flow_of_ones_own_needs_speed_at_alone():
    class Own(Inflow):
        def speed_at(self, time):
            return 1.0 + 0.01 * np.asarray(time) ** 2

    inflow = Own(profile="own")
    assert (inflow.length, inflow.highest_frequency, inflow.messages) == (None, None, ())
    assert inflow.mean_speed == 1.0
    np.testing.assert_allclose(inflow.rate_at(TIME), 0.02 * TIME, rtol=1e-14)
    inflow.check(40.0)


# Formulas -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inflow", "expected"),
    [
        (STEP, 1.2 + 0.2 / (1.0 + np.exp(-(TIME - 30.0)))),
        (SINE, 0.2 * np.sin(0.25 * TIME) + 1.5),
        (SUM, SINE.speed_at(TIME) + HAT.speed_at(TIME) - 1.5),
    ],
    ids=["step", "sine", "sum"],
)
def test_steps_and_sines_are_equations_9_and_10_and_a_sum_is_the_sum(inflow, expected):
    np.testing.assert_allclose(inflow.speed_at(TIME), expected, rtol=1e-14)


def test_step_does_not_overflow_far_from_the_step():
    with np.errstate(all="raise"):
        assert StepInflow(time=1e6).speed_at(0.0) == pytest.approx(1.2)


def test_mexican_hat_is_the_extreme_operating_gust():
    time = np.linspace(20.0, 30.5, 201)
    phase = (time - 20.0) / 10.5
    expected = 1.5 - 0.37 * 0.4 * np.sin(3 * np.pi * phase) * (1 - np.cos(2 * np.pi * phase))
    np.testing.assert_allclose(HAT.speed_at(time), expected, rtol=1e-14)
    fine = HAT.speed_at(np.linspace(20.0, 30.5, 100_001))
    assert np.max(fine) - 1.5 == pytest.approx(0.74 * 0.4, rel=1e-9)
    assert np.min(fine) - 1.5 == pytest.approx(-0.27 * 0.4, rel=0.01)


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
    assert set(rates) == set(TIDAL_HOURS)
    for name, rate in rates.items():
        assert TIDAL_HOURS[name] == pytest.approx(360.0 / rate, rel=2e-7), name


# Sums ---------------------------------------------------------------------------------------------


def test_a_sum_has_length_and_highest_frequency_of_its_parts():
    assert SUM.length is None
    assert SUM.highest_frequency == HAT.highest_frequency
    turbulence = TurbulentInflow(spectrum="kaimal", length_scale=1.0, duration=40.0, cutoff=2.0)
    whole = SumInflow(parts=(turbulence, HAT))
    assert (whole.length, whole.highest_frequency) == (40.0, 2.0)
    assert (whole.mean_speed, whole.messages) == (1.5, turbulence.messages)


@pytest.mark.parametrize(
    ("part", "mean"),
    [
        ("{profile: constant, speed: 1.3}", 1.3),
        ("{profile: step}", 1.2),
        ("{profile: sine, scale: 1.1}", 1.65),
        ("{profile: gust, amplitude: 0.2}", 1.5),
        ("{profile: turbulence, mean: 1.2}", 1.2),
        ("{profile: tide, mean: 2, constituents: [{name: M2, amplitude: 0.5, phase: 1}]}", 2.0),
    ],
)
def test_a_later_part_adds_its_fluctuation_alone(part, mean):
    whole = section(f"{{profile: sum, parts: [{{profile: sine, mean: 1.4}}, {part}]}}")
    first = SineInflow(mean=1.4)
    expected = first.speed_at(TIME) + section(part).speed_at(TIME) - mean
    np.testing.assert_allclose(whole.speed_at(TIME), expected, rtol=1e-13)
    assert whole.mean_speed == 1.4


# Flows in which a turbine cannot stand ------------------------------------------------------------


def test_a_flow_that_turns_back_is_refused():
    tide = section("{profile: tide, constituents: [{name: M2, amplitude: 2}]}")
    tide.check(3600.0)  # an hour after the flood's peak
    message = r"^inflow: reaches -.* at t = 21600 s: the flow stops .* a shorter phase\.duration"
    with pytest.raises(InputError, match=message):
        tide.check(6 * 3600.0)
    lull = section("{profile: gust, amplitude: -1.6, time: 20}")
    lull.check(20.0)
    with pytest.raises(InputError, match=r"t = 25\.2"):
        lull.check(60.0)


def test_a_fluctuation_may_exceed_its_own_mean_in_a_sum():
    weak = "{profile: turbulence, mean: 0.5, intensity: 0.9, length_scale: 1}"
    with pytest.raises(InputError, match="the flow stops or reverses"):
        section(weak).check(60.0)
    section(f"{{profile: sum, parts: [{{profile: constant, speed: 3}}, {weak}]}}").check(60.0)


# Where a flow is at most a speed ------------------------------------------------------------------


@each_profile
def test_spans_below_end_where_the_flow_has_the_speed(inflow):
    speed = float(np.quantile(inflow.speed_at(TIME), 0.7))
    spans = inflow.spans_below(speed, 60.0)
    assert np.all(np.diff(spans.ravel()) > 0.0)
    assert np.all((spans >= 0.0) & (spans <= 60.0))
    ends = spans[(spans > 0.0) & (spans < 60.0)]
    np.testing.assert_allclose(inflow.speed_at(ends), speed, rtol=1e-12)
    time = np.linspace(0.0, 60.0, 20_001)[1:-1]
    inside = np.searchsorted(spans.ravel(), time) % 2 == 1
    far = np.abs(inflow.speed_at(time) - speed) > 1e-9
    assert np.array_equal(inside[far], (inflow.speed_at(time) < speed)[far])


def test_spans_below_a_sine_are_those_of_the_arc_sine():
    first = np.arcsin(0.5) / 0.25
    half = np.pi / 0.25
    expected = [[0.0, first], [half - first, 2.0 * half + first], [3.0 * half - first, 50.0]]
    np.testing.assert_allclose(SINE.spans_below(1.6, 50.0), expected, rtol=1e-13)


@pytest.mark.parametrize("excess", [1e-7, 1e-10])
def test_a_peak_between_two_looks_is_found(excess):
    """Near its peak, v = 1.7 - 0.1 (0.25 t)²: a tenth of a millisecond or less is a span."""
    peak, reach = 0.5 * np.pi / 0.25, np.arccos(1.0 - excess / 0.2) / 0.25
    spans = SINE.spans_below(1.7 - excess, 20.0)
    expected = [[0.0, peak - reach], [peak + reach, 20.0]]
    np.testing.assert_allclose(spans, expected, atol=1e-3 * reach)


@pytest.mark.parametrize("speed", [1.7, 1.8])
def test_a_flow_that_reaches_a_speed_or_not_is_below_it_throughout(speed):
    assert np.array_equal(SINE.spans_below(speed, 60.0), [[0.0, 60.0]])
