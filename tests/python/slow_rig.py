"""The small rig of plugins/drivers/python with the actuators of a real stand: dead time, lag and rate of P3, and those, play and dead band of the valve."""

import collections
import importlib.machinery
import importlib.util
import math
import pathlib
import sys

drivers = pathlib.Path(__file__).resolve().parents[2] / "plugins/drivers/python"
sys.path.insert(0, str(drivers))
loader = importlib.machinery.SourceFileLoader("rig", str(drivers / "mapper-backend-python_rig"))
rig_module = importlib.util.module_from_spec(importlib.util.spec_from_loader("rig", loader))
loader.exec_module(rig_module)
DT = 1.0 / rig_module.RATE_HZ


class Actuator:
    """In steps of a sample: dead band of the command, dead time, lag and rate of the drive, play between drive and output."""

    def __init__(self, value, lag, rate, dead_time=0.0, play=0.0, dead_band=0.0):
        self.lag, self.rate, self.play, self.dead_band = lag, rate, play, dead_band
        self.drive = self.output = self.taken = value
        self.late = collections.deque([value] * round(dead_time / DT))

    def follow(self, command):
        if abs(command - self.taken) >= self.dead_band:
            self.taken = command
        self.late.append(self.taken)
        change = (self.late.popleft() - self.drive) * (1.0 - math.exp(-DT / self.lag))
        self.drive += max(-self.rate * DT, min(self.rate * DT, change))
        self.output = max(self.drive - 0.5 * self.play, min(self.drive + 0.5 * self.play, self.output))
        return self.output


class SlowRig(rig_module.PythonRig):
    """`actuators`: {"p3": {"lag": 3.0, "rate": 20e3, "dead_time": 0.5}, "valve": {"lag": 0.5, "rate": 0.5, "play": 0.02, "dead_band": 0.005}}, in SI."""

    P3_LAG_S = DT / rig_module.INNER

    def __init__(self, settings, actuators):
        super().__init__(settings)
        self.p3_of, self.valve_of = Actuator(rig_module.P4, **actuators["p3"]), Actuator(1.0, **actuators["valve"])

    def step(self):
        commanded, air = self.commanded or {}, self.air
        p3 = self.p3_of.follow(commanded.get("p3_pa", rig_module.P4) if air else rig_module.P4)
        opening = self.valve_of.follow(commanded.get("valve_opening_ratio", 1.0))
        self.commanded, self.air = commanded | {"p3_pa": p3, "valve_opening_ratio": opening}, air or p3 > 1.01 * rig_module.P4
        readings = super().step()
        self.commanded, self.air = commanded or None, air
        return readings


def make(settings, actuators=None):
    """The rig of the driver, or one whose actuators are slower."""
    return SlowRig(settings, actuators) if actuators else rig_module.PythonRig(settings)
