"""Broken files of every format: one InputError with file, place and remedy, never anything else."""

import re

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.records import read_record
from hkt_mdo.dynamics.resource import HistogramResource
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.outline import read_outline
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.table import Csv, parse_number
from tests.files.broken import blades, polars, records
from tests.properties import examples

READ = {
    "generator": lambda path: Generator(table=str(path)).electrical_power(1.0, 1.0),
    "year": lambda path: HistogramResource(file=str(path)).speeds,
    "record": read_record,
}
TABLES = yaml.safe_load((polars.DATA / "tables.yaml").read_text())
TABLES += [["record.json", "[" * 20_000, "cannot be read as JSON"]]
BROKEN = (
    {f"blade {flaw}": (read_blade, *broken) for flaw, broken in blades.BROKEN.items()}
    | {flaw: (read_polars, *broken) for flaw, broken in polars.POLARS.items()}
    | {flaw: (read_outline, *broken) for flaw, broken in polars.OUTLINES.items()}
    | {f"record {flaw}": (read_record, *broken) for flaw, broken in records.BROKEN.items()}
    | {
        f"{name} {index}: {message}": (READ[name.partition(".")[0]], name, text.encode(), message)
        for index, (name, text, message) in enumerate(TABLES)
    }
)
SOUND = {
    "blade.csv": (read_blade, blades.CSV.encode()),
    "blade.dat": (read_blade, blades.AERODYN.encode()),
    "blade.yaml": (read_blade, blades.WINDIO.encode()),
    "record.csv": (read_record, records.SOUND[1]),
} | {
    name: (read_polars if index < 7 else read_outline, (polars.DATA / name).read_bytes())
    for index, name in enumerate(polars.WELL)
}
WHOLE = re.compile(
    "is empty|is larger than|is JSON, and no record|cannot be read as|"
    "has (a header but no|[0-9]+|no|nothing|the file extension)"
)
"""What is said of a file as a whole, where no place is to be named."""


def refused(read, path):
    """Return the error, whose message is one printable line with file, place and remedy."""
    with pytest.raises(InputError) as caught:
        read(path)
    error = caught.value
    assert str(error).startswith(f"{path}: ")
    assert str(error).isprintable()
    assert len(str(error)) < len(str(path)) + 500
    assert error.remedy
    assert error.key or WHOLE.match(error.problem)
    return error


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("flaw", BROKEN)
def test_a_broken_file_is_refused_with_its_place(flaw, tmp_path):
    read, name, content, message = BROKEN[flaw]
    if name.endswith((".nc", ".parquet")):
        pytest.importorskip("xarray" if name.endswith(".nc") else "pyarrow")
    path = tmp_path / name
    path.write_bytes(content)
    assert message in str(refused(read, path))


def test_broken_netcdf_and_parquet_are_refused_with_their_place(tmp_path):
    for package in ("xarray", "netCDF4", "pyarrow"):
        pytest.importorskip(package)
    for name, content, message in records.binary().values():
        (tmp_path / name).write_bytes(content)
        assert message in str(refused(read_record, tmp_path / name))


# What no format is: the readers of text share one check.
@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda content: b"", "empty|no windIO"),
        (lambda content: content.decode().encode("utf-16"), "line 1: is not UTF-8 text"),
        (lambda content: content[:60] + b"\xe4" + content[60:], "line [1-9]: is not UTF-8 text"),
        (lambda content: content + bytes(50), "line [0-9]+: is not UTF-8 text"),
    ],
    ids=["empty", "UTF-16", "Latin-1", "null characters"],
)
def test_a_file_that_is_no_text_is_refused(name, spoil, message, tmp_path):
    read, content = SOUND[name]
    (tmp_path / name).write_bytes(spoil(content))
    with pytest.raises(InputError, match=message):
        read(tmp_path / name)


PIECES = ["", *"0 -1 1e400 nan [] {} null *grid !!x ' \"".split(), "&grid ", "\n"]
PIECES += ["\t", ":", "- ", ",", "#", "1e-320", "{a: 1}", "[1]", "é", "\ufeff", "...", "4", "\r"]
SPOT = st.tuples(st.floats(0.0, 1.0), st.integers(0, 60), st.sampled_from(PIECES), st.booleans())
DAMAGE = st.lists(SPOT, min_size=1, max_size=3)


@pytest.mark.parametrize("name", SOUND)
@examples(40)
@given(damage=DAMAGE)
def test_damage_is_read_or_refused(name, damage, tmp_path):
    read, content = SOUND[name]
    text = content.decode()
    for share, length, piece, again in damage:
        at = int(share * len(text))
        piece += text[at : at + length] * again
        text = text[:at] + piece + text[at + length * (not again) :]
    path = tmp_path / name
    path.write_bytes(text.encode())
    try:
        read(path)
    except InputError:
        refused(read, path)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_is_read_as_python_writes_it(number):
    assert parse_number(repr(number)) == number


@given(st.text(max_size=12))
def test_what_is_no_plain_number_is_none(text):
    for word in (*"1e999 nan inf 1_0 ٣ 0x10".split(), " 1", ""):
        assert parse_number(word) is None
    number = parse_number(text)
    if number is None:
        assert not text.isascii() or not text.replace(".", "", 1).isdigit()
    else:
        assert number == float(text.lower().replace("d", "e"))
        assert text.isascii()
        assert text == text.strip()
        assert "_" not in text


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_table_has_any_line_ends_remarks_and_further_columns(end, tmp_path):
    text = end.join(["# a remark", "b, a ,c", "", "7,1,x", " -.5 ,2,y", ""])
    table = Csv(text, tmp_path, "a,b").columns(("a", "b"), "result")
    assert table["a"].values.tolist() == [1.0, 2.0]
    assert table["b"].values.tolist() == [7.0, -0.5]
    assert table["b"].keys == ["line 4, column b", "line 5, column b"]
    with pytest.raises(InputError, match="line 4, column b = 'nan': must be a finite number"):
        Csv(text.replace("7", "nan"), tmp_path, "a,b").columns(("a", "b"), "result")
    with pytest.raises(InputError, match="has a header but no rows"):
        Csv(f"a,b{end}", tmp_path, "a").columns(("a",), "result")
