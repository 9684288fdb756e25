"""Whether two stands with other climates, humidity and sensors agree on one machine: E_n = |a - b| / sqrt(Ua^2 + Ub^2), at most 1.

    python3 benches/two_stands.py PROGRAM SEEDS

Both run campaigns/turbo_a.yaml on the virtual lab, the second one at the same corrected speeds.
"""

import json
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from machines import ROOT, half, replaced

T1_K, OTHER_T1_K = 298.15, 308.15


def other_stand(text):
    faster = math.sqrt(OTHER_T1_K / T1_K)
    speeds = re.search(r"  speeds: \[(.*)\]", text)
    scaled = ", ".join(f"{float(one.split()[0]) * faster:.4f} krpm" for one in speeds.group(1).split(","))
    text = replaced(text, speeds.group(0), f"  speeds: [{scaled}]")
    for old, new in [
        ("inlet_temperature: 25 degC", "inlet_temperature: 35 degC"),
        ("inlet_pressure: 100 kPa", "inlet_pressure: 92 kPa"),
        ("ambient_temperature: 25 degC", "ambient_temperature: 35 degC"),
        ("barometer: 100.0 kPa", "barometer: 92.0 kPa"),
        ("humidity: 50 %", "humidity: 80 %"),
        ("m_c:   {noise: 1.5e-4 kg/s, gain: 0.5 %}", "m_c:   {noise: 3e-4 kg/s, gain: 1 %}"),
        ("T2:    {noise: 0.1 K, offset: 0.25 K", "T2:    {noise: 0.2 K, offset: 0.5 K"),
        ("P2:    {noise: 60 Pa, offset: 100 Pa", "P2:    {noise: 120 Pa, offset: 200 Pa"),
    ]:
        text = replaced(text, old, new)
    return text


def points(program, text, folder, name):
    file = Path(folder) / f"{name}.yaml"
    file.write_text(text)
    command = [program, "run", file, "--out", folder, "--json"]
    results = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    good = [p for p in results["points"] if p["verdict"] == "good" and p["kind"] == "point"]
    return {(round(p["speed_corrected_rpm"], -3), p["valve"]): p for p in good}


def main(program, seeds):
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    ratios = []
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            a = points(program, replaced(text, "seed: 1 ", f"seed: {seed} "), folder, "a")
            b = points(program, replaced(other_stand(text), "seed: 1 ", f"seed: {seed + 1000} "), folder, "b")
        for place in a.keys() & b.keys():
            one, other = a[place], b[place]
            expanded = math.hypot(half(one), half(other))
            ratios.append(abs(100 * (one["eta"] - other["eta"])) / expanded)
    share = sum(ratio <= 1 for ratio in ratios) / len(ratios)
    print(f"{len(ratios)} points of {seeds} pairs: E_n of the efficiency at most 1 at {100 * share:.1f} %, largest {max(ratios):.2f}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
