"""Faults of a user's own kinds: the message names the class, its file, its method and the fault."""

import re
import warnings
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
import pytest
import yaml
from openmdao.utils import cs_safe

from hkt_mdo import FeedbackLaw, Inflow, InputError, Limit, Quantity, build_problem, load_case
from hkt_mdo.case.guard import any_values
from hkt_mdo.cli import main
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.run.check import check_case

HEAD = """
from typing import Annotated, ClassVar, Literal
import numpy as np
from hkt_mdo import Aggregate, FeedbackLaw, Inflow, Limit, Objective, Quantity
"""
KINDS = yaml.safe_load((Path(__file__).parent / "data" / "faulty_kinds.yaml").read_text())
FAULTS = {
    "raises": ("factor = 1.0; dict()['key']", r"raises KeyError: 'key' in line \d+"),
    "is nan": ("factor = np.nan", "returns nan"),
    "has a wrong shape": ("factor = np.ones((3, 2))[:, 0]", r"(shape|raises ValueError)"),
    "is none": ("return None", "returns null, which is not a number"),
}
CASE = """
inflow: sine
control: {law: linear}
design: {blade: fixed}
start: {method: blade}
phase: {duration: 5, segments: 5}
"""


@pytest.fixture
def message(tmp_path, capsys):
    """Return a function that tells what a command says of a fault of a kind, after its place."""

    def run(command, kind, fault="factor = 1.0", unit=None, location=None):
        spec = KINDS[kind]
        text = spec["text"].replace("{fault}", fault).replace("{unit}", unit or spec["unit"])
        (tmp_path / "own.py").write_text(HEAD + text)
        key = spec["case"].partition(":")[0]
        lines = [line for line in CASE.splitlines() if not line.startswith(f"{key}:")]
        (tmp_path / "case.yaml").write_text("\n".join([*lines, spec["case"]]))
        extension, case, out = (str(tmp_path / name) for name in ("own.py", "case.yaml", "out"))
        assert main(["--extend", extension, command, case, "--out", out, "--no-figures"]) == 2
        begin = f"{extension}: {location or 'Own.' + spec['method']}: "
        _, separator, said = capsys.readouterr().err.partition(begin)
        assert separator
        return said

    return run


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_is_reported_with_its_place(message, kind, fault):
    code, words = FAULTS[fault]
    if (kind, fault) == ("limit of the design", "has a wrong shape"):
        pytest.skip("a value of the design may be an array of any size")
    said = message("run", kind, code)
    assert re.search(words, said), said
    assert "error of this program" not in said


ARGUMENTS = {"limit": "rotor_radius", "law": "speed", "flow": "time", "aggregate": "rates"}
ARGUMENTS |= {"limit of the design": "mass", "objective": "generator_power"}


@pytest.mark.parametrize(("kind", "argument"), ARGUMENTS.items())
@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("np.abs({0})", r"a derivative by {0} of \S+ by complex step and \S+ by differences"),
        ("np.vectorize(float)({0})", "raises (Type|Complex)\\w+: .* for a complex {0}"),
    ],
    ids=["abs", "float"],
)
def test_a_method_without_derivatives_is_refused(message, kind, argument, code, words):
    """By `hkt check`, without an optimizer."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error", np.exceptions.ComplexWarning)
        said = message("check", kind, f"factor, {argument} = 1.0, {code.format(argument)}")
    assert re.search(words.format(argument), said), said
    assert "np.sqrt(x * x) for np.abs(x)" in said


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("limit", "rotor_speed = np.mean(rotor_speed)"),
        ("limit", "rotor_speed = np.max(rotor_speed)"),
        ("law", "speed = speed / np.max(speed)"),
        ("objective", "generator_power = np.cumsum(generator_power)"),
    ],
)
def test_a_formula_that_mixes_instants_is_refused(message, kind, code):
    """A mean over time would be taken for a value at every instant, its derivatives for those."""
    said = message("check", kind, f"factor = 1.0; {code}")
    assert said.startswith("mixes instants")
    assert "without sums or means" in said


def test_kinks_and_absolute_values_that_keep_derivatives_are_accepted():
    class Kinked(FeedbackLaw):
        law: Literal["kinked"] = "kinked"
        gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",)

        def demand(self, speed, gains):
            return gains[0] * (np.maximum(speed, 1.0) + np.sqrt(speed * speed) + cs_safe.abs(speed))

    law = load_case({"inflow": "sine", "control": "kinked"}, extensions=[Kinked]).control
    torque = law.torque(np.array([-2.0, 0.0, 1.0, 3.0]), np.array([5.0]))
    np.testing.assert_allclose(torque, [25.0, 5.0, 15.0, 45.0])


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_unit_is_reported(message, kind):
    said = message("check", kind, unit="furlong", location="Own")
    assert said.startswith("has the unknown unit 'furlong'")


PROPERTIES = yaml.safe_load((Path(__file__).parent / "data" / "faulty_properties.yaml").read_text())


@pytest.mark.parametrize(("what", "value", "words"), PROPERTIES)
def test_a_fault_of_a_property_of_a_flow_is_reported(what, value, words):
    namespace = {"__name__": __name__}
    exec(
        f"{HEAD}\nclass Own(Inflow):\n    profile: Literal['own'] = 'own'\n"
        "    def speed_at(self, time):\n        return 1.4 + 0.0 * np.asarray(time)\n"
        f"    @property\n    def {what}(self):\n        return {value}\n",
        namespace,
    )
    data = {"inflow": "own", "control": "linear"}
    flow = load_case(data, extensions=[namespace["Own"]]).inflow
    with pytest.raises(InputError) as error:
        getattr(flow, what)
    assert f"{__file__}: Own.{what}: " in str(error.value)
    assert re.search(words.replace("(2,)", r"\(2,\)"), str(error.value)), error.value


def test_a_number_counts_for_all_instants_and_a_guard_leaves_values_as_they_are():
    class Steady(Inflow):
        profile: Literal["steady"] = "steady"
        features: ClassVar[tuple] = ()

        def speed_at(self, time):
            return 1.4

    class Constant(FeedbackLaw):
        law: Literal["constant"] = "constant"
        gain_units: ClassVar[tuple[str, ...]] = ("N*m",)

        def demand(self, speed, gains):
            return gains[0]

    data = {"inflow": "steady", "control": "constant"}
    case = load_case(data, extensions=[Steady, Constant])
    assert list(case.inflow.speed_at(np.arange(3.0))) == [1.4, 1.4, 1.4]
    assert list(case.control.torque(np.arange(3.0), np.array([5.0]))) == [5.0, 5.0, 5.0]
    assert case.control.torque(2.0, np.array([5.0])) == 5.0
    assert type(case.inflow) is Steady
    assert case == load_case(data, extensions=[Steady, Constant])


def test_a_value_that_is_not_finite_is_let_through_while_an_optimizer_works():
    class Broken(FeedbackLaw):
        law: Literal["broken"] = "broken"
        gain_units: ClassVar[tuple[str, ...]] = ("N*m",)

        def demand(self, speed, gains):
            return gains[0] * np.sqrt(speed - 1.0)

    law = load_case({"inflow": "sine", "control": "broken"}, extensions=[Broken]).control
    gains = np.array([5.0])
    with np.errstate(invalid="ignore"):
        with any_values():
            assert np.isnan(law.torque(np.array([0.5]), gains)[0])
        assert np.isnan(law.torque(np.array([np.nan]), gains)[0])
        with pytest.raises(InputError, match=r"Broken\.demand: returns nan"):
            law.torque(np.array([0.5]), gains)


def test_a_quantity_as_it_is_has_its_own_unit():
    class Tonnes(Limit):
        name: ClassVar[str] = "tonnes"
        unit: ClassVar[str] = "t"
        inputs: ClassVar[tuple[str, ...]] = ("mass",)
        bound: Annotated[float, Quantity("t")]

    with pytest.raises(InputError, match="has the unit t, and mass is in kg; write unit = 'kg'"):
        load_case({"inflow": "sine", "control": "linear"}, extensions=[Tonnes])


@pytest.mark.parametrize("static", [False, True])
def test_a_function_from_elsewhere_is_guarded(static):
    def formula(*values):
        return values[-1][0] * np.abs(values[-2])

    class Taken(FeedbackLaw):
        law: Literal["taken"] = "taken"
        gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",)
        demand = staticmethod(formula) if static else formula

    law = load_case({"inflow": "sine", "control": "taken"}, extensions=[Taken]).control
    with pytest.raises(InputError, match=r"Taken\.demand: has a derivative by"):
        law.torque(np.array([2.0]), np.array([5.0]))
    (text,) = law.held(np.array([0.0]))
    assert text.startswith("gain_0 of the law taken begins at 0 and is not designed")
    with pytest.raises(InputError, match=r"IndexError.*; correct the method$"):
        law.slopes(np.array([2.0]), 1.5, np.array([]))


@pytest.mark.parametrize("frequency", [-1.0, "0.1 Hz"])
def test_what_is_no_frequency_is_refused(frequency):
    class Ripple(SineInflow):
        highest_frequency: ClassVar = frequency

    with pytest.raises(InputError, match="is no frequency; give a number in Hz"):
        Ripple().check(5.0)


class TwoStates(FeedbackLaw):
    law: Literal["two"] = "two"
    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",)
    states: ClassVar[dict] = {"x": ("rad", "integral"), "s": ("m/s", "sensor")}

    def demand(self, speed, gains, x, s):
        return gains[0] * (speed - 3.5 * s)

    def rates(self, speed, inflow_speed, gains, x, s):
        return (speed - 5.0 * s - x, inflow_speed - s)

    def at_rest(self, torque, inflow_speed):
        return 0.0 * torque, inflow_speed

    def speed_at_rest(self, inflow_speed, gains):
        return 5.0 * inflow_speed

    def follow(self, inflow_speed, speed, torque, slope):
        return np.array([100.0])


def test_a_law_with_states_returns_a_row_for_each():
    law = load_case({"inflow": "sine", "control": "two"}, extensions=[TwoStates]).control
    speed, flow, gains = np.linspace(6.0, 8.0, 7), np.linspace(1.3, 1.7, 7), np.array([100.0])
    np.testing.assert_allclose(
        law.rates(speed, flow, gains, speed - 5.0 * flow, flow), np.zeros((2, 7))
    )
    with pytest.raises(InputError, match=r"speed_at_rest: returns -6\.5, and must"):
        law.speed_at_rest(-flow, gains)


class Lagging(FeedbackLaw):
    law: Literal["lagging"] = "lagging"
    gain: float | None = None
    lag: float = 0.1
    share: float = 1.0
    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s**2/rad**2",)
    states: ClassVar[dict] = {"z": ("N*m", "torque behind a lag")}

    def demand(self, speed, gains, z):
        return z + 0.0 * speed

    def rates(self, speed, inflow_speed, gains, z):
        return (self.share * (gains[0] * speed**2 - z) / self.lag,)

    def at_rest(self, torque, inflow_speed):
        return (torque,)

    def follow(self, inflow_speed, speed, torque, slope):
        return np.array([np.median(torque / speed**2)])

    def speed_at_rest(self, inflow_speed, gains):
        return 5.0 * inflow_speed


class Unsettled(Lagging):
    law: Literal["unsettled"] = "unsettled"

    def at_rest(self, torque, inflow_speed):
        return (0.0 * torque,)


def test_the_equilibrium_of_a_law_with_states_is_computed_from_a_guess():
    case = {"inflow": "sine", "start": {"method": "blade"}}
    case |= {"phase": {"duration": 5, "segments": 5}, "design": {"blade": "fixed"}}

    def begin(**control):
        kinds = [Lagging, Unsettled]
        problem = build_problem(load_case(case | {"control": control}, extensions=kinds))
        problem.run_model()
        return problem.get_val("traj.phase.timeseries.z").ravel()

    np.testing.assert_allclose(begin(law="unsettled"), begin(law="lagging"), rtol=1e-9)
    with pytest.raises(InputError, match="has a rate of z that depends neither on the speed nor"):
        begin(law="lagging", share=0.0)


@pytest.mark.parametrize(("share", "unstable"), [(1.0, False), (-1.0, True)])
def test_a_check_warns_of_a_filter_with_the_wrong_sign(share, unstable):
    control = {"law": "lagging", "share": share}
    report = check_case(load_case({"inflow": "sine", "control": control}, extensions=[Lagging]))
    assert ("unstable with the starting gains" in " ".join(map(str, report.warnings))) == unstable


def test_numbers_and_sizes_of_gains_are_checked():
    class Two(FeedbackLaw):
        law: Literal["two_gains"] = "two_gains"
        gain: float | None = None
        gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad", "N*m")

        def demand(self, speed, gains):
            return gains[0] * speed + gains[1]

        def sizes(self, gains):
            return 0.0 * gains

    case = {"inflow": "sine", "control": {"law": "two_gains"}}
    with pytest.raises(InputError, match="sizes: returns 0, and must"):
        load_case(case, extensions=[Two]).control.sizes(np.ones(2))
    case["control"]["gain"] = 1.0
    with pytest.raises(InputError, match="begins with 1 gains of 2 to design"):
        load_case(case, extensions=[Two])
