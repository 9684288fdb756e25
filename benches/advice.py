"""Whether the verdicts that `mapper check` forecasts come true, and whether its first advice helps.

Usage: advice.py PROGRAM MACHINES

Random machines as in first_campaign.py, with their zero removed or their dwell cut to a third or a fifth, so that not all points are expected
to be good. Each is run on the virtual lab, then run again after its first advice. Prints forecast and measured shares of good points.
"""

import json
import re
import statistics
import sys
import tempfile
from pathlib import Path

from first_campaign import call, make_campaign


def without_zero(text):
    return re.sub(r"^zero:.*\n(?:[ #].*\n)*", "", text, flags=re.M)


def with_dwell(ratio):
    return lambda text: re.sub(r"dwell: ([\d.]+) s", lambda found: f"dwell: {float(found[1]) * ratio:.0f} s", text)


FLAWS = [("no zero", without_zero), ("dwell / 3", with_dwell(1 / 3)), ("dwell / 5", with_dwell(1 / 5))]


def follow(text, change):
    """The campaign after one change of `mapper check --json`."""
    if "dwell_s" in change:
        return re.sub(r"dwell: [\d.]+ s", f"dwell: {change['dwell_s']:.0f} s", text)
    soak = f"zero: {{soak: {change['soak_s'] / 60:.0f} min}}\n"
    return without_zero(text) + soak


def share_good(program, directory):
    run = call(program, directory, "run", "own.yaml", "--json", "--progress", "off")
    points = json.loads(run.stdout).get("points", [])
    return sum(point["verdict"] == "good" for point in points) / max(len(points), 1)


def check(program, directory):
    return json.loads(call(program, directory, "check", "own.yaml", "--json").stdout)


def main():
    program, machines = str(Path(sys.argv[1]).resolve()), int(sys.argv[2])
    differences, helped, advised = [], 0, 0
    for number in range(machines):
        with tempfile.TemporaryDirectory() as directory:
            campaign, wheel_mm, shape, made = make_campaign(program, directory, number)
            if made.returncode:
                print(f"{number:3} {made.stderr}")
                continue
            flaw, cut = FLAWS[number % len(FLAWS)]
            campaign.write_text(cut(campaign.read_text()))
            checked = check(program, directory)
            expected = checked["expected"]
            forecast = expected["good"] / expected["points"]
            before = share_good(program, directory)
            differences.append(abs(forecast - before))
            line = f"{number:3} {wheel_mm:5.1f} mm {shape:7} {flaw:9}: forecast {100 * forecast:3.0f} %, measured {100 * before:3.0f} %"
            if checked["advice"]:
                advice = checked["advice"][0]
                advised += 1
                campaign.write_text(follow(campaign.read_text(), advice["change"]))
                forecast = advice["forecast"]["good"] / advice["forecast"]["points"]
                after = share_good(program, directory)
                differences.append(abs(forecast - after))
                helped += after > before
                line += f"; after {advice['change']}: forecast {100 * forecast:3.0f} %, measured {100 * after:3.0f} %"
            print(line, flush=True)
    print(
        f"{helped} of {advised} advices raised the share of good points; |forecast - measured| median "
        f"{100 * statistics.median(differences):.0f} %, worst {100 * max(differences):.0f} %"
    )


if __name__ == "__main__":
    main()
