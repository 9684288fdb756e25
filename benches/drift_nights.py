"""Drifts of the size that rigs have, over nights of the virtual lab, found by `mapper drift` or not.

usage: python3 benches/drift_nights.py PROGRAM FIRST_SEED COUNT [CAUSE...]

PROGRAM is the built `mapper`. A night is the campaign of the gap rig with six openings and eight minutes a point, 5 h 30 min
in total, the jump from 70 to 130 krpm made five times, on a rig with drawn tolerances and offsets in weather that wanders. Prints
one line a night on standard error and a table as Markdown. Needs nothing but Python; a night takes some 7 s of one core.
"""

import json
import pathlib
import random
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
HOUR_S = 3600.0
TWO_REPEATS_S = 2 * 9 * 480.0

# Name: cause, entry of the virtual lab's `drift:`, rate per hour or step.
DRIFTS = {
    "nothing": (None, "", None),
    "T2, 0.5 K in 4 h": ("T2", "{cause: T2, change: 0.5 K, over: 4 h}", 0.125),
    "m_c, 1 % in 8 h": ("m_c", "{cause: m_c, change: 1 %, over: 8 h}", 0.00125),
    "P2, 100 Pa in 1 h": ("P2", "{cause: P2, change: 100 Pa, over: 1 h}", 100.0),
    "fouling, 1 point in 8 h": ("fouling", "{cause: fouling, change: -1.4 %, over: 8 h}", -0.00175),
    "bearing friction": ("bearing_friction", "{cause: bearing_friction, change: 1.5e-7 W s2/rad2, over: 8 h}", 1.875e-8),
    "T2, a step of 0.4 K": ("T2", "{cause: T2, change: 0.4 K, from: %d min}", 0.4),
}


def replaced(text, old, new):
    assert text.count(old) == 1, old
    return text.replace(old, new)


def campaign(drift, seed):
    text = (REPOSITORY / "campaigns/gap_rig.yaml").read_text()
    text = replaced(text, "openings: [0.5, 0.7, 1.0]", "openings: [0.55, 0.7, 0.85, 1.0, 1.4, 2.0]")
    text = replaced(text, "dwell: 120 s", "dwell: 8 min")
    jump = "{from: {speed: 70 krpm, opening: 0.7}, to: {speed: 130 krpm, opening: 0.7}}"
    text = replaced(text, "repeats: off", f"repeats: {{jump: {jump}, every: 9, at_least: 4}}")
    text = replaced(text, "    tolerances: drawn\n", f"    tolerances: drawn\n    drift: [{drift}]\n")
    return replaced(text, "seed: 1  ", f"seed: {seed}  ")


def night(program, name, seed):
    cause, drift, size = DRIFTS[name]
    onset_s = 0.0
    if "%d" in drift:
        minutes = random.Random(seed).randint(60, 270)
        onset_s, drift = 60.0 * minutes, drift % minutes
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "night.yaml"
        file.write_text(campaign(drift, seed))
        run = subprocess.run([program, "run", file, "--out", folder + "/runs", "--json"], capture_output=True, text=True)
        if run.returncode:
            return {"conclusion": f"no run: {run.stderr.strip()[-200:]}"}
        recording = json.loads(run.stdout)["recording"]
        report = json.loads(subprocess.run([program, "drift", "--json", recording], capture_output=True, text=True, check=True).stdout)
    course = "step" if "from:" in drift else "rate_per_h"
    causes = [drift["cause"] for drift in report["drifts"]]
    one = next((drift for drift in report["drifts"] if drift["cause"] == cause), None)
    return {
        "found": "+".join(causes) or None,
        "right": causes == ([cause] if cause else []),
        "onset": one is not None and abs(one["onset_s"] - onset_s) <= TWO_REPEATS_S,
        "size": size is not None and one is not None and course in one and one["low"] <= size <= one["high"],
        "conclusion": report["reason"],
    }


def main():
    program, first, count = str(pathlib.Path(sys.argv[1]).resolve()), int(sys.argv[2]), int(sys.argv[3])
    names = sys.argv[4:] or list(DRIFTS)
    print("| planted | nights | not run | right | other cause | nothing found | onset within two repeats | size in its interval |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for name in names:
        nights = []
        for seed in range(first, first + count):
            nights.append(night(program, name, seed))
            print(f"{name}, seed {seed}: {nights[-1]['conclusion']}", file=sys.stderr)
        run = [one for one in nights if "found" in one]
        other = sum(not one["right"] and one["found"] is not None for one in run)
        nothing = sum(one["found"] is None for one in run)
        sums = [sum(one[key] for one in run) for key in ("right", "onset", "size")]
        print(f"| {name} | {count} | {count - len(run)} | {sums[0]} | {other} | {nothing} | {sums[1]} | {sums[2]} |", flush=True)


if __name__ == "__main__":
    main()
