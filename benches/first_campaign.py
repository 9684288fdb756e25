"""Random machines from `mapper init` to a map on the virtual lab: share of good points and coverage.

Usage: first_campaign.py PROGRAM MACHINES

Each is also identified again with what the lab does not draw declared: alpha_A, probe and heating/cooling ratio fixed, dry air.
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
        campaign, wheel_mm, shape, made = make_campaign(program, directory, number)
        if made.returncode:
            return wheel_mm, shape, 0, None, None, made.stderr
        run = json.loads(call(program, directory, "run", "own.yaml", "--truth", "--json", "--progress", "off").stdout)
        known = campaign.read_text().replace("  method: joint ", "  joint: {alpha_area: fixed, probe: fixed, direction: fixed}\n  method: joint ")
        Path(directory, "known.yaml").write_text(known + "\nreport: {humidity: 0 %}\n")
        again = call(program, directory, "identify", run["run"], "--campaign", "known.yaml", "--truth", "--json")
        points = run["points"]
        return wheel_mm, shape, len(points), counted(points), counted(json.loads(again.stdout)["points"]), ""


def counted(points):
    """Good points, those that are covered, their largest error and mean half interval in points of efficiency."""
    good = [p for p in points if p["verdict"] == "good"]
    covered = [p["eta_low"] <= p["truth"]["eta"] <= p["eta_high"] for p in good]
    errors = [100 * abs(p["eta"] - p["truth"]["eta"]) for p in good]
    half = [50 * (p["eta_high"] - p["eta_low"]) for p in good]
    return len(good), sum(covered), max(errors, default=float("nan")), statistics.mean(half or [float("nan")])


def main():
    program, machines = str(Path(sys.argv[1]).resolve()), int(sys.argv[2])
    passed, total = 0, {"as written": [0, 0], "known": [0, 0]}
    for number in range(machines):
        wheel_mm, shape, points, *found, failed = machine(program, number)
        if failed:
            print(f"{number:3} {wheel_mm:5.1f} mm {failed}", flush=True)
            continue
        line = f"{number:3} {wheel_mm:5.1f} mm {shape:7}"
        for name, (good, covered, worst, half) in zip(total, found):
            total[name] = [total[name][0] + good, total[name][1] + covered]
            line += f" {name}: {good} of {points} good, {covered} covered, worst {worst:.2f}, +/- {half:.2f};"
        passed += found[0][0] >= 0.8 * points
        print(line, flush=True)
    shares = ", ".join(f"{name} {100 * covered / max(good, 1):.1f} % of {good}" for name, (good, covered) in total.items())
    print(f"{passed} of {machines} machines with at least 80 % good points; covered: {shares}")


if __name__ == "__main__":
    main()
