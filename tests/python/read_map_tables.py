"""Reads exported simulation tables as their programs do, without a line of ours, and looks values up in them.

Arguments: Modelica text, NPSS map, pyCycle module, MATLAB script, then "speed,beta" pairs. Prints JSON: for each format the
axes, and [flow, pressure ratio, efficiency] at each pair by bilinear interpolation.
"""

import json
import re
import runpy
import sys

import numpy as np
from scipy.interpolate import RegularGridInterpolator


def modelica(path):
    lines = open(path, encoding="utf-8").read().splitlines()
    assert lines[0] == "#1", "Modelica Standard Library: the first line must be #1"
    tables, i = {}, 0
    while i < len(lines):
        head = re.match(r"double (\w+)\((\d+),(\d+)\)", lines[i])
        i += 1
        if head is None:
            assert lines[i - 1].startswith("#"), lines[i - 1]
            continue
        rows, columns = int(head[2]), int(head[3])
        values = np.array([[float(v) for v in line.split()] for line in lines[i : i + rows]])
        assert values.shape == (rows, columns)
        tables[head[1]] = values
        i += rows
    first = tables["flow_corrected_kg_s"]
    return first[1:, 0], first[0, 1:], [tables[n][1:, 1:] for n in ("flow_corrected_kg_s", "pressure_ratio", "eta")]


def npss(path):
    text = re.sub(r"//.*", "", open(path, encoding="utf-8").read())
    fields = []
    for name, field in (("TB_Wc", "Wc"), ("TB_PR", "PR"), ("TB_eff", "eff")):
        body = text.split(f"Table {name}(real beta, real Nc) {{")[1]
        blocks = re.findall(r"beta = (\S+) \{\s*Nc = \{([^}]*)\}\s*" + field + r" = \{([^}]*)\}\s*\}", body.split("Table ")[0])
        betas = np.array([float(b[0]) for b in blocks])
        speeds = np.array([float(v) for v in blocks[0][1].split(",")])
        fields.append(np.array([[float(v) for v in b[2].split(",")] for b in blocks]).T)
    return speeds, betas, fields


def pycycle(path):
    m = runpy.run_path(path)["compressor"]
    # As pyCycle 4 reads it (pycycle/elements/compressor_map.py): names, values, defaults and units from two lists.
    axes = {p["name"]: p["values"] for p in m.param_data}
    assert list(axes) == ["alphaMap", "NcMap", "RlineMap"]
    for p in m.param_data:
        assert p["values"][0] <= p["default"] <= p["values"][-1], p["name"]
    units = {d["name"]: d["units"] for d in m.param_data + m.output_data}
    assert units == {"alphaMap": None, "NcMap": "rpm", "RlineMap": None, "WcMap": "kg/s", "effMap": None, "PRmap": None}
    outputs = {o["name"]: o["values"] for o in m.output_data}
    shape = tuple(a.size for a in axes.values())
    for table in outputs.values():
        assert table.shape == shape, (table.shape, shape)
    assert m.RlineStall == m.RlineMap[0] and np.all(np.diff(m.RlineMap) > 0)
    # Rline 1 at surge, 3 at choke; beta 1 at surge, 0 at choke.
    betas = (3.0 - m.RlineMap) / 2.0
    return m.NcMap, betas[::-1], [outputs[n][0][:, ::-1] for n in ("WcMap", "PRmap", "effMap")]


def simscape(path):
    text = re.sub(r"%.*", "", open(path, encoding="utf-8").read())
    values = {}
    for name, body in re.findall(r"(\w+) = \[([^\]]*)\];", text):
        values[name] = np.array([[float(v) for v in line.split()] for line in body.splitlines() if line.split()])
    speeds, betas = values["corrected_speed_rpm"][0], values["beta"][0]
    for name in ("corrected_flow_of_pr_kg_s", "efficiency_of_pr"):
        assert values[name].shape == (speeds.size, values["pressure_ratio_axis"].size)
    return speeds, betas, [values[n] for n in ("corrected_flow_kg_s", "pressure_ratio", "isentropic_efficiency")]


def main():
    pairs = [tuple(map(float, pair.split(","))) for pair in sys.argv[5:]]
    out = {}
    for name, reader, path in zip(("modelica", "npss", "pycycle", "simscape"), (modelica, npss, pycycle, simscape), sys.argv[1:5]):
        speeds, betas, tables = reader(path)
        assert np.all(np.diff(speeds) > 0) and np.all(np.diff(betas) > 0)
        assert all(np.all(np.isfinite(t)) and np.all(t > 0) for t in tables)
        looked_up = [RegularGridInterpolator((speeds, betas), table)(pairs).tolist() for table in tables]
        out[name] = {"speeds": speeds.tolist(), "betas": betas.tolist(), "values": np.array(looked_up).T.tolist()}
    json.dump(out, sys.stdout)


main()
