"""How often intervals of efficiency and h hold at several humidities of the cell, declared with an error and not declared.

    python3 benches/humidity.py PROGRAM SEEDS

Runs campaigns/turbo_a.yaml on the virtual lab at each relative humidity of a cell of 40 degC, then identifies each recording with a
humidity that is off by a normal error of 2.5 % (95 % within 5 %), and without one.

All points of a recording share the gain of the flow meter, which is most of the error of h: 20 draws of it determine a share of 95 % only to 5 %.
So the lab's meter has no gain error, identification believes the declared one, and each point counts with the probability that the interval of h
holds, over the declared gain.
"""

import json
import math
import random
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from machines import ROOT, error_of, half, held, replaced, share

LEVELS = [0, 20, 40, 60, 80]
GAIN = statistics.NormalDist(0.0, 0.005)
DECLARED_GAIN = "gain: 0.5 %"


def campaign(text, seed, humidity):
    text = replaced(text, "seed: 1 ", f"seed: {seed} ")
    line = "" if humidity is None else f"  humidity: {humidity:.2f} %\n"
    return replaced(text, "  humidity: 50 %\n", f"  cell_temperature: 40 degC\n{line}")


def h_holds(point):
    """A meter that reads g too high raises h and its interval by g."""
    truth = point["truth"]["h_w_m2k"]
    return GAIN.cdf(math.log(truth / point["h_low_w_m2k"])) - GAIN.cdf(math.log(truth / point["h_high_w_m2k"]))


def main(program, seeds):
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    print("| relative humidity at 40 degC | humidity | good points | median error, points | half interval | eta holds | h holds |")
    print("|---:|---|---:|---:|---:|---:|---:|")
    for level in LEVELS:
        found = {"declared": [], "not declared": []}
        # Each level has its own draws: the points of a recording share most of their error, which the humidity hardly changes.
        first = 1 + seeds * LEVELS.index(level)
        for seed in range(first, first + seeds):
            with tempfile.TemporaryDirectory() as folder:
                folder = Path(folder)
                file = folder / "true.yaml"
                file.write_text(replaced(campaign(text, seed, level), DECLARED_GAIN, "gain: 0.001 %"))
                command = [program, "run", file, "--out", folder, "--json"]
                run = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)["run"]
                error = random.Random(1000 * level + seed).gauss(0.0, 2.5)
                for name, humidity in [("declared", min(100.0, max(0.0, level + error))), ("not declared", None)]:
                    other = folder / f"{name.replace(' ', '_')}.yaml"
                    other.write_text(campaign(text, seed, humidity))
                    command = [program, "identify", run, "--campaign", other, "--json"]
                    out = subprocess.run(command, capture_output=True, check=True).stdout
                    found[name] += [p for p in json.loads(out)["points"] if p["verdict"] == "good"]
        for name, points in found.items():
            errors = statistics.median(abs(error_of(p)) for p in points)
            eta, h = share([held(p, "eta") for p in points]), share([h_holds(p) for p in points])
            width = statistics.mean(half(p) for p in points)
            print(f"| {level} % | {name} | {len(points)} | {errors:.2f} | {width:.2f} | {eta} | {h} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
