"""How processor time and memory of each kind of work grow with its size.

    cargo build --release --locked
    python benches/scale.py target/release/mapper [KIND ...]

Kinds: plan, identify, diagnose, log, map, nightly, fleet; all of them if none is named. The exponent is that of the time over the size, from the row
before: 1 is proportional.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

from log_speed import CAMPAIGN as LOG_CAMPAIGN
from log_speed import measured
from log_speed import write as write_log
from machines import ROOT, closed_form, replaced

SPEEDS = "  speeds: [50 krpm, 70 krpm, 90 krpm, 110 krpm, 130 krpm, 150 krpm]\n  openings: [0.5, 0.7, 1.0]"


def grid(folder, points, dwell_s=60):
    """grid18 with about so many points: speeds from 50 to 150 krpm, openings from 0.5 to 1."""
    speeds = max(3, round(math.sqrt(2 * points)))
    openings = max(2, round(points / speeds))
    listed = ", ".join(f"{50 + 100 * i / (speeds - 1):.4g} krpm" for i in range(speeds))
    opened = ", ".join(f"{0.5 + 0.5 * i / (openings - 1):.5g}" for i in range(openings))
    text = (ROOT / "campaigns/grid18.yaml").read_text()
    text = replaced(text, SPEEDS, f"  speeds: [{listed}]\n  openings: [{opened}]")
    text = replaced(text, "warm_up: 60 min", "warm_up: 5 min")
    text = replaced(text, "dwell: 120 s", f"dwell: {dwell_s} s")
    text = replaced(text, "window: {start: 10 s, end: 110 s}", f"window: {{start: 10 s, end: {dwell_s - 5} s}}")
    text = replaced(text, "method: dynamic", "method: joint")
    path = folder / f"grid{points}.yaml"
    path.write_text(text)
    return path, speeds * openings


def recorded(mapper, folder, points):
    campaign, count = grid(folder, points)
    runs = folder / f"runs{points}"
    subprocess.run([mapper, "run", campaign, "--out", runs, "--progress", "off"], check=True, stdout=subprocess.DEVNULL)
    (run,) = runs.iterdir()
    return campaign, run, count


def plan(mapper, folder):
    for points in [20, 60, 200, 600, 1900]:
        campaign, count = grid(folder, points)
        yield count, measured(mapper, "plan", campaign, "--progress", "off")


def identify(mapper, folder):
    for points in [20, 60, 200, 600, 1900]:
        _, run, count = recorded(mapper, folder, points)
        yield count, measured(mapper, "identify", run, "--progress", "off")


def diagnose(mapper, folder):
    for points in [20, 60, 200]:
        campaign, run, count = recorded(mapper, folder, points)
        # A cause that is found ends with another code than 0.
        yield count, measured("sh", "-c", '"$@" || true', "sh", mapper, "gap", "diagnose", campaign, run, "--progress", "off")


def log(mapper, folder):
    for hours in [1, 3, 10]:
        path = folder / "log.csv"
        write_log(path, hours)
        channels = folder / f"log{hours}.yaml"
        measured(mapper, "log", "inspect", path, "--write-channels", channels)
        yield hours, measured(mapper, "identify", path, "--channels", channels, "--campaign", LOG_CAMPAIGN, "--method", "steady")
        path.unlink()


def fit(mapper, folder):
    for points in [20, 60, 200, 600, 2000]:
        lines = max(4, round(math.sqrt(points / 2)))
        each = round(points / lines)
        rows = ["speed_corrected_rpm,flow_corrected_kg_s,pressure_ratio,eta"]
        for line in range(lines):
            n_krpm = 50 + 120 * line / (lines - 1)
            *_, surge, choke = closed_form(n_krpm, 1.0, 0, 0)
            for k in range(each):
                ratio = choke + (surge - choke) * math.sin(0.5 * math.pi * (0.1 + 0.85 * k / (each - 1)))
                flow, eta, *_ = closed_form(n_krpm, ratio, 0, 0)
                rows.append(f"{1000 * n_krpm:.3f},{flow:.8f},{ratio:.8f},{eta:.8f}")
        path = folder / f"map{points}.csv"
        path.write_text("\n".join(rows) + "\n")
        yield lines * each, measured(mapper, "map", "fit", path, "--reference", "SAE", "--out", folder / f"fit{points}.json")


def nightly(mapper, folder):
    for seeds in [1, 4, 16, 64]:
        path = folder / f"nightly{seeds}.yaml"
        campaign = grid(folder, 20)[0].name
        runs = f"runs:\n  - campaign: {campaign}\n    methods: [steady]\n    seeds: {list(range(1, seeds + 1))}\n"
        path.write_text(f"nightly: scale\nhistory: {folder}/history{seeds}.db\nband: {{nights: 14}}\n{runs}")
        yield seeds, measured(mapper, "nightly", path, "--progress", "off")


def fleet(mapper, folder):
    for items in [10, 100, 1000, 10_000]:
        path = folder / f"fleet{items}.yaml"
        campaign = grid(folder, 20)[0].name
        path.write_text(f"fleet: scale\nstudy: maps\ncampaigns: [{campaign}]\nseeds: {list(range(1, items + 1))}\nmethods: [steady]\n")
        out = folder / f"fleet{items}"
        made = measured(mapper, "fleet", "make", path, "--out", out)
        listed = measured(mapper, "fleet", "status", out)
        yield items, (made[0] + listed[0], max(made[1], listed[1]))


KINDS = {
    "plan": ("points", plan),
    "identify": ("steps, `joint`", identify),
    "diagnose": ("steps", diagnose),
    "log": ("hours of 24 channels at 100 Hz", log),
    "map": ("points", fit),
    "nightly": ("maps of 20 points", nightly),
    "fleet": ("items made and listed", fleet),
}


def main():
    mapper = Path(sys.argv[1]).resolve()
    for kind in sys.argv[2:] or KINDS:
        unit, work = KINDS[kind]
        print(f"\n{kind}\n\n| {unit} | s of processor time | exponent | MB |\n|---:|---:|---:|---:|", flush=True)
        before = None
        with tempfile.TemporaryDirectory() as folder:
            for size, (time_s, memory_mb) in work(mapper, Path(folder)):
                exponent = "" if before is None else f"{math.log(time_s / before[1]) / math.log(size / before[0]):.2f}"
                print(f"| {size} | {time_s:.2f} | {exponent} | {memory_mb:.0f} |", flush=True)
                before = (size, time_s)


if __name__ == "__main__":
    main()
