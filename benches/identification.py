"""How far `joint` errs, and how often its intervals hold, by class of machine: two builds on the same recordings.

    cargo build --release --locked
    python3 benches/identification.py record recordings --mapper target/release/mapper
    python3 benches/identification.py compare recordings --mapper target/release/mapper --before OTHER/mapper --write docs/validation/identification.md

`record` runs the shipped campaign on the virtual lab, 20 seeds a class, each with its own plan, noise and offsets; the class is
the undeclared property of the machine. `compare` identifies each recording with both builds.
"""

import argparse
import concurrent.futures
import dataclasses
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

SLOW = "turbine_inlet_pressure: {{lag: 3 s, {rate}: 20 kPa/s}}, valve: {{lag: 1 s, {rate}: 0.2 1/s}}"

# Sensors that are not what is declared, as effects of the lab.
SENSORS = {
    "Tc towards the cell": ("k [1] 0 .. 1, neutral 0, step 0.05", "Tc", "value + p.k * (at.ambient_k - value)"),
    "T2 gain": ("k [1] -0.1 .. 0.1, neutral 0, step 0.01", "T2", "value + p.k * (value - 298.15)"),
    "T1 towards the housing": ("k [1] 0 .. 1, neutral 0, step 0.05", "T1", "value + p.k * (at.tc_k - value)"),
    "Tc lag": ("tau [s] 0 .. 20, neutral 0, step 1", "Tc", None),
}


@dataclasses.dataclass(frozen=True)
class Machine:
    """Effects of the lab, changes of the campaign, other settings of the lab, faulty sensors by name and size; `as_bought`: neither gains nor the
    mounting of Tc are declared, so that the classes of usual sensors count."""

    effects: str = ""
    changes: tuple = ()
    zero: bool = True
    order: str = "thermal_gradient"
    lab: str = "virtual_lab"
    settings: str = ""
    sensors: tuple = ()
    as_bought: bool = False


MIX = "area_split: 0.05, directional_htc: 0.9, tip_diameter: 0.7 mm"
TWO_MASSES = """structure: {housing_coupling: 2 W/K, uneven_h: 20 %, mixed_gas: true, duct_length: 100 mm, duct_loss: 0.5, volume_share: 50 %,
    hysteresis: 0 %, sensor_speed: 0.5, convection_exponent: -0.2, turbine_inner: 40 %, turbine_slope: 0.1}"""
CLASSES = {
    "as declared": Machine(),
    "alpha_A 0.03": Machine("area_split: 0.03"),
    "alpha_A 0.05": Machine("area_split: 0.05"),
    "alpha_A 0.12": Machine("area_split: 0.12"),
    "alpha_A 0.3": Machine("area_split: 0.3"),
    "probe 1.5 mm": Machine("tip_diameter: 1.5 mm"),
    "ratio 0.7": Machine("directional_htc: 0.7"),
    "mix 1": Machine(MIX),
    "mix 2": Machine("area_split: 0.08, directional_htc: 0.93"),
    "mix 3": Machine("area_split: 0.04, tip_diameter: 1.0 mm"),
    "inner wall 0.35, 15 W/K": Machine("inner_node: {phi: 0.35, G: 15 W/K}"),
    "inner wall 0.2, 40 W/K": Machine("inner_node: {phi: 0.2, G: 40 W/K}"),
    "inner wall 0.5, 8 W/K": Machine("inner_node: {phi: 0.5, G: 8 W/K}"),
    "inner wall 0.35, alpha_A 0.08": Machine("inner_node: {phi: 0.35, G: 15 W/K}, area_split: 0.08"),
    "inlet preheat 1 W/K": Machine("inlet_preheat: 1 W/K"),
    "slow actuators": Machine(settings=f"actuators: {{{SLOW.format(rate='slew')}}}"),
    "slow actuators, declared": Machine(changes=(("\nbackend:\n", f"\nrig: {{actuators: {{{SLOW.format(rate='rate')}}}}}\nbackend:\n"),)),
    "bent map": Machine(changes=(("map: closed_form", "map: {file: bent.csv, reference: SAE}"),)),
    "other housing": Machine(changes=tuple(OTHER_HOUSING)),
    "other_lab": Machine(lab="other_lab"),
    "two_masses": Machine(lab="other_lab", settings=TWO_MASSES),
    "recirculation 0.5 %": Machine("recirculation: 0.5 %"),
    "recirculation 2 %": Machine("recirculation: 2 %"),
    "T2 recovery 0.7": Machine("recovery: 0.7"),
    "as bought": Machine(as_bought=True),
    "as bought, Tc 5 % towards the cell": Machine(sensors=(("Tc towards the cell", "k: 0.05"),), as_bought=True),
    "as bought, Tc 10 % towards the cell": Machine(sensors=(("Tc towards the cell", "k: 0.1"),), as_bought=True),
    "as bought, Tc lags 5 s": Machine(sensors=(("Tc lag", "tau: 5 s"),), as_bought=True),
    "as bought, T2 gain 0.4 %": Machine(sensors=(("T2 gain", "k: 0.004"),), as_bought=True),
    "as bought, T2 gain 1 %": Machine(sensors=(("T2 gain", "k: 0.01"),), as_bought=True),
    "as bought, T1 2 % towards the housing": Machine(sensors=(("T1 towards the housing", "k: 0.02"),), as_bought=True),
    "P1 and P2 +2 kPa": Machine(settings="offset_of: {P1: 2000 Pa, P2: 2000 Pa}"),
    "as declared, soak 5 min": Machine(changes=(("soak: 30 min", "soak: 5 min"),)),
    "alpha_A 0.12, soak 5 min": Machine("area_split: 0.12", changes=(("soak: 30 min", "soak: 5 min"),)),
    "soak 5 min, dwell 20 s": Machine(changes=(("soak: 30 min", "soak: 5 min"), ("dwell: 40 s ", "dwell: 20 s "))),
    "as declared, no zero": Machine(zero=False),
    "alpha_A 0.12, no zero": Machine("area_split: 0.12", zero=False),
    "mix 1, no zero": Machine(MIX, zero=False),
    "as declared, lines": Machine(order="speed_lines"),
    "alpha_A 0.12, lines": Machine("area_split: 0.12", order="speed_lines"),
    "mix 1, lines": Machine(MIX, order="speed_lines"),
}

WITH_EITHER_LAW = {name for name, machine in CLASSES.items() if "area_split" in machine.effects}


def planted(folder, machine):
    """The lab's settings: effects of the library, and sensors as scripts beside the campaign."""
    effects = [machine.effects] if machine.effects else []
    for name, size in machine.sensors:
        parameter, channel, reading = SENSORS[name]
        path = (folder / f"{slug(name)}.rhai").resolve()
        head = f"//! effect: {slug(name)}\n//! submodel: t2_probe\n//! parameter: {parameter}\n"
        body = f"fn reading_{channel}(at, p, value) {{ {reading} }}\n" if reading else f"//! lag: {channel} tau\n"
        path.write_text(head + body)
        effects.append(f'"{path}": {{{size}}}')
    settings = [f"effects: {{{', '.join(effects)}}}"] if effects else []
    return ", ".join(settings + ([machine.settings] if machine.settings else []))


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
    machine = CLASSES[name]
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    for old, new in machine.changes:
        text = replaced(text, old, new)
    if machine.as_bought:
        text = text.replace(", gain: 0.05 %", "").replace(", mounting: embedded", "")
    text = re.sub(r"(?m)^seed: .*$", f"seed: {seed}", text)
    text = re.sub(r"(?m)^order: .*$", f"order: {machine.order}", text)
    text = replaced(text, "formats: [csv, json, svg]", "formats: [json]")
    if not machine.zero:
        text = re.sub(r"(?m)^zero: .*\n", "", text)
    folder.mkdir(parents=True, exist_ok=True)
    text = replaced(text, "virtual_lab: {}", f"{machine.lab}: {{{planted(folder, machine)}}}")
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


def identified(mapper, run, is_recorders):
    """What a build identifies; the build that recorded a run has done so already, unless something was not declared to it."""
    if is_recorders and (run / "points.json").exists() and declared_campaign(run).read_text() == run.with_suffix(".yaml").read_text():
        found = json.loads((run / "points.json").read_text())
        return [p for p in found["points"] if p["kind"] == "point" and p.get("truth")], found.get("thermal")
    done = subprocess.run([mapper, "identify", str(run), "--campaign", str(declared_campaign(run)), "--truth", "--json"], capture_output=True, text=True)
    if not done.stdout:
        raise SystemExit(f"{run}: {done.stderr.strip()[-2000:]}")
    found = json.loads(done.stdout)
    return [p for p in found["points"] if p["kind"] == "point" and p.get("truth")], found.get("thermal")


HEADS = ["class", "build", "rms", "median seed", "worst seed", "worst point", "eta covered", "too low, too high", "with allowance", "h covered", "half interval", "good", "recordings"]


def share(points, name):
    known = [answer for answer in (held(p, name) for p in points) if answer is not None]
    return f"{100 * sum(known) / len(known):.0f} %" if known else "-"


def sides(points):
    """Shares of the points whose interval lies below and above the truth."""
    known = [p for p in points if held(p, "eta") is not None]
    wrong = [sum(p["eta_high"] < p["truth"]["eta"] for p in known), sum(p["eta_low"] > p["truth"]["eta"] for p in known)]
    return ", ".join(f"{100 * count / len(known):.0f} %" for count in wrong) if known else "-"


def allowed(points):
    """Share of the points whose interval, with what may be something else on both sides, contains the truth."""
    known = [p for p in points if held(p, "eta") is not None]
    wide = [p["eta_low"] - (p["eta_allowance"] or 0) <= p["truth"]["eta"] <= p["eta_high"] + (p["eta_allowance"] or 0) for p in known]
    return f"{100 * sum(wide) / len(wide):.0f} %" if wide else "-"


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
        f"{max(map(abs, every)):.2f}", share(good, "eta"), sides(good), allowed(good), share(good, "h_w_m2k"),
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
    parser.add_argument("--again", action="store_true", help="identify again what the build that recorded has identified")
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
            for build, mapper in builds.items() if runs else ():
                found = list(pool.map(lambda run: identified(mapper, run, build == "now" and not arguments.again), runs))
                put("| " + " | ".join(row(name, build, found)) + " |")
                if arguments.shared:
                    for (points, thermal), run in zip(found, runs):
                        values = {k: thermal[k] for k in ("alpha_area_ratio", "probe_diameter_m", "heating_cooling_ratio")} if thermal else {}
                        shown = [f"{k} {v['value']} +- {v['uncertainty']['noise_standard_error']:.4f} {v['origin']}" for k, v in values.items()]
                        errors = [error_of(p) for p in points if error_of(p) is not None]
                        rms = math.sqrt(statistics.fmean(e * e for e in errors)) if errors else math.nan
                        print("  ", run.name, f"rms {rms:.2f} mean {statistics.fmean(errors):+.2f}", "; ".join(shown), flush=True)
        if arguments.write:
            Path(arguments.write).write_text(PAGE.format(date=datetime.date.today(), table="\n".join(lines), first=arguments.first, seeds=len(seeds), classes=arguments.classes, known=len(CLASSES)))


PAGE = """\
# Identification by class of machine

Made on {date} by these commands, six seconds a recording on two cores; do not edit. All {known} classes take two hours. `--before OTHER/mapper` adds the rows of
another build.

    python3 benches/identification.py record recordings --first {first} --mapper target/release/mapper --classes "{classes}"
    python3 benches/identification.py compare recordings --first {first} --mapper target/release/mapper --classes "{classes}" --write docs/validation/identification.md

The 48 points of `campaigns/turbo_a.yaml` on the virtual lab, {seeds} seeds a class, each with its own plan, noise and offsets, identified by `joint`. The class is
the undeclared property of the machine: alpha_A; a T2 probe; the ratio of cooling to heating; mix 1: alpha_A 0.05, ratio 0.9, probe 0.7 mm;
mix 2: alpha_A 0.08, ratio 0.93; mix 3: alpha_A 0.04, probe 1 mm; an inner wall with its share of the capacity and its conductance; P3 with a lag of 3 s and
20 kPa/s with a valve of 1 s and 0.2 1/s; the laboratories of other equations; what is efficiency for every method; sensors that are not as declared, planted
as scripts. The bent map falls by 6 points more towards low speed; the other housing is heavier and has another law of convection and a tenth of its area
before the wheel, all declared. With alpha_A, every odd seed has an undeclared law of h before the wheel. "Lines" follows speed lines.

Errors in points of efficiency. **covered**: share of the good points whose 95 % interval contains the truth. **too low, too high**: of those whose interval does
not. **with allowance**: the same with what may be recirculation, recovery or heat behind the wheel on both sides. **half interval**: mean of all points. **recordings**: those whose mean error lies within their mean half interval. The points of a recording share most of
their error, so N recordings determine a share of 95 % only to 22 % / sqrt(N) (one standard error).

{table}
"""


if __name__ == "__main__":
    main()
