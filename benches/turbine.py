"""How far the turbine's efficiency and the heat before its wheel err, by class of machine.

    cargo build --release --locked
    python3 benches/turbine.py recordings --mapper target/release/mapper --write docs/validation/turbine.md

The shipped campaign on the virtual lab, 20 seeds a class, each with its own plan, noise and offsets; the class is the undeclared
property of the machine.
"""

import argparse
import concurrent.futures
import datetime
import json
import math
import statistics
from pathlib import Path

import identification
from identification import Machine, slug

FRICTION = ("c [W s^1.75] 0 .. 1e-3, neutral 0, step 1e-5", "shaft_torque_nm", "-p.c * at.speed_rad_s ** 0.75")
BEHIND = ("G [W/K] 0 .. 5, neutral 0, step 0.1", "heat_to_turbine_w", "p.G * (0.9 * at.t3_k - at.tt_k)")
TWO_MASSES = """structure: {housing_coupling: 1000 W/K, uneven_h: 0 %, mixed_gas: false, duct_length: 100 mm, duct_loss: 0, volume_share: 50 %,
    hysteresis: 0 %, sensor_speed: 1, convection_exponent: 0, turbine_inner: 40 %, turbine_slope: 0.1}"""
# Effects in rhai by name: submodel, parameter, function, its value.
EFFECTS = {
    "friction": ("shaft", *FRICTION),
    "heat behind the wheel": ("turbine_housing", *BEHIND),
}
CLASSES = {
    "as declared": (Machine(), None),
    "housing of two masses, slope of the efficiency": (Machine(lab="other_lab", settings=TWO_MASSES), None),
    "the other laboratory": (Machine(lab="other_lab"), None),
    "friction in N^1.75, 320 W at 150 krpm": (Machine(), ("friction", "c: 1.44e-5 W s^1.75")),
    "0.5 W/K from the gas behind the wheel": (Machine(), ("heat behind the wheel", "G: 0.5 W/K")),
    "turbine housing 30 % heavier, h 30 % higher": (
        Machine(changes=(("housing_mass: 3.15 kg", "housing_mass: 2.42 kg"), ("{coefficient: 0.038", "{coefficient: 0.029"))), None),
    "as bought": (Machine(as_bought=True), None),
}


def prepare(directory, name):
    """The class as `identification` records it."""
    machine, effect = CLASSES[name]
    if effect:
        kind, size = effect
        submodel, parameter, function, value = EFFECTS[kind]
        path = (directory / f"{slug(kind)}.rhai").resolve()
        head = f"//! effect: {slug(kind)}\n//! submodel: {submodel}\n//! parameter: {parameter}\n"
        path.write_text(f"{head}fn {function}(at, p) {{ {value} }}\n")
        machine = Machine(effects=f'"{path}": {{{size}}}')
    identification.CLASSES[name] = machine


def points_of(run):
    found = json.loads((run / "points.json").read_text())
    return [p for p in found["turbine"] if p["efficiency"] is not None and p["truth_efficiency"] is not None]


HEADS = ["class", "rms", "median seed", "worst seed", "worst point", "covered", "half interval", "at 50 krpm: rms, half", "good", "covered", "recordings"]
# rpm/K^0.5 between the lines of 50 and 65 krpm.
LOWEST_LINE = 2000


def row(name, runs):
    error = lambda p: 100 * (p["efficiency"] - p["truth_efficiency"])
    half = lambda p: 50 * (p["efficiency_high"] - p["efficiency_low"])
    rms = lambda values: math.sqrt(statistics.fmean(v * v for v in values)) if values else math.nan
    points = [p for of_run in runs for p in of_run]
    good = [p for p in points if p["verdict"] == "good"]
    seeds = [rms([error(p) for p in of_run]) for of_run in runs]

    def covered(points):
        low = [p["efficiency_high"] < p["truth_efficiency"] for p in points]
        high = [p["efficiency_low"] > p["truth_efficiency"] for p in points]
        shares = [1 - statistics.fmean(low) - statistics.fmean(high), statistics.fmean(low), statistics.fmean(high)]
        return f"{100 * shares[0]:.0f} % ({100 * shares[1]:.0f}, {100 * shares[2]:.0f})"

    slow = [p for p in points if p["speed_parameter_rpm_sqrt_k"] < LOWEST_LINE]
    return [
        name, f"{rms([error(p) for p in points]):.2f}", f"{statistics.median(seeds):.2f}", f"{max(seeds):.2f}", f"{max(abs(error(p)) for p in points):.2f}",
        covered(points), f"{statistics.fmean(half(p) for p in points):.2f}", f"{rms([error(p) for p in slow]):.2f}, {statistics.fmean(half(p) for p in slow):.2f}",
        f"{100 * len(good) / len(points):.0f} %", covered(good) if good else "-", str(len(runs)),
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=8001)
    parser.add_argument("--classes", default=";".join(CLASSES))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", help="the page to write")
    arguments = parser.parse_args()
    arguments.directory.mkdir(parents=True, exist_ok=True)
    mapper, lines = str(Path(arguments.mapper).resolve()), []
    print("| " + " | ".join(HEADS) + " |\n|---|" + "---:|" * (len(HEADS) - 1), flush=True)
    for name in arguments.classes.split(";"):
        prepare(arguments.directory, name)
        seeds = range(arguments.first, arguments.first + arguments.seeds)
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            list(pool.map(lambda seed: identification.record(mapper, arguments.directory, name, seed), seeds))
        lines.append("| " + " | ".join(row(name, [points_of(arguments.directory / slug(name) / str(seed)) for seed in seeds])) + " |")
        print(lines[-1], flush=True)
    if arguments.write:
        table = "\n".join(["| " + " | ".join(HEADS) + " |", "|---|" + "---:|" * (len(HEADS) - 1), *lines])
        Path(arguments.write).write_text(PAGE.format(date=datetime.date.today(), first=arguments.first, seeds=arguments.seeds, table=table))


PAGE = """\
# The turbine by class of machine

Made on {date} by this command, six seconds a recording on two cores; do not edit:

    python3 benches/turbine.py recordings --mapper target/release/mapper --first {first} --write docs/validation/turbine.md

`campaigns/turbo_a.yaml` on the virtual lab, {seeds} seeds a class, each with its own plan, noise and offsets. Turbine times mechanical efficiency, total to
static, at all steps, repeats included; errors in points. The class is the undeclared property of the machine. The truth is the power of the turbine less
friction over the isentropic power from the true T3'.

**covered**: share of the points whose 95 % interval contains the truth, and of those whose interval is too low and too high; of all points, then of the good
ones. A turbine point is good only if the compressor's point is. The points of a recording share the errors of both flow meters, so {seeds} recordings determine
a share of 95 % only to some 5 %.

{table}
"""


if __name__ == "__main__":
    main()
