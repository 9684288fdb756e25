"""Predicted standard errors beside the scatter of seeded runs on the virtual lab.

    cargo build --release -p mapper-cli
    python3 benches/planner_scatter.py target/release/mapper [RUNS]

Four points of campaigns/turbo_a.yaml at one opening; each seed draws noise and fixed offsets again. Prints, for each step,
what the plan says and what 200 runs scatter.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

REPLACED = [
    ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [65 krpm, 125 krpm, 95 krpm, 140 krpm]"),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [1.0]"),
    ("order: information ", "repeats: off\norder: listed "),
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
        found = [[] for _ in planned["steps"]]
        for seed in range(1, runs + 1):
            campaign.write_text(text.replace("seed: 1 ", f"seed: {seed} "))
            command = [mapper, "run", campaign, "--json", "--out", pathlib.Path(folder) / "runs"]
            points = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["points"]
            for etas, point in zip(found, points):
                etas.append(point["eta"])
    print("| step to | predicted sigma_eta, points | scatter, points | ratio |\n|---|---:|---:|---:|")
    for step, etas in list(zip(planned["steps"], found))[1:]:
        predicted, scatter = 100 * step["predicted"]["sigma_eta"], 100 * statistics.stdev(etas)
        name = f"{step['speed_rpm'] / 1e3:g} krpm at {step['valve']}"
        print(f"| {name} | {predicted:.2f} | {scatter:.2f} | {scatter / predicted:.2f} |")


if __name__ == "__main__":
    main()
