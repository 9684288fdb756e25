"""Asks an FMU of `mapper map fmu` at points of a map, driven: speed and outlet pressure are inputs, the library is the FMU's own.

Usage: drive_fmu.py FMU POINTS.json [name=value ...]. POINTS: a list of objects with speed_rpm, t1_k, p1_pa and pressure_ratio; names and values are further
start values. Prints as JSON what FMPy's validation finds, and for each point flow, efficiency, h, and both housings after an hour there.
"""

import json
import sys

from fmpy import extract, instantiate_fmu, read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

FMU = sys.argv[1]
OUTPUTS = ["m_corrected", "eta", "h", "N", "P2", "Tc", "Tt", "W_c"]


def main():
    with open(sys.argv[2]) as file:
        points = json.load(file)
    further = {name: float(value) for name, value in (argument.split("=") for argument in sys.argv[3:])}
    folder = extract(FMU)
    description = read_model_description(folder)
    # One library for all points: it is reset between them.
    instance = instantiate_fmu(folder, description, "CoSimulation")
    found = []
    for point in points:
        start = {"driven": True, "N_set": point["speed_rpm"], "P2_set": point["pressure_ratio"] * point["p1_pa"], "T1": point["t1_k"],
                 "P1": point["p1_pa"], **further}
        result = simulate_fmu(folder, model_description=description, fmu_instance=instance, stop_time=3600.0, step_size=3600.0, output_interval=3600.0,
                              start_values=start, output=OUTPUTS)
        instance.reset()
        found.append({name: float(result[name][-1]) for name in OUTPUTS})
    instance.freeInstance()
    print(json.dumps({"problems": validate_fmu(FMU), "description": description.description, "points": found}))


main()
