"""Predicted standard errors beside the scatter of seeded runs on the virtual lab.

    cargo build --release -p mapper-cli
    python3 benches/planner_scatter.py target/release/mapper [RUNS]

Twelve points of campaigns/turbo_a.yaml by the joint method after its zero, 40 s each; each seed draws noise, offsets and the
soak's evenness again. Prints, for each step, what the plan says and by how much 200 runs err (rms).
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

REPLACED = [
    ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [50 krpm, 125 krpm, 80 krpm, 155 krpm]"),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
    ("order: information ", "repeats: off\norder: listed "),
    ("required_sigma_eta: 0.5 %\n", ""),
    ("dwell: 120 s ", "dwell: 40 s "),
]


def main():
    mapper, runs = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 200
    shipped = pathlib.Path(__file__).parent.parent / "campaigns/turbo_a.yaml"
    text = shipped.read_text()
    for old, new in REPLACED:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        campaign = pathlib.Path(folder) / "campaign.yaml"
        campaign.write_text(text)
        planned = json.loads(subprocess.run([mapper, "plan", campaign, "--json"], check=True, capture_output=True).stdout)
        errors = [[] for _ in planned["steps"]]
        for seed in range(1, runs + 1):
            campaign.write_text(text.replace("seed: 1 ", f"seed: {seed} "))
            command = [mapper, "run", campaign, "--json", "--out", pathlib.Path(folder) / "runs"]
            points = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["points"]
            for found, point in zip(errors, points):
                found.append(point["eta"] - point["truth"]["eta"])
    print("| step to | predicted sigma_eta, points | rms error, points | ratio |\n|---|---:|---:|---:|")
    total = [0.0, 0.0]
    for step, found in zip(planned["steps"], errors):
        predicted, scatter = 100 * step["predicted"]["sigma_eta"], 100 * math.sqrt(sum(e * e for e in found) / len(found))
        total = [total[0] + predicted**2, total[1] + scatter**2]
        name = f"{step['speed_rpm'] / 1e3:g} krpm at {step['valve']}"
        print(f"| {name} | {predicted:.2f} | {scatter:.2f} | {scatter / predicted:.2f} |")
    predicted, scatter = (math.sqrt(t / len(errors)) for t in total)
    print(f"| all, rms | {predicted:.2f} | {scatter:.2f} | {scatter / predicted:.2f} |")


if __name__ == "__main__":
    main()
