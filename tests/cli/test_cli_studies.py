"""The command that simulates a finished result."""

import re

import pytest

from hkt_mdo.cli import main

FAST = "{profile: sine, angular_frequency: 1.0, amplitude: 0.3}"


@pytest.fixture(scope="module")
def folders(solve):
    names = {law: f"sine_limited_{law}" for law in ("oloc", "quadratic")}
    return {law: str(solve(name, "driver.optimizer=IPOPT").folder) for law, name in names.items()}


@pytest.fixture
def simulated(folders, capsys):
    """Return what the command prints of a result, without its line ends."""

    def run(law, *arguments):
        assert main(["simulate", folders[law], *arguments]) == 0
        return " ".join(capsys.readouterr().out.split())

    return run


def test_simulate_reports_mean_spread_and_worst(simulated):
    arguments = "--flow A --noise-snr 20 --sample-rate 20 --repeats 3 --seed 1".split()
    printed = simulated("quadratic", *arguments)
    for words in ("rotor stopped in 0 of 3 runs", "low-pass of 0.5 Hz", "torque with noise"):
        assert words in printed
    pattern = r"mean ([\d.]+) kJ, standard deviation ([\d.]+) J, smallest ([\d.]+) .*% by filter"
    mean, spread, smallest = map(float, re.search(pattern, printed).groups())
    assert smallest <= mean
    assert 0.0 < spread < 0.01 * 1e3 * mean


def test_simulate_takes_any_flow_and_says_when_the_rotor_stops(simulated):
    assert "rotor stops at t = " in simulated("oloc", "--flow", "C")
    assert "J captured" in simulated("quadratic", "--flow", "{profile: constant, speed: 1.3}")


def test_a_filter_that_stops_the_rotor_is_reported(simulated):
    fast = ["--flow", FAST, *"--noise-snr 120 --sample-rate 50 --repeats 2".split()]
    printed = simulated("quadratic", *fast)
    assert "(--filter-cutoff), whose delay stops the rotor without any noise" in printed
    assert re.search(r"rotor stops with noise +from t = .* in 2 runs", printed)
    printed = simulated("quadratic", *fast, "--filter-cutoff", "0")
    assert "filter behind it: none" in printed
    assert "rotor stopped in 0 of 2 runs" in printed


TURNS = "{profile: tide, mean: 0.5, constituents: [{period: 40, amplitude: 1}]}"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--flow", "D"], "--flow"),
        (["--flow", "{profile: sine, mean: -1}"], "inflow.mean = -1: must be greater than 0 m/s"),
        (["--flow", "{profile: [}"], "cannot be read as YAML"),
        (["--noise-snr", "20", "--noise-reference", "mean"], "--noise-reference"),
        (["--flow", "{profile: record, file: RECORD, duration: 60}"], "takes 191 samples"),
        (["--flow", TURNS], "reverses"),
        (["--noise-snr", "nan"], "--noise-snr"),
        (["--noise-snr", "20", "--filter-cutoff", "41"], "--filter-cutoff"),
        (["--noise-snr", "20", "--sample-rate", "0"], "--sample-rate"),
    ],
)
def test_simulate_refuses_bad_input(folders, capsys, tmp_path, arguments, word):
    """What the reader of a case refuses, over the time span of the result."""
    record = tmp_path / "record.csv"
    rows = (f"{0.1 * i:.1f},{1.5 + 0.005 * (i % 20):.3f}" for i in range(191))
    record.write_text("\n".join(("time_s,speed_m_s", *rows, "")))
    arguments = [text.replace("RECORD", str(record)) for text in arguments]
    assert main(["simulate", folders["quadratic"], *arguments]) == 2
    assert word in capsys.readouterr().err
