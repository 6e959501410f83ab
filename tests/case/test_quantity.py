"""Quantities: numbers and units as people write them, and nothing that is not one."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from hkt_mdo.sections import Quantity

ACCEPTED = {
    "m": {"1400 mm": 1.4, "1400mm": 1.4, " 1.4e0 m ": 1.4, "+.5 m": 0.5, "-2. m": -2.0, 3: 3.0},
    "N*m": {"1.8 kN m": 1800.0, "1.8 kN*m": 1800.0, "0.7kN  m": 700.0, "2 kg m^2/s^2": 2.0}
    | {"1.8 kNm": 1800.0, "700 Nm": 700.0, "0.7kN·m": 700.0, "7e-4 MN⋅m": 700.0, "3 m N": 3.0},
    "N*m/s": dict.fromkeys(
        ("500 N m/s", "500 Nm/s", "30 kNm/min", "500 N*m/s", "0.5 kN m s^-1"), 500.0
    ),
    "kg*m**2": {"20 kg m^2": 20.0, "20 kg*m**2": 20.0, "2e5 g m**2": 200.0},
    "m**2": {"0.5 m^2": 0.5, "5000 cm**2": 0.5, "0.5 m m": 0.5},
    "kg/m**3": {"1.025 g/cm^3": 1025.0, "1025 kg m^-3": 1025.0, np.float32(2.0): 2.0},
    "rad/s": {"2 rev/min": np.pi / 15.0, "2rpm": np.pi / 15.0, "105 rpm": 3.5 * np.pi},
    "Pa": {"100 MPa": 1e8, "100 N/mm^2": 1e8, "1 bar": 1e5},
    "W": {"5 kW": 5000.0, "5 kNm/s": 5000.0, "0.2 MW": 2e5},
    "N*m*s**2/rad**2": dict.fromkeys(
        ("7 N*m/(rad/s)**2", "7 N m/(rad/s)^2", "7 N m s^2/rad^2", "7 N m s^2/(rad rad)"), 7.0
    ),
    "deg": {"0.1 rad": np.degrees(0.1)},
    "Hz": {"1/2": None, "0.5 1/s": None},
    None: {"12 %": 0.12, "12%": 0.12, " -.5e1 % ": -0.05},
}


@pytest.mark.parametrize("unit", ACCEPTED)
def test_units_are_converted_however_they_are_written(unit):
    for value, expected in ACCEPTED[unit].items():
        if expected is None:
            with pytest.raises(PydanticCustomError, match="number and a unit"):
                Quantity(unit).read(value)
        else:
            assert Quantity(unit).read(value) == pytest.approx(expected, rel=1e-12), value


REFUSED = {
    "which does not convert to m": ["3 kg", "3 m^2", "3 m m", "3 " + 30 * "m "],
    "has the unknown unit": ["3 foo", "3 m s foo"],
    r"m2 \(did you mean m\*\*2\?\)": ["3 m2"],
    "is a text without a unit": ["3"],
    # 3 m/s s could be 3 m/s*s or 3 m/(s*s)
    "must be a number, or a number and a unit": ["m", "3 m/s s", "1 400 mm", "3 * m", "3 m^ 2"],
    "must be a number, or a number and a unit, decimals with a point": ["1,5", "-1,5 m"],
    "number and a unit": ["3 m*9**9**9", "3 m^9^9", "3 m^99", "3 m.__class__", "3 m\tm", "3 ((m))"],
    "must be": ["3" * 100 + " m", True, [3], None, float("nan"), 10**400, "1e999 m"],
    # a nanometre, a nautical mile and no unit: none of them is taken for N m
    "does not convert|unknown unit": ["3 Nm", "3 nm m", "3 mNm", "3 NMm"],
    "must be greater than 0 m": [0, "-1 mm"],
    "must be at most 10 m": [11, "1 km"],
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_no_quantity_is_refused(message):
    for value in REFUSED[message]:
        with pytest.raises(PydanticCustomError, match=message) as caught:
            Quantity("m", gt=0, le=10).read(value)
        assert "give a number in m, or a text with a unit of that kind" in str(caught.value)


def test_a_plain_number_takes_no_unit():
    with pytest.raises(PydanticCustomError, match="must be a plain number"):
        Quantity().read("1 m")


def test_per_cent_is_a_number_without_a_unit():
    with pytest.raises(PydanticCustomError, match=r"must be less than 1; .* per cent such as 12 %"):
        Quantity(lt=1).read("100 %")
    with pytest.raises(PydanticCustomError, match="number and a unit"):
        Quantity("m").read("12 %")


@given(st.text() | st.text(alphabet="0123456789.e+-*/^() mskgNrad", max_size=30))
@example("3 m" + "(" * 50)
def test_any_text_is_read_or_refused(text):
    try:
        assert np.isfinite(Quantity("m").read(text))
    except PydanticCustomError:
        pass
