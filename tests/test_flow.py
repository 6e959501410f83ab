"""From an inflow section to a flow: every profile built, sums, horizons, and flows refused."""

import os
from dataclasses import asdict
from typing import get_args

import numpy as np
import pytest
from hkt_mdo.problem.flow import build_inflow, check_flow, flow_messages, horizon

from hkt_mdo.case import (
    GustInflow,
    RecordInflow,
    TidalConstituent,
    TurbulentInflow,
    read_case,
)
from hkt_mdo.dynamics import inflow
from hkt_mdo.dynamics.records import RecordOptions, read_record
from hkt_mdo.errors import InputError
from hkt_mdo.files.units import DISCHARGE_UNITS, SPEED_UNITS, TIME_UNITS
from tests.files.broken.records import SOUND

TIME = np.linspace(0.0, 50.0, 501)
TIDE = "{profile: tide, mean: 2, constituents: [{name: M2, amplitude: 0.5, phase: 60 deg}]}"


def section(text, folder="."):
    return read_case(f"inflow: {text}\ncontrol: {{law: linear}}", folder=folder).inflow


@pytest.fixture
def sound(tmp_path):
    name, content = SOUND
    (tmp_path / name).write_bytes(content)
    return tmp_path / name


@pytest.mark.parametrize(
    ("text", "flow", "duration", "cutoff"),
    [
        ("{profile: constant, speed: 1.3}", inflow.ConstantInflow(1.3), None, None),
        ("{profile: step}", inflow.StepInflow(1.2, 1.4, 30.0, 1.0), None, 0.3),
        ("{profile: sine}", inflow.SineInflow(1.5, 0.2, 0.25), None, 0.25 / (2 * np.pi)),
        (
            "{profile: gust}",
            inflow.GustInflow(1.5, 0.3, 20.0, 10.5, "one_minus_cosine"),
            None,
            2.0 / 10.5,
        ),
        (
            "{profile: gust, shape: mexican_hat, amplitude: -0.1, width: 0.5 min}",
            inflow.GustInflow(1.5, -0.1, 20.0, 30.0, "mexican_hat"),
            None,
            2.5 / 30.0,
        ),
        (
            "{profile: turbulence, spectrum: kaimal, seed: 4, cutoff: 0.5}",
            inflow.TurbulentInflow("kaimal", 1.5, 0.1, 5.0, 4, 60.0, 0.5),
            60.0,
            0.5,
        ),
        (
            "{profile: turbulence, length_scale: 2}",
            inflow.TurbulentInflow("von_karman", 1.5, 0.1, 2.0, 1, 60.0, 1.5),
            60.0,
            1.5,
        ),
        (
            "{profile: tide, mean: 2, scale: 0.9, constituents: [{name: S2, amplitude: 0.5, phase: "
            "60 deg}, {period: 10 min, amplitude: 10 cm/s}]}",
            inflow.TidalInflow(
                2.0,
                (
                    inflow.Harmonic(0.5, 43200.0, np.pi / 3.0),
                    inflow.Harmonic(0.1, 600.0, 0.0),
                ),
                0.9,
            ),
            None,
            1.0 / 600.0,
        ),
    ],
)
def test_a_section_is_built(text, flow, duration, cutoff):
    built = build_inflow(section(text))
    assert type(built) is type(flow)
    np.testing.assert_allclose(built.speed(TIME), flow.speed(TIME), rtol=1e-13)
    assert horizon(built) == horizon(section(text)) == (duration, pytest.approx(cutoff))


def test_a_record_is_built(sound):
    folder = sound.parent
    built = build_inflow(
        section("{profile: record, file: sound.csv, start: 5 s, cutoff: 0.4}", folder)
    )
    record = read_record(sound, start=5.0, cutoff=0.4)
    np.testing.assert_array_equal(built.speed(record.time), record.speed)
    assert horizon(built) == (pytest.approx(54.5), 0.4)
    assert flow_messages(built) == record.messages
    assert any("taken from 5 s" in message for message in flow_messages(built))


def test_a_record_that_is_written_anew_is_read_anew(sound):
    case = section("{profile: record, file: sound.csv}", sound.parent)
    first = build_inflow(case)
    assert build_inflow(case) is first
    sound.write_bytes(SOUND[1].replace(b"speed_m_s", b"speed_mph"))
    os.utime(sound, ns=(1, 1))
    again = build_inflow(case)
    assert again.speed(10.0) == pytest.approx(0.44704 * first.speed(10.0), rel=1e-12)
    sound.unlink()
    with pytest.raises(InputError, match=r"sound\.csv: does not exist"):
        build_inflow(case)


def test_messages_tell_the_share_of_the_variance():
    built = build_inflow(section("{profile: turbulence}"))
    (message,) = flow_messages(built)
    assert f"{100 * built.kept_variance:.3g} % of the spectrum's variance" in message
    assert flow_messages(build_inflow(section("{profile: sine}"))) == ()


def words(model, key):
    """Return the words that a key of a section allows."""
    annotation = model.model_fields[key].annotation
    inner = get_args(annotation)
    return set(get_args(inner[0]) if type(None) in inner else inner)


def test_the_case_allows_what_the_physics_knows():
    assert words(TidalConstituent, "name") == set(inflow.TIDAL_PERIODS)
    assert words(TurbulentInflow, "spectrum") == set(inflow.SPECTRA)
    assert words(GustInflow, "shape") == {"one_minus_cosine", "mexican_hat"}
    assert words(RecordInflow, "time_unit") == set(TIME_UNITS)
    assert words(RecordInflow, "speed_unit") == {*SPEED_UNITS, *DISCHARGE_UNITS}
    defaults = {key: field.default for key, field in RecordInflow.model_fields.items()}
    assert {**asdict(RecordOptions()), "profile": "record"} == {
        key: value for key, value in defaults.items() if key != "file"
    }
    for key in ("gaps", "spikes", "uneven"):
        for word in words(RecordInflow, key):
            RecordOptions(**{key: word})


# Sums ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "mean"),
    [
        ("{profile: constant, speed: 1.3}", 1.3),
        ("{profile: step}", 1.2),
        ("{profile: sine, scale: 1.1}", 1.65),
        ("{profile: gust, amplitude: 0.2}", 1.5),
        ("{profile: turbulence, mean: 1.2}", 1.2),
        (TIDE, 2.0),
    ],
)
def test_a_later_part_adds_its_fluctuation_alone(part, mean):
    first = section("{profile: sine, mean: 1.4}")
    whole = build_inflow(
        section(f"{{profile: sum, parts: [{{profile: sine, mean: 1.4}}, {part}]}}")
    )
    expected = build_inflow(first).speed(TIME) + build_inflow(section(part)).speed(TIME) - mean
    np.testing.assert_allclose(whole.speed(TIME), expected, rtol=1e-13)
    derivative = np.imag(whole.speed(TIME + 1e-30j)) / 1e-30
    np.testing.assert_allclose(whole.rate(TIME), derivative, atol=5e-14)


def test_a_record_in_a_sum_adds_its_fluctuation_alone(sound):
    text = "{profile: sum, parts: [{profile: constant, speed: 3}, {profile: record, file: s.csv}]}"
    whole = build_inflow(section(text.replace("s.csv", "sound.csv"), sound.parent))
    record = read_record(sound)
    expected = 3.0 + record.speed - np.mean(record.speed)
    np.testing.assert_allclose(whole.speed(record.time), expected, rtol=1e-13)
    assert horizon(whole) == (pytest.approx(59.5), 0.5)
    assert flow_messages(whole) == record.messages


def test_a_fluctuation_may_outdo_its_own_mean_in_a_sum():
    weak = "{profile: turbulence, mean: 0.5, intensity: 0.9, length_scale: 1}"
    with pytest.raises(InputError, match="it stands still or turns back"):
        build_inflow(section(weak))
    build_inflow(section(f"{{profile: sum, parts: [{{profile: constant, speed: 3}}, {weak}]}}"))


# Flows that a turbine cannot stand in -------------------------------------------------------------


def test_a_flow_that_turns_back_is_refused():
    tide = build_inflow(section("{profile: tide, constituents: [{name: M2, amplitude: 2}]}"))
    check_flow(tide, 3600.0)  # an hour after the flood's peak
    with pytest.raises(InputError) as caught:
        check_flow(tide, 6 * 3600.0)
    message = str(caught.value)
    assert message.startswith("inflow: reaches -")
    assert "at t = 21600 s: it stands still or turns back" in message
    assert "a shorter phase.duration" in message
    lull = build_inflow(section("{profile: gust, amplitude: -1.6, time: 20}"))
    check_flow(lull, 20.0)
    with pytest.raises(InputError, match=r"t = 25\.2"):
        check_flow(lull, 60.0)
    with pytest.raises(InputError, match="inflow: reaches -"):
        build_inflow(section("{profile: turbulence, intensity: 0.9}"))


def test_a_record_must_last(sound):
    text = "{profile: record, file: sound.csv}"
    record = section(text, sound.parent)
    check_flow(build_inflow(record), 59.5)
    both = section(f"{{profile: sum, parts: [{text}, {{profile: turbulence}}]}}", sound.parent)
    for flow in (record, both):
        with pytest.raises(InputError, match=r"is longer than the record of the flow, 59\.5 s"):
            check_flow(build_inflow(flow), 60.0)
    # turbulence goes on
    check_flow(build_inflow(section("{profile: turbulence}")), 200.0)


def test_a_flow_of_ones_own_needs_speed_and_rate_alone():
    class Own:
        def speed(self, time):
            return 1.0 + 0.0 * time

        def rate(self, time):
            return 0.0 * time

    assert horizon(Own()) == (None, None)
    assert flow_messages(Own()) == ()
    check_flow(Own(), 60.0)


def test_a_broken_record_is_told_with_its_file(sound):
    sound.write_bytes(SOUND[1].replace(b"speed_m_s", b"speed"))
    with pytest.raises(InputError, match=r"sound\.csv: column speed: has no unit that is known"):
        build_inflow(section("{profile: record, file: sound.csv}", sound.parent))
