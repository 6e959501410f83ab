"""What is shipped is read by its name; an unknown name is told with the names that there are."""

import numpy as np
import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path, read_table, shipped_names

COLUMNS = {
    "polar": ("alpha_deg", "cl", "cd", "cm"),
    "outline": ("x_over_c", "y_over_c"),
    "measurement": ("TSR", "Cp"),
    "thrust": ("TSR", "Ct"),
}


@pytest.mark.parametrize("kind", COLUMNS)
def test_shipped_tables_are_read(kind):
    for name in shipped_names(kind):
        table = read_table(name, COLUMNS[kind], kind)
        assert tuple(table) == COLUMNS[kind]
        assert len({column.shape for column in table.values()}) == 1


def test_shipped_outline_has_the_area_its_source_states():
    outline = read_table("naca63815", ("x_over_c", "y_over_c"), "outline")
    x, y = outline["x_over_c"], outline["y_over_c"]
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert area == pytest.approx(0.094, abs=5e-4)


def test_table_takes_remarks_further_and_optional_columns(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("# source\ncd , cl,note,alpha_deg\n\n1e-2,.5,a,-3\n2e-2,0.6,b,4.\n", "utf-8")
    table = read_table(path, ("alpha_deg", "cl", "cd"), "polar", optional=("cm",))
    assert {name: list(column) for name, column in table.items()} == {
        "alpha_deg": [-3.0, 4.0],
        "cl": [0.5, 0.6],
        "cd": [0.01, 0.02],
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"x_over_c,y\n1,2\n", "line 1 = 'x_over_c,y': lacks the column y_over_c"),
        (b"x_over_c,y_over_c\n1,2\n3\n", "line 3 = '3': has 1 cells where the header has 2"),
        (b"x_over_c,y_over_c\n1,nan\n", "line 2, column y_over_c = 'nan': must be a finite number"),
        (b"x_over_c,y_over_c\n#" + b"x" * 16 * 1024**2, "larger than 16 MiB"),
    ],
    ids=["column", "cells", "number", "size"],
)
def test_bad_tables_are_reported_with_line_column_and_value(content, message, tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_table(path, ("x_over_c", "y_over_c"), "outline")
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_unknown_shipped_names_are_reported_with_those_there_are(tmp_path):
    told = r"did you mean naca63815_Re2e5\?.*shipped: naca63815_Re1e5, "
    with pytest.raises(InputError, match=told):
        data_path("naca63815_Re2e55", "polar")
    with pytest.raises(InputError, match="neither a shipped blade nor a file"):
        read_table(tmp_path / "none.csv", ("x",), "blade")
