"""Which horizon do the paper's tables imply? Ratios of the flows' energy content over horizons.

Captured energy is nearly proportional to the integral of v³ (docs/checks.md), whatever the turbine
and the water: the ratios of the redesigned energies of Table V to OLOC of Table IV depend on the
horizon and little else.
"""

import numpy as np

from hkt_mdo.dynamics.flows import SineInflow

PAPER = {"A": 414301 / 321316, "B": 310307 / 321316, "C": 321936 / 321316}
FLOWS = {
    "A": SineInflow(scale=1.1),
    "B": SineInflow(angular_frequency=0.225),
    "C": SineInflow(phase=0.2 * np.pi),
}


def content(flow, horizon):
    """Return the integral of v³ over a horizon (s)."""
    time = np.linspace(0.0, horizon, 20001)
    return np.trapezoid(flow.speed_at(time) ** 3, time)


def main():
    """Print the ratios over horizons beside the paper's."""
    design = SineInflow()
    print(
        "horizon / s   "
        + "   ".join(f"{name}/design" for name in FLOWS)
        + "   rms error of B, C / %"
    )
    for horizon in (30, 40, 45, 50, 52, 54, 56, 58, 59, 60, 61, 62, 64, 70, 80, 90, 100, 120):
        base = content(design, horizon)
        ratio = {name: content(flow, horizon) / base for name, flow in FLOWS.items()}
        error = np.sqrt(np.mean([(ratio[name] / PAPER[name] - 1.0) ** 2 for name in "BC"]))
        numbers = "   ".join(f"{ratio[name]:8.4f}" for name in FLOWS)
        print(f"{horizon:11d}   {numbers}   {100 * error:8.3f}")
    print("      paper   " + "   ".join(f"{PAPER[name]:8.4f}" for name in FLOWS))


if __name__ == "__main__":
    main()
