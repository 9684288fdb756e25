"""Random machines from `mapper init` to a map on the virtual lab: share of good points and coverage.

Usage: first_campaign.py PROGRAM MACHINES [FIRST]

Wheels of 35 to 90 mm; the machine's own map is that of a similar compressor (medium), with 20 % less flow and 2 points less efficiency
(narrow), or with 25 % more flow (wide). Each machine is run once with its own seed, and differs from its campaign by what identification
assumes about an undeclared machine: alpha_A, probe and heating/cooling ratio (none to all three, sizes by `REFINEMENTS`), the law of h before the
wheel (either one), internal area (`SCALED_AREA_SIGMA_RATIO`) and humidity (from dry to saturated). The sizes are read from the code.
In brackets: the forecast of `mapper check`, as declared and one standard deviation off, rms. The last line has the range of the measured error over
the first of them on machines without alpha_A, for `ERROR_RATIOS`.
"""

import json
import math
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


def assumed():
    """Standard deviations of alpha_A, of the square of the probe's diameter (mm2) and of ln of the heating/cooling ratio if they are not
    neutral, and of the internal area (ratio)."""
    crates = Path(__file__).resolve().parent.parent / "crates"
    refinements = (crates / "identify/src/joint/step_model/parameters.rs").read_text()
    sizes = (crates / "campaign/src/machine_sizes.rs").read_text()
    slab = lambda name: float(re.search(rf"\({name}, [\d.]+, ([\d.]+), [\d.]+\)", refinements)[1])
    area = re.search(r"SCALED_AREA_SIGMA_RATIO: f64 = ([\d.]+)", sizes)[1]
    return slab("ALPHA"), slab("PROBE_MM2"), slab("LN_HEATING_COOLING_RATIO"), float(area)


def stand_of(text, number):
    """The campaign of the stand: the machine with what its own campaign does not declare."""
    draw = random.Random(1000 + number)
    alpha, probe_mm2, ln_ratio, area = assumed()
    values = [
        ("area_split", min(abs(draw.gauss(0, alpha)), 0.6), ""),
        ("tip_diameter", abs(draw.gauss(0, probe_mm2)) ** 0.5, " mm"),
        ("directional_htc", math.exp(draw.gauss(0, ln_ratio)), ""),
    ]
    effects = [f"{name}: {value:.4f}{unit}" for name, value, unit in draw.sample(values, draw.randrange(4))]
    text = text.replace("virtual_lab: {}", f"virtual_lab: {{effects: {{{', '.join(effects)}}}}}")
    scale = max(draw.gauss(1, area), 0.2)
    area_m2 = re.search(r"# internal_area: ([\d.e-]+) m", text)
    text = text.replace(area_m2[0][:-1], f"internal_area: {scale * float(area_m2[1]):.5g} ", 1)
    if draw.random() < 0.5:
        text = text.replace("    compressor:\n", "    compressor:\n      inlet_convection: own\n", 1)
        effects.append("own law of h before the wheel")
    return f"{text}\nreport: {{humidity: {draw.uniform(0, 100):.1f} %}}\n", ", ".join(effects) or "as declared"


def forecast(program, directory):
    """Half 95 % intervals that `mapper check` expects, in points: as declared, and if the machine is one standard deviation off."""
    expected = json.loads(call(program, directory, "check", "own.yaml", "--json").stdout)["expected"]
    off = expected["undeclared"] or {}
    return [196 * (one.get("eta_standard_error") or math.nan) for one in (expected, off)]


def machine(program, number):
    with tempfile.TemporaryDirectory() as directory:
        campaign, wheel_mm, shape, made = make_campaign(program, directory, number)
        if made.returncode:
            return wheel_mm, shape, None, made.stderr, None
        text, effects = stand_of(campaign.read_text(), number)
        Path(directory, "stand.yaml").write_text(text)
        ran = call(program, directory, "run", "stand.yaml", "--json", "--progress", "off")
        if ran.returncode:
            return wheel_mm, shape, None, ran.stderr, None
        found = call(program, directory, "identify", json.loads(ran.stdout)["run"], "--campaign", "own.yaml", "--truth", "--json")
        return wheel_mm, shape, json.loads(found.stdout)["points"], effects, forecast(program, directory)


def counted(points):
    """Good points, those that are covered, their largest error and half interval (rms) in points of efficiency."""
    good = [p for p in points if p["verdict"] == "good"]
    covered = [p["eta_low"] <= p["truth"]["eta"] <= p["eta_high"] for p in good]
    errors = [100 * abs(p["eta"] - p["truth"]["eta"]) for p in good]
    half = [50 * (p["eta_high"] - p["eta_low"]) for p in good]
    return len(good), sum(covered), max(errors, default=float("nan")), math.sqrt(statistics.mean([h * h for h in half] or [float("nan")]))


def main():
    program, machines = str(Path(sys.argv[1]).resolve()), int(sys.argv[2])
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    passed, total, total_good, ratios = 0, 0, 0, []
    for number in range(first, first + machines):
        wheel_mm, shape, points, remark, expected = machine(program, number)
        if points is None:
            print(f"{number:3} {wheel_mm:5.1f} mm {remark}", flush=True)
            continue
        good, covered, worst, half = counted(points)
        passed += good >= 0.8 * len(points)
        total, total_good = total + covered, total_good + good
        if "area_split" not in remark:
            ratios.append(half / expected[0])
        print(
            f"{number:3} {wheel_mm:5.1f} mm {shape:7} {good} of {len(points)} good, {covered} covered, worst {worst:.2f}, "
            f"+/- {half:.2f} ({expected[0]:.2f}, {expected[1]:.2f}): {remark}",
            flush=True,
        )
    print(
        f"{passed} of {machines} machines with at least 80 % good points; {100 * total / max(total_good, 1):.1f} % of {total_good} "
        f"good points covered; measured over forecast error {min(ratios, default=math.nan):.2f} to {max(ratios, default=math.nan):.2f}"
    )


if __name__ == "__main__":
    main()
