"""What the rotor's tests share."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="session")
def study():
    """Return scripts/compare_ccblade.py, whose rotors and comparison the tests use too."""
    path = Path(__file__).resolve().parents[2] / "scripts" / "compare_ccblade.py"
    specification = importlib.util.spec_from_file_location("compare_ccblade", path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def ideal_polar(study):
    """Return a thin section without drag: cl = 2 pi sin(alpha)."""
    alpha = np.linspace(-np.pi, np.pi, 721)
    return study.circle_polar(alpha, 2.0 * np.pi * np.sin(alpha), np.zeros(alpha.size))
