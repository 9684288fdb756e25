"""How far `joint` errs, and how often its intervals hold, by class of machine: two builds on the same recordings.

    cargo build --release --locked
    python3 benches/identification.py record recordings --mapper target/release/mapper
    python3 benches/identification.py compare recordings --mapper target/release/mapper --before OTHER/mapper --write docs/validation/identification.md

`record` runs the shipped campaign on the virtual lab, 20 seeds a class, each with its own plan, noise and offsets; the class is
the undeclared property of the machine. `compare` identifies each recording with both builds.
"""

import argparse
import concurrent.futures
import datetime
import json
import math
import re
import shutil
import statistics
import subprocess
from pathlib import Path

from machines import ROOT, error_of, half, held, replaced, write_table
from orders import OTHER_HOUSING

# What identification cannot know either: the law of h before the wheel.
OWN_INLET = [("      alpha_area: 0 ", "      inlet_convection: own\n      alpha_area: 0 ")]

# Undeclared effects, other replacements, with a zero, order. Of the classes in `WITH_EITHER_LAW` every second seed has its own law at the inlet.
CLASSES = {
    "as declared": ("", [], True, "thermal_gradient"),
    "alpha_A 0.03": ("area_split: 0.03", [], True, "thermal_gradient"),
    "alpha_A 0.05": ("area_split: 0.05", [], True, "thermal_gradient"),
    "alpha_A 0.12": ("area_split: 0.12", [], True, "thermal_gradient"),
    "alpha_A 0.3": ("area_split: 0.3", [], True, "thermal_gradient"),
    "probe 1.5 mm": ("tip_diameter: 1.5 mm", [], True, "thermal_gradient"),
    "ratio 0.7": ("directional_htc: 0.7", [], True, "thermal_gradient"),
    "mix 1": ("area_split: 0.05, directional_htc: 0.9, tip_diameter: 0.7 mm", [], True, "thermal_gradient"),
    "mix 2": ("area_split: 0.08, directional_htc: 0.93", [], True, "thermal_gradient"),
    "mix 3": ("area_split: 0.04, tip_diameter: 1.0 mm", [], True, "thermal_gradient"),
    "bent map": ("", [("map: closed_form", "map: {file: bent.csv, reference: SAE}")], True, "thermal_gradient"),
    "other housing": ("", OTHER_HOUSING, True, "thermal_gradient"),
    "as declared, no zero": ("", [], False, "thermal_gradient"),
    "alpha_A 0.12, no zero": ("area_split: 0.12", [], False, "thermal_gradient"),
    "mix 1, no zero": ("area_split: 0.05, directional_htc: 0.9, tip_diameter: 0.7 mm", [], False, "thermal_gradient"),
    "as declared, lines": ("", [], True, "speed_lines"),
    "alpha_A 0.12, lines": ("area_split: 0.12", [], True, "speed_lines"),
    "mix 1, lines": ("area_split: 0.05, directional_htc: 0.9, tip_diameter: 0.7 mm", [], True, "speed_lines"),
}

WITH_EITHER_LAW = {name for name, (effects, *_) in CLASSES.items() if "area_split" in effects}


def slug(name):
    return re.sub("[^a-z0-9]+", "_", name.lower())


def declared_campaign(run):
    """The campaign with which a run is identified."""
    return run.with_name(f"{run.name}.declared.yaml")


def record(mapper, directory, name, seed):
    folder = directory / slug(name)
    kept = folder / str(seed)
    if kept.exists():
        return
    effects, replacements, zero, order = CLASSES[name]
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    for old, new in replacements:
        text = replaced(text, old, new)
    text = re.sub(r"(?m)^seed: .*$", f"seed: {seed}", text)
    text = re.sub(r"(?m)^order: .*$", f"order: {order}", text)
    text = replaced(text, "formats: [csv, json, svg]", "formats: [json]")
    if not zero:
        text = re.sub(r"(?m)^zero: .*\n", "", text)
    if effects:
        text = replaced(text, "virtual_lab: {}", f"virtual_lab: {{effects: {{{effects}}}}}")
    folder.mkdir(parents=True, exist_ok=True)
    declared_campaign(kept).write_text(text)
    if name in WITH_EITHER_LAW and seed % 2:
        for old, new in OWN_INLET:
            text = replaced(text, old, new)
    for file, loss, steepness in (("bent.csv", 0.06, 0.0), ("steep.csv", 0.02, 1.2)):
        if not (folder / file).exists():
            partial = folder / f"{file}.{seed}"
            write_table(partial, loss, steepness)
            partial.rename(folder / file)
    path = folder / f"{seed}.yaml"
    path.write_text(text)
    out = folder / f"{seed}.part"
    done = subprocess.run([mapper, "run", str(path), "--out", str(out)], capture_output=True, text=True)
    runs = list(out.glob("*/recording.mcap"))
    if not runs:
        raise SystemExit(f"{path}: {done.stderr.strip()[-2000:]}")
    runs[0].parent.rename(kept)
    shutil.rmtree(out)


def identified(mapper, run):
    done = subprocess.run([mapper, "identify", str(run), "--campaign", str(declared_campaign(run)), "--truth", "--json"], capture_output=True, text=True)
    if not done.stdout:
        raise SystemExit(f"{run}: {done.stderr.strip()[-2000:]}")
    found = json.loads(done.stdout)
    return [p for p in found["points"] if p["kind"] == "point" and p.get("truth")], found.get("thermal")


HEADS = ["class", "build", "rms", "median seed", "worst seed", "worst point", "eta covered", "h covered", "half interval", "good", "recordings"]


def share(points, name):
    known = [answer for answer in (held(p, name) for p in points) if answer is not None]
    return f"{100 * sum(known) / len(known):.0f} %" if known else "-"


def row(name, build, runs):
    errors = [[error_of(p) for p in points if error_of(p) is not None] for points, _ in runs]
    seeds = [math.sqrt(statistics.fmean(e * e for e in of_seed)) for of_seed in errors if of_seed]
    every = [e for of_seed in errors for e in of_seed]
    points = [p for points, _ in runs for p in points]
    # The points of a recording share most of their error: the mean error is one draw.
    within = [abs(statistics.fmean(e)) <= statistics.fmean(half(p) for p in points if p["eta"] is not None) for e, (points, _) in zip(errors, runs) if e]
    good = [p for p in points if p["verdict"] == "good"]
    return [
        name, build, f"{math.sqrt(statistics.fmean(e * e for e in every)):.3f}", f"{statistics.median(seeds):.2f}", f"{max(seeds):.2f}",
        f"{max(map(abs, every)):.2f}", share(good, "eta"), share(good, "h_w_m2k"),
        f"{statistics.fmean(half(p) for p in points if p['eta'] is not None):.2f}", f"{100 * len(good) / len(points):.0f} %",
        f"{sum(within)} of {len(within)}",
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=["record", "compare"])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--before", help="the other build")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1001)
    parser.add_argument("--classes", default=";".join(CLASSES))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", help="the page to write")
    parser.add_argument("--shared", action="store_true", help="also what each recording gives for alpha_A, probe and ratio")
    arguments = parser.parse_args()
    classes, seeds = arguments.classes.split(";"), range(arguments.first, arguments.first + arguments.seeds)
    builds = {"now": str(Path(arguments.mapper).resolve())}
    if arguments.before:
        builds = {"before": str(Path(arguments.before).resolve()), **builds}
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        if arguments.task == "record":
            work = [(name, seed) for seed in seeds for name in classes]
            list(pool.map(lambda one: record(builds["now"], arguments.directory, *one), work))
            return
        lines = []

        def put(line):
            lines.append(line)
            print(line, flush=True)

        put("| " + " | ".join(HEADS) + " |\n|---|---|" + "---:|" * (len(HEADS) - 2))
        for name in classes:
            runs = [run for seed in seeds if (run := arguments.directory / slug(name) / str(seed)).exists()]
            for build, mapper in builds.items():
                found = list(pool.map(lambda run: identified(mapper, run), runs))
                put("| " + " | ".join(row(name, build, found)) + " |")
                if arguments.shared:
                    for (points, thermal), run in zip(found, runs):
                        values = {k: thermal[k] for k in ("alpha_area_ratio", "probe_diameter_m", "heating_cooling_ratio")} if thermal else {}
                        shown = [f"{k} {v['value']} +- {v['uncertainty']['noise_standard_error']:.4f} {v['origin']}" for k, v in values.items()]
                        errors = [error_of(p) for p in points if error_of(p) is not None]
                        rms = math.sqrt(statistics.fmean(e * e for e in errors)) if errors else math.nan
                        print("  ", run.name, f"rms {rms:.2f} mean {statistics.fmean(errors):+.2f}", "; ".join(shown), flush=True)
        if arguments.write:
            Path(arguments.write).write_text(PAGE.format(date=datetime.date.today(), table="\n".join(lines), first=arguments.first, seeds=len(seeds)))


PAGE = """\
# Identification by class of machine

Made on {date} by these commands, three quarters of an hour on two cores; do not edit. `--before OTHER/mapper` adds the rows of another build.

    python3 benches/identification.py record recordings --first {first} --mapper target/release/mapper
    python3 benches/identification.py compare recordings --first {first} --mapper target/release/mapper --write docs/validation/identification.md

The 48 points of `campaigns/turbo_a.yaml` on the virtual lab, {seeds} seeds a class, each with its own plan, noise and offsets, identified by `joint`. The class is
the undeclared property of the machine: alpha_A; a T2 probe; the ratio of cooling to heating; mix 1: alpha_A 0.05, ratio 0.9, probe 0.7 mm;
mix 2: alpha_A 0.08, ratio 0.93; mix 3: alpha_A 0.04, probe 1 mm. The bent map falls by 6 points more towards low speed; the other housing is heavier and
has another law of convection and a tenth of its area before the wheel, all declared. With alpha_A, every odd seed
has an undeclared law of h before the wheel. "Lines" follows speed lines.

Errors in points of efficiency. **covered**: share of the good points whose 95 % interval contains the truth. **half interval**: mean of all points.
**recordings**: those whose mean error lies within their mean half interval. The points of a recording share most of their error, so N recordings
determine a share of 95 % only to 22 % / sqrt(N) (one standard error).

{table}
"""


if __name__ == "__main__":
    main()
