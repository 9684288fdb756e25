"""Reads a map as other programs do, and writes one as users of MATLAB do.

Arguments: SAE text, workbook of Excel, new MATLAB file. Prints JSON: for SAE text the points and the surge line by the rules of two public
readers, for the workbook its sheets, for MATLAB the columns that were written.

EngineToolBox (github.com/KevinKSY/EngineToolBox, getCompressorDataSAE.m): four fields of ten characters from line 4; the rows after the last
one without a number are the surge line. OpenWAM (TSAEMap.cpp): four numbers between blanks in a row, a new line where the speed differs, flow
rising from surge to choke.
"""

import json
import re
import sys

import numpy as np
import openpyxl
import scipy.io

NUMBER = re.compile(r"[-]*(\d+\.\d*|\d*\.\d+|\d+)([eEdD][-+]*\d*)?")


def engine_tool_box(path):
    fields = []
    for line in open(path, encoding="utf-8").read().split("\n")[3:]:
        cells = [line[at : at + 10] for at in range(0, 40, 10)]
        found = [NUMBER.search(cell) for cell in cells]
        fields.append([float(match[0]) if match else None for match in found])
    while fields and fields[-1] == [None] * 4:
        fields.pop()
    gaps = [at for at, row in enumerate(fields) if row[0] is None]
    points = fields[: gaps[0]] if gaps else fields
    return {"points": points, "surge": fields[gaps[-1] + 1 :] if gaps else []}


def open_wam(path, count):
    words = iter(" ".join(open(path, encoding="utf-8").read().split("\n")[3:]).split())
    lines = []
    for _ in range(count):
        speed, mass, ratio, eta = (float(next(words)) for _ in range(4))
        if not lines or lines[-1][0][0] != speed:
            lines.append([])
        lines[-1].append([speed, mass, ratio, eta])
    return lines


def workbook(path):
    book = openpyxl.load_workbook(path)
    return {sheet.title: [list(row) for row in sheet.iter_rows(values_only=True)] for sheet in book}


def write_structure(path):
    """The structure of a public collection: columns of points, and the surge line in vectors of its own."""
    columns = {
        "RPM": [60000.0, 60000.0, 60000.0, 90000.0, 90000.0, 90000.0],
        "m_dot": [0.05, 0.06, 0.07, 0.07, 0.08, 0.09],
        "PR": [1.4, 1.38, 1.3, 1.9, 1.85, 1.7],
        "eff": [0.68, 0.72, 0.66, 0.7, 0.73, 0.68],
        "RPM_surge": [60000.0, 90000.0],
        "m_dot_surge": [0.045, 0.06],
        "PR_surge": [1.41, 1.92],
    }
    structure = {name: np.array(values)[:, None] for name, values in columns.items()}
    scipy.io.savemat(path, {"SAE_map_comp": {**structure, "model": "K27", "inertia": 3e-5}}, do_compression=True)
    return columns


def main():
    sae, xlsx, mat = sys.argv[1:4]
    fixed = engine_tool_box(sae)
    out = {
        "engine_tool_box": fixed,
        "open_wam": open_wam(sae, len(fixed["points"])),
        "workbook": workbook(xlsx),
        "structure": write_structure(mat),
    }
    json.dump(out, sys.stdout)


main()
