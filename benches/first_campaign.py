"""Random machines from `mapper init` to a map on the virtual lab: share of good points and coverage.

Usage: first_campaign.py PROGRAM MACHINES

Wheels of 35 to 90 mm; the machine's own map is that of a similar compressor (medium), with 20 % less flow and 2 points less efficiency
(narrow), or with 25 % more flow (wide). Each machine is run once with its own seed.
"""

import json
import random
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

SHAPES = {"medium": (1.0, 0.0), "narrow": (0.8, -0.02), "wide": (1.25, 0.0)}


def call(program, directory, *arguments):
    return subprocess.run([program, *arguments], cwd=directory, capture_output=True, text=True)


def own_map(text, flow_ratio, eta_change):
    rows = []
    for line in text.splitlines():
        fields = line.split(",")
        try:
            fields[1] = f"{flow_ratio * float(fields[1]):.6f}"
            fields[3] = f"{float(fields[3]) + eta_change:.5f}"
        except (IndexError, ValueError):
            pass
        rows.append(",".join(fields))
    return "\n".join(rows) + "\n"


def make_campaign(program, directory, number):
    """Campaign file, wheel diameter, shape and output of `mapper init` of the machine with this number."""
    draw = random.Random(number)
    wheel_mm = round(draw.uniform(35, 90), 1)
    shape = list(SHAPES)[number % len(SHAPES)]
    call(program, directory, "init", "similar", "--wheel", f"{wheel_mm}mm")
    similar = Path(directory, "similar_map.csv").read_text()
    Path(directory, "map.csv").write_text(own_map(similar, *SHAPES[shape]))
    made = call(program, directory, "init", "own", "--wheel", f"{wheel_mm}mm", "--map", "map.csv")
    campaign = Path(directory, "own.yaml")
    if not made.returncode:
        campaign.write_text(re.sub(r"^seed: 1 ", f"seed: {number + 1} ", campaign.read_text(), flags=re.M))
    return campaign, wheel_mm, shape, made


def machine(program, number):
    with tempfile.TemporaryDirectory() as directory:
        _, wheel_mm, shape, made = make_campaign(program, directory, number)
        if made.returncode:
            return wheel_mm, shape, 0, 0, 0, made.stderr
        run = call(program, directory, "run", "own.yaml", "--truth", "--json", "--progress", "off")
        points = json.loads(run.stdout).get("points", [])
        good = [p for p in points if p["verdict"] == "good"]
        covered = [p["eta_low"] <= p["truth"]["eta"] <= p["eta_high"] for p in good]
        errors = [100 * abs(p["eta"] - p["truth"]["eta"]) for p in good]
        return wheel_mm, shape, len(points), len(good), sum(covered), max(errors, default=float("nan"))


def main():
    program, machines = str(Path(sys.argv[1]).resolve()), int(sys.argv[2])
    shares, coverages = [], []
    for number in range(machines):
        wheel_mm, shape, points, good, covered, worst = machine(program, number)
        shares.append(good / points if points else 0.0)
        coverages.append(covered / good if good else 0.0)
        print(f"{number:3} {wheel_mm:5.1f} mm {shape:7} {good:3} of {points:3} good, {covered:3} covered, worst error {worst} points", flush=True)
    passed = sum(share >= 0.8 for share in shares)
    print(f"{passed} of {machines} machines with at least 80 % good points; coverage median {100 * statistics.median(coverages):.0f} %, lowest {100 * min(coverages):.0f} %")


if __name__ == "__main__":
    main()
