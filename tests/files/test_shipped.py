"""What is shipped is read by its name; an unknown name is told with the names that there are."""

import numpy as np
import pytest
from study_common import shipped_table

from hkt_mdo.errors import InputError
from hkt_mdo.files.outline import read_outline
from hkt_mdo.files.shipped import data_path, locate, shipped_names

COLUMNS = {
    "polar": ("alpha_deg", "cl", "cd", "cm"),
    "outline": ("x_over_c", "y_over_c"),
    "measurement": ("TSR", "Cp"),
    "thrust": ("TSR", "Ct"),
}


@pytest.mark.parametrize("kind", COLUMNS)
def test_shipped_tables_are_read(kind):
    for name in shipped_names(kind):
        table = shipped_table(name, kind)
        assert table.dtype.names[: len(COLUMNS[kind])] == COLUMNS[kind]
        assert all(np.all(np.isfinite(table[column])) for column in COLUMNS[kind])


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
        read_outline(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_unknown_shipped_names_are_reported_with_those_there_are(tmp_path):
    told = r"did you mean naca63815_Re2e5\?.*shipped: naca63815_Re1e5, "
    with pytest.raises(InputError, match=told):
        data_path("naca63815_Re2e55", "polar")
    with pytest.raises(InputError, match="neither a shipped blade nor a file"):
        locate(tmp_path / "none.csv", "blade")
