"""Builds an FMI 2.0 co-simulation FMU with pythonfmu: the small rig of plugins/drivers/python as a model, with names of its own.

Usage: build_fmu.py FILE. Variables: shaft.n, comp.m_flow, ... (see OUTPUTS), inputs p3_set (kPa), t3_set (degC), valve_set, oil_set (K), air.
Prints the settings of mapper-backend-fmu for it, as JSON.
"""

import json
import pathlib
import shutil
import sys
import tempfile

from pythonfmu.builder import FmuBuilder

OUTPUTS = {"N": "shaft.n", "m_c": "comp.m_flow", "P1": "comp.p_in", "T1": "comp.t_in", "P2": "comp.p_out", "T2": "comp.t_out", "Tc": "comp.t_wall",
           "m_t": "turb.m_flow", "P3": "turb.p_in", "T3": "turb.t_in", "P4": "turb.p_out", "T4": "turb.t_out", "Tt": "turb.t_wall",
           "T_oil": "oil.t", "T_amb": "ambient.t"}
KPA, DEGC = ("P1", "P2", "P3", "P4"), ("T1", "T2", "T3", "T4")
MODEL = '''
import pathlib, sys
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
sys.path.insert(0, str(pathlib.Path(__file__).parent))
import small_rig

OUTPUTS, KPA, DEGC = {outputs!r}, {kpa!r}, {degc!r}


class SmallRig(Fmi2Slave):
    author, description = "mapper tests", "a small turbocharger on a gas stand"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.seed, self.noise = 1.0, 1.0
        self.p3_set, self.t3_set, self.valve_set, self.oil_set, self.air = 110.0, 25.0, 1.0, 323.15, 0.0
        for name in ("seed", "noise"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("p3_set", "t3_set", "valve_set", "oil_set", "air"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        self.out = {{name: 0.0 for name in OUTPUTS}}
        for name, variable in OUTPUTS.items():
            self.register_variable(Real(variable, causality=Fmi2Causality.output, getter=lambda name=name: self.out[name]))

    def exit_initialization_mode(self):
        self.rig = small_rig.PythonRig({{"seed": int(self.seed), "noise": self.noise}})
        self.rig.arm()
        self.measure(0.0)

    def measure(self, t_s):
        mode = "running" if self.air >= 0.5 else "standstill"
        self.rig.set({{"mode": mode, "p3_pa": 1e3 * self.p3_set, "t3_k": self.t3_set + 273.15, "valve_opening_ratio": self.valve_set,
                      "oil_temperature_k": self.oil_set}})
        _, columns, _ = self.rig.poll(t_s + 1e-6)
        for name in OUTPUTS:
            if columns[name]:
                value = columns[name][-1]
                self.out[name] = value / 1e3 if name in KPA else value - 273.15 if name in DEGC else value

    def do_step(self, current_time, step_size):
        self.measure(current_time + step_size)
        return True
'''


def settings(path):
    """As a campaign writes them below `fmu`."""
    def place(name):
        more = {"scale": 1e3} if name in KPA else {"offset": 273.15} if name in DEGC else {}
        return {"variable": OUTPUTS[name], **more} if more else OUTPUTS[name]

    return {
        "fmu": str(path), "read": {name: place(name) for name in OUTPUTS},
        "write": {"p3": {"variable": "p3_set", "scale": 1e3}, "t3": {"variable": "t3_set", "offset": 273.15}, "valve": "valve_set",
                  "oil_temperature": "oil_set", "air": "air"},
        "accepts": {"p3": [50e3, 600e3], "t3": [250.0, 1100.0], "valve": [0.05, 2.5], "oil_temperature": [250.0, 450.0]},
    }


def main():
    path = pathlib.Path(sys.argv[1]).resolve()
    drivers = pathlib.Path(__file__).resolve().parents[2] / "plugins/drivers/python"
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        shutil.copy(drivers / "mapper-backend-python_rig", scratch / "small_rig.py")
        shutil.copy(drivers / "mapper_driver.py", scratch / "mapper_driver.py")
        (scratch / "small_model.py").write_text(MODEL.format(outputs=OUTPUTS, kpa=KPA, degc=DEGC))
        made = FmuBuilder.build_FMU(scratch / "small_model.py", dest=scratch / "out", project_files=[scratch / "small_rig.py", scratch / "mapper_driver.py"])
        shutil.copy(made, path)
    print(json.dumps(settings(path)))


main()
