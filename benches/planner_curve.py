"""Forecast error against minutes, for all orders: how long a map takes by how certain it has to be.

    cargo build --release -p mapper-cli
    python3 benches/planner_curve.py target/release/mapper [CAMPAIGN] [ERRORS]

By the joint method after a zero; ERRORS are required open errors in points, e.g. `2,1,0.5`. One row for each order and error: minutes of
the steps, the open error (rms) that they reach, and the standard error of the worst point on a machine as declared. Half the width of a
95 % interval is twice that.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
ZERO = "zero: {soak: 30 min, evenness: 0.01 K, pressure_evenness: 1 Pa}"


def campaign(name, error):
    text = (ROOT / "campaigns" / f"{name}.yaml").read_text()
    text = re.sub(r"(?m)^(zero|order|required_sigma_eta):.*\n", "", text)
    text = re.sub(r"(?m)^  (warm_up|method|window):.*\n", "", text)
    text = re.sub(r"(?m)^timing:.*$", "timing:\n  warm_up: 2 min", text)
    text = re.sub(r"(?m)^identification:.*$", "identification:\n  method: joint", text)
    return text + f"\n{ZERO}\norder: information\nrequired_sigma_eta: {error} %\n"


def main():
    mapper = sys.argv[1]
    name = sys.argv[2] if len(sys.argv) > 2 else "grid18"
    errors = sys.argv[3] if len(sys.argv) > 3 else "3,2,1.5,1,0.8"
    print("| order | required, points | minutes | open error, rms | worst point, as declared |\n|---|---:|---:|---:|---:|")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for error in errors.split(","):
            path = pathlib.Path(folder) / f"{name}.yaml"
            path.write_text(campaign(name, error))
            command = [mapper, "plan", path, "--compare", "--json"]
            compared = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["comparison"]
            for way in compared["orders"]:
                percent = lambda key: f"{100 * way[key]:.2f}"
                rows.append([way["name"], error, f"{way['minutes']:.0f}", percent("open_rms_error_eta"), percent("worst_error_eta")])
    for row in sorted(rows, key=lambda row: (row[0], -float(row[1]))):
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
