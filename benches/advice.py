"""Whether the verdicts that `mapper check` forecasts come true, and whether its first advice helps.

Usage: advice.py PROGRAM MACHINES

Random machines as in first_campaign.py, with their zero removed or their dwell cut, so that not all points are surely good. Each is run on the
virtual lab, then run again after its first advice. Prints the forecast number of good points with its range, and the measured one.
"""

import json
import re
import sys
import tempfile
from pathlib import Path

from first_campaign import call, make_campaign


def without_zero(text):
    return re.sub(r"^zero:.*\n(?:[ #].*\n)*", "", text, flags=re.M)


def with_dwell(ratio):
    return lambda text: re.sub(r"dwell: ([\d.]+) s", lambda found: f"dwell: {float(found[1]) * ratio:.0f} s", text)


FLAWS = [
    ("no zero", without_zero),
    ("dwell / 3", with_dwell(1 / 3)),
    ("dwell / 5", with_dwell(1 / 5)),
    ("no zero, dwell/2", lambda text: with_dwell(1 / 2)(without_zero(text))),
]


def follow(text, change):
    """The campaign after one change of `mapper check --json`."""
    if "dwell_s" in change:
        return re.sub(r"dwell: [\d.]+ s", f"dwell: {change['dwell_s']:.0f} s", text)
    soak = f"zero: {{soak: {change['soak_s'] / 60:.0f} min}}\n"
    return without_zero(text) + soak


def good_points(program, directory):
    """Good points of the map and all of them, as `mapper check` counts them: repeats do not count, and of two visits the better one does."""
    run = call(program, directory, "run", "own.yaml", "--json", "--progress", "off")
    best = {}
    for point in json.loads(run.stdout).get("points", []):
        if point["kind"] != "repeat":
            place = (point["target"]["speed_rpm"], point["target"]["valve"])
            best[place] = best.get(place, False) or point["verdict"] == "good"
    return sum(best.values()), len(best)


def check(program, directory):
    return json.loads(call(program, directory, "check", "own.yaml", "--json").stdout)


def compared(forecast, measured):
    """Forecast and measured points in words, and whether the range contains the measured ones."""
    good, points = measured
    holds = points == forecast["points"] and forecast["good_low"] <= good <= forecast["good_high"]
    words = f"{forecast['good']:2} ({forecast['good_low']} to {forecast['good_high']}) -> {good:2} of {points}"
    return words + ("" if holds else " MISSED"), holds


def main():
    program, machines = str(Path(sys.argv[1]).resolve()), int(sys.argv[2])
    held, forecasts, rose, advised = 0, 0, 0, 0
    for number in range(machines):
        with tempfile.TemporaryDirectory() as directory:
            campaign, wheel_mm, shape, made = make_campaign(program, directory, number)
            if made.returncode:
                print(f"{number:3} {made.stderr}")
                continue
            flaw, cut = FLAWS[number % len(FLAWS)]
            campaign.write_text(cut(campaign.read_text()))
            checked = check(program, directory)
            before = good_points(program, directory)
            words, holds = compared(checked["expected"], before)
            held, forecasts = held + holds, forecasts + 1
            line = f"{number:3} {wheel_mm:5.1f} mm {shape:7} {flaw:16}: {words}"
            if checked["advice"]:
                advice = checked["advice"][0]
                campaign.write_text(follow(campaign.read_text(), advice["change"]))
                after = good_points(program, directory)
                words, holds = compared(advice["forecast"], after)
                held, forecasts, advised = held + holds, forecasts + 1, advised + 1
                rose += after[0] >= advice["forecast"]["good_low"]
                change = " ".join(f"{key} {value:.0f}" for key, value in advice["change"].items())
                line += f"; {change}: {words}"
            print(line, flush=True)
    print(f"{held} of {forecasts} forecasts hold; after {rose} of {advised} advices at least as many points are good as forecast")


if __name__ == "__main__":
    main()
