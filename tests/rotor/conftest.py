"""What the rotor's tests share."""

import importlib

import numpy as np
import pytest


@pytest.fixture(scope="session")
def study():
    """Return studies/compare_ccblade.py, whose rotors and comparison the tests use too."""
    return importlib.import_module("compare_ccblade")


@pytest.fixture(scope="session")
def ideal_polar(study):
    """Return a thin section without drag: cl = 2 pi sin(alpha)."""
    alpha = np.linspace(-np.pi, np.pi, 721)
    return study.circle_polar(alpha, 2.0 * np.pi * np.sin(alpha), np.zeros(alpha.size))
