"""A rotor's equation of motion under the real ROSCO, in a process of its own.

``python rosco_run.py INPUT.npz OUTPUT.npz``: the library keeps its state for as long as it is
loaded, so that one process runs one flow. INPUT has `library` and `discon` (paths), `step` (s),
`flow` (m/s) at the steps, `ratio` and `coefficient` (the torque coefficient's table), `scale`
(torque over coefficient and flow squared, N s²/m), `radius` (m), `inertia` (kg m²), `speed` at the
start (rad/s) and `blades`; OUTPUT has the rotor speed and the torque that ROSCO demands at the
steps. The torque is held in between.
"""

import ctypes
import sys

import numpy as np
from scipy.interpolate import CubicSpline

# places in the array of the Bladed interface, which is what DISCON takes
STATUS, TIME, STEP, ELECTRIC, SPEED, ROTOR, MEASURED, FLOW = 0, 1, 2, 14, 19, 20, 22, 26
DEMAND, MESSAGE, INFILE, OUTNAME, BLADES = 46, 48, 49, 50, 60
PARTS = 4  # of a step, for the integration


class Controller:
    def __init__(self, library, discon, step, blades):
        self.call = ctypes.CDLL(library).DISCON
        self.swap = np.zeros(1200, dtype=np.float32)
        self.failed, self.message = ctypes.c_int32(0), ctypes.create_string_buffer(1025)
        self.discon, self.name = discon.encode(), b"run"
        self.swap[STEP], self.swap[BLADES] = step, blades
        self.swap[MESSAGE], self.swap[OUTNAME] = 1024, len(self.name) + 1
        self.swap[INFILE] = len(self.discon) + 1

    def torque(self, number, speed, flow):
        """Return the torque that is demanded at a step, N m."""
        self.swap[STATUS], self.swap[TIME] = min(number, 1), number * self.swap[STEP]
        self.swap[SPEED] = self.swap[ROTOR] = speed
        self.swap[FLOW] = flow
        self.swap[MEASURED] = self.swap[DEMAND]
        self.swap[ELECTRIC] = self.swap[DEMAND] * speed
        data = self.swap.ctypes.data_as(ctypes.POINTER(ctypes.c_float))
        self.call(data, ctypes.byref(self.failed), self.discon, self.name, self.message)
        if self.failed.value < 0:
            sys.exit(f"ROSCO: {self.message.value.decode(errors='replace')}")
        return float(self.swap[DEMAND])


def main(data):
    step, flow = float(data["step"]), data["flow"]
    curve = CubicSpline(data["ratio"], data["coefficient"])
    radius, scale, inertia = (float(data[name]) for name in ("radius", "scale", "inertia"))
    controller = Controller(str(data["library"]), str(data["discon"]), step, int(data["blades"]))
    middle = CubicSpline(np.arange(flow.size), flow)  # the flow within a step

    def rate(speed, at, torque):
        now = float(middle(at))
        return (scale * now**2 * float(curve(speed * radius / now)) - torque) / inertia

    speed, speeds, torques = float(data["speed"]), [], []
    for number, now in enumerate(flow):
        torque = controller.torque(number, speed, now)
        speeds.append(speed)
        torques.append(torque)
        width = step / PARTS
        for part in range(PARTS):  # Runge and Kutta's method of fourth order
            at = number + part / PARTS
            one = rate(speed, at, torque)
            two = rate(speed + 0.5 * width * one, at + 0.5 / PARTS, torque)
            three = rate(speed + 0.5 * width * two, at + 0.5 / PARTS, torque)
            four = rate(speed + width * three, at + 1.0 / PARTS, torque)
            speed += width / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return np.array(speeds), np.array(torques)


if __name__ == "__main__":
    source, target = sys.argv[1:]
    speeds, torques = main(np.load(source))
    np.savez(target, speed=speeds, torque=torques)
