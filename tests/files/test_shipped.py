"""What is shipped is read by its name; an unknown name is told with the names that there are."""

import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path, locate


def test_unknown_shipped_names_are_reported_with_those_there_are(tmp_path):
    told = r"did you mean naca63815_Re2e5\?.*shipped: naca63815_Re1e5, "
    with pytest.raises(InputError, match=told):
        data_path("naca63815_Re2e55", "polar")
    with pytest.raises(InputError, match="neither a shipped blade nor a file"):
        locate(tmp_path / "none.csv", "blade")
