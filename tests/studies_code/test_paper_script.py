"""The reproduction's bookkeeping; the reproduction itself is `scripts/paper.py`."""

import paper
import pytest

from hkt_mdo.errors import InputError


def test_missing_cases_are_reported(tmp_path):
    with pytest.raises(InputError, match=r"--cases .* has no step_oloc\.yaml"):
        paper.reproduce(tmp_path / "out", tmp_path, 1, 2, 1, print)
    assert not (tmp_path / "out").exists()
