"""What the tests of motion share."""

import pytest

from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.rotor import bem


@pytest.fixture(scope="session")
def plant(blade, polar):
    """Return the Bahaj rotor of 4 kg m² in water, by direct BEM."""
    return Plant(blade, polar, 4.0, 1000.0, bem.rotor_coefficients)
