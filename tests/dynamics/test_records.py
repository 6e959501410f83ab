"""The filters of records against their formulas."""

import numpy as np
import pytest

from hkt_mdo.dynamics.flows import GustInflow, StepInflow
from hkt_mdo.dynamics.records import find_spikes, low_pass
from hkt_mdo.dynamics.sampled import TurbulentInflow
from tests.files.test_record_files import SLOW, SPEED, STEP, TIME

# Low-pass -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("half_waves", [1, 150, 300, 450, 2300])
def test_low_pass_has_its_gain(half_waves):
    count, cutoff = 2399, 0.25
    frequency = half_waves / (2.0 * count * STEP)
    wave = np.sin(np.pi * half_waves * np.arange(count + 1) / count)
    gain = 1.0 / (1.0 + (frequency / cutoff) ** 8)
    np.testing.assert_allclose(low_pass(wave, STEP, cutoff), gain * wave, atol=1e-12)


def test_low_pass_is_butterworths_forwards_and_backwards():
    from scipy.signal import butter, sosfiltfilt

    # far below Nyquist's frequency, where the digital filter is the analogue one
    smooth = sosfiltfilt(butter(4, 0.02, fs=1.0 / STEP, output="sos"), SPEED, padlen=2000)
    np.testing.assert_allclose(low_pass(SPEED, STEP, 0.02)[400:-400], smooth[400:-400], atol=2e-5)


# Spikes -------------------------------------------------------------------------------------------


WITHIN = [(np.arange(60, 2340, 120)[:, None] + np.arange(size)).ravel() for size in (1, 2, 3)]
PLANTED = [
    *((SPEED, each, np.resize(np.repeat([-1, 1], each.size // 19), each.size)) for each in WITHIN),
    *((SPEED, [index % SPEED.size], 1.0) for index in (0, 1, 2, -3, -2, -1)),
    *((np.full(100, 1.5), [50], height) for height in (0.5, -1.5, 1e300)),  # still water
]


@pytest.mark.parametrize(("clean", "planted", "height"), PLANTED)
def test_planted_spikes_are_found(clean, planted, height):
    speed = clean.copy()
    speed[planted] += height
    np.testing.assert_array_equal(np.flatnonzero(find_spikes(speed)), planted)


@pytest.mark.parametrize("spectrum", ["von_karman", "kaimal"])
@pytest.mark.parametrize(("cutoff", "digit"), [(0.5, 1e-2), (4.0, 1e-3), (15.9, 1e-9)])
def test_clean_turbulence_has_no_spikes(spectrum, cutoff, digit):
    inflow = TurbulentInflow(
        spectrum=spectrum, intensity=0.2, length_scale=4.0, seed=3, duration=3200.0, cutoff=cutoff
    )
    speed = inflow.speed_at(np.arange(100_000) / 32.0)
    for noise in (0.0, 0.03):
        noisy = speed + noise * np.random.default_rng(1).standard_normal(speed.size)
        assert not np.any(find_spikes(np.round(noisy / digit) * digit))


def test_gusts_steps_and_crests_are_no_spikes():
    flows = [
        GustInflow(mean=1.5, amplitude=0.8, time=200.0, width=3.0),
        GustInflow(mean=1.5, amplitude=-0.8, time=200.0, width=3.0, shape="mexican_hat"),
        StepInflow(before=1.0, after=2.0, time=300.0, width=0.05),
    ]
    for speed in [*(flow.speed_at(TIME) for flow in flows), SLOW, np.abs(np.sin(TIME)), TIME]:
        assert not np.any(find_spikes(speed))
        assert not np.any(find_spikes(np.round(speed, 2)))
