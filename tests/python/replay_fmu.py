"""Validates, compiles and steps an FMU of `mapper map fmu` with FMPy, and compares it with the reference tables.

Usage: replay_fmu.py FMU REFERENCE [--as-is]. REFERENCE: the folder with steady.csv, transients.csv and variants.csv. FMPy builds the sources with
CMake unless `--as-is` says that the FMU's own library is to be used. Prints as JSON: problems that FMPy's validation finds, rows and jumps that were
replayed, and the worst relative difference of each column.
"""

import csv
import json
import os
import pathlib
import shutil
import sys

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu

FMU, REFERENCE = sys.argv[1], pathlib.Path(sys.argv[2])
# Columns of the tables and what the FMU calls them.
COLUMNS = {"N_rpm": "N", "P2_Pa": "P2", "Tc_K": "Tc", "Tt_K": "Tt", "m_c": "m_c", "eta": "eta", "h": "h", "T1p_K": "T1_prime", "T2p_K": "T2_prime",
           "T2_K": "T2", "T2_read_K": "T2_probe", "m_t": "m_t", "T4_K": "T4"}


def rows(name):
    with open(REFERENCE / f"{name}.csv", newline="") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def jumps(name):
    found = []
    for row in rows(name):
        if row["t_s"] == 0.0:
            found.append([])
        found[-1].append(row)
    return found


def replay(folder, jump, p3_pa, worst):
    """One jump: from the first row's states under the target's P3, compared at each second after it."""
    first = jump[0]
    start = {"start.N": first["N_rpm"], "start.P2": first["P2_Pa"], "start.Tc": first["Tc_K"], "start.Tt": first["Tt_K"], "start.T_inner": first["Tc_K"],
             "compressor.alpha_area": first.get("alpha_A", 0.0), "probe.diameter": first.get("d_m", 0.0), "P3": p3_pa, "valve": first["valve"]}
    columns = [column for column in COLUMNS if column in first]
    result = simulate_fmu(folder, stop_time=110.0, step_size=1.0, output_interval=1.0, start_values=start, relative_tolerance=1e-10,
                          output=[COLUMNS[column] for column in columns])
    assert len(result) == len(jump), (len(result), len(jump))
    for row, found in list(zip(jump, result))[1:]:
        assert abs(found["time"] - row["t_s"]) < 1e-9
        for column in columns:
            difference = abs(found[COLUMNS[column]] / row[column] - 1.0)
            worst[column] = max(worst.get(column, 0.0), difference)
    return len(jump) - 1


def main():
    problems = validate_fmu(FMU)
    folder = extract(FMU)
    try:
        if "--as-is" not in sys.argv:
            # CMake comes with the tests' own Python.
            os.environ["PATH"] = f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
            binaries = pathlib.Path(folder) / "binaries"
            assert not binaries.exists(), "an FMU to be compiled holds no library"
            quiet, sink = os.dup(1), os.open(os.devnull, os.O_WRONLY)
            os.dup2(sink, 1)
            build_platform_binary(folder)
            os.dup2(quiet, 1)
        held = {(row["speed_rpm"], row["valve"]): row["P3_Pa"] for row in rows("steady")}
        report = {"problems": problems, "model": read_model_description(folder).modelName}
        for name in ("transients", "variants"):
            worst, compared = {}, 0
            for jump in jumps(name):
                compared += replay(folder, jump, held[jump[0]["to_rpm"], jump[0]["valve"]], worst)
            report[name] = {"jumps": len(jumps(name)), "rows": compared, "worst": worst}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(json.dumps(report))


main()
