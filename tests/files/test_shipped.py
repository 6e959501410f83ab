"""What is shipped is read by its name; an unknown name is told with the names that there are."""

import numpy as np
import pytest
from study_common import shipped_table

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import locate, shipped_names

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


def test_unknown_shipped_names_are_reported_with_those_there_are():
    told = r"did you mean naca63815_Re2e5\?.*shipped: .*naca63815_Re1e5, "
    with pytest.raises(InputError, match=told):
        locate("naca63815_Re2e55", "polar")
