"""Orders of the same points on several machines: what the plan expects, and how far many seeds then err.

    cargo build --release --locked
    python3 benches/orders.py --mapper target/release/mapper --write docs/validation/orders.md

Each seed draws its own plan, noise and offsets from the declared spread. The campaign is the shipped one, changed in order and machine
alone; conventional mapping follows speed lines, holds each point until nothing drifts, and reads the efficiency from the temperature
rise (`method: steady`), without a zero. The machines:

- turbo_a: the nominal one, as declared;
- bent map: its efficiency falls by 6 points more towards low speed, as 1/N^2, and the program knows its map;
- other housing: a heavier housing, another law of convection, a map that drops steeply at choke, a tenth of the area before the wheel;
  all of it declared;
- paper's heat: turbo_a with the oil conductance, friction heat and probe of campaigns/turbo_paper.yaml, all declared;
- alpha_A 0.12: turbo_a with 0.12 of its internal area before the wheel, of which nothing is declared.
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
import sys
import tempfile
from pathlib import Path

from machines import quantile, replaced, write_table

ROOT = Path(__file__).resolve().parent.parent
OTHER_HOUSING = [
    ("map: closed_form", "map: {file: steep.csv, reference: SAE}"),
    ("housing_mass: 0.93 kg", "housing_mass: 1.4 kg"),
    ("nusselt: {coefficient: 0.004, exponent: 1.13}", "nusselt: {coefficient: 0.12, exponent: 0.85}"),
    ("\n      alpha_area: 0 ", "\n      alpha_area: 0.1 "),
    ("\n  alpha_area: 0       # what", "\n  joint: {alpha_area: fixed}\n  alpha_area: 0.1     # what"),
]
PAPER_HEAT = [
    ("oil_conductance: 8 W/K", "oil_conductance: 9 W/K\n      friction_heat: 440 W"),
    ("probe_diameter: 0 mm}", "probe_diameter: 1.5 mm}"),
]
MACHINES = {
    "turbo_a": [],
    "paper's heat": PAPER_HEAT,
    "bent map": [("map: closed_form", "map: {file: bent.csv, reference: SAE}")],
    "other housing": OTHER_HOUSING,
    "alpha_A 0.12": [("virtual_lab: {}", "virtual_lab: {machine: {alpha_area: 0.12}}")],
}
ORDERS = ["thermal_gradient", "speed_lines", "conventional"]
# Other ways to map, on turbo_a alone.
WITHOUT_ZERO, DYNAMIC, ADIABATIC = "thermal_gradient, no zero", "thermal_gradient, dynamic, 120 s", "adiabatic"
SLOW_AIR = "thermal_gradient, screw compressor"
WAYS = [WITHOUT_ZERO, DYNAMIC, ADIABATIC, SLOW_AIR]
CAMPAIGNS = {ADIABATIC: "turbo_a_adiabatic.yaml", SLOW_AIR: "turbo_a_screw_compressor.yaml"}


def campaign(folder, machine, way, seed, dwell):
    text = (ROOT / "campaigns" / CAMPAIGNS.get(way, "turbo_a.yaml")).read_text()
    for old, new in MACHINES[machine]:
        text = replaced(text, old, new)
    text = re.sub(r"(?m)^seed: .*$", f"seed: {seed}", text)
    if way != ADIABATIC:
        text = re.sub(r"(?m)^order: .*$", f"order: {way.partition(',')[0]}", text)
    if dwell or way == DYNAMIC:
        text = re.sub(r"(?m)^  dwell: .*$", f"  dwell: {dwell or 120} s", text)
    if way in (WITHOUT_ZERO, DYNAMIC, ADIABATIC, "conventional"):
        text = re.sub(r"(?m)^zero: .*\n", "", text)
    if way == DYNAMIC:
        text = re.sub(r"(?m)^  method: .*$", "  method: dynamic", text)
    if way == "conventional":
        text = re.sub(r"(?m)^  joint: .*\n", "", text) + "\nrepeats: off\n"
        text = re.sub(r"(?m)^  method: .*$", "  method: steady", text)
    path = folder / f"{re.sub('[^a-z0-9]+', '_', way)}-{dwell or 'shipped'}-{seed}.yaml"
    path.write_text(text)
    return path


def mapped(mapper, path):
    """Minutes of the steps, figures of the plan, points of one run."""
    out = path.with_suffix("")
    done = subprocess.run([mapper, "run", str(path), "--out", str(out)], capture_output=True, text=True)
    runs = list(out.glob("*/points.json"))
    if not runs:
        raise SystemExit(f"{path.name}: {done.stderr.strip()[-2000:]}")
    points = [p for p in json.loads(runs[0].read_text())["points"] if p["kind"] == "point"]
    plan = json.loads((runs[0].parent / "plan.json").read_text())
    for file in out.rglob("*.mcap"):
        file.unlink()
    return sum(step["dwell_s"] for step in plan["steps"]) / 60.0, plan["figures"], points


def error(point):
    return 100.0 * (point["eta"] - point["truth"]["eta"])


def covered(points, low, high, truth):
    known = [p[low] <= p["truth"][truth] <= p[high] for p in points if p.get(low) is not None]
    return f"{100 * sum(known) / len(known):.0f} %" if known else "-"


def row(machine, order, runs):
    minutes = statistics.median(minutes for minutes, _, _ in runs)
    expected = [figures.get("rms_error_eta") for _, figures, _ in runs]
    points = [p for _, _, points in runs for p in points]
    good = [p for p in points if p["verdict"] == "good"]
    errors = [[error(p) for p in points if p["eta"] is not None] for _, _, points in runs]
    seeds = [math.sqrt(sum(e * e for e in of_seed) / len(of_seed)) for of_seed in errors]
    every = [e for of_seed in errors for e in of_seed]
    return [
        machine, order, f"{minutes:.0f}", f"{statistics.median(f['sum_gradient_k'] for _, f, _ in runs):.0f}",
        "-" if None in expected else f"{100 * statistics.median(expected):.2f}",
        f"{math.sqrt(sum(e * e for e in every) / len(every)):.2f}",
        f"{quantile(seeds, 0.5):.2f}", f"{max(seeds):.2f}", f"{max(map(abs, every)):.2f}",
        covered(good, "eta_low", "eta_high", "eta"), covered(good, "h_low_w_m2k", "h_high_w_m2k", "h_w_m2k"),
        f"{100 * len(good) / len(points):.0f} %",
    ]


def ranks(values):
    order = sorted(range(len(values)), key=values.__getitem__)
    return [order.index(place) for place in range(len(values))]


def forecasts(mapper, folder, machine, arguments, pool, seeds):
    """How the stated errors of plans with these orders and dwells compare with the realised ones: ratios, and Spearman's rank correlation."""
    plans = []
    for order in arguments.orders.split(";"):
        for dwell in arguments.dwells.split(","):
            runs = list(pool.map(lambda seed: mapped(mapper, campaign(folder, machine, order, seed, dwell)), seeds))
            errors = [error(p) for _, _, points in runs for p in points if p["eta"] is not None]
            realised = math.sqrt(sum(e * e for e in errors) / len(errors))
            stated = [[figures.get(key) for _, figures, _ in runs] for key in ("rms_error_eta", "rms_error_reported_eta")]
            plans.append([realised] + [None if None in of else 100 * statistics.median(of) for of in stated])
            print(machine, order, dwell, plans[-1], file=sys.stderr, flush=True)
    for name, place in (("as declared", 1), ("stated", 2)):
        known = [(plan[0], plan[place]) for plan in plans if plan[place] is not None]
        if len(known) < 3:
            continue
        ratios = sorted(realised / stated for realised, stated in known)
        a, b = (ranks([pair[side] for pair in known]) for side in (0, 1))
        rho = 1 - 6 * sum((x - y) ** 2 for x, y in zip(a, b)) / (len(known) * (len(known) ** 2 - 1))
        print(f"| {machine} | {name} | {len(known)} of {len(plans)} | {ratios[0]:.2f} to {ratios[-1]:.2f} | {rho:.2f} |", flush=True)


HEADS = [
    "machine", "order", "steps, min", "total gradient, K", "expected rms", "rms", "median seed", "worst seed", "worst point",
    "eta covered", "h covered", "good",
]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--machines", default=",".join(MACHINES))
    parser.add_argument("--orders", default=";".join(ORDERS))
    parser.add_argument("--dwell", help="another dwell than the campaign's, s")
    parser.add_argument("--dwells", help="compare stated errors with realised ones for each order with each of these dwells, s: 20,30,40,60,80")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", help="the page to write")
    arguments = parser.parse_args()
    mapper, rows = str(Path(arguments.mapper).resolve()), []
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for machine in arguments.machines.split(","):
            folder = Path(scratch) / machine.replace(" ", "_")
            folder.mkdir()
            write_table(folder / "bent.csv", 0.06, 0.0)
            write_table(folder / "steep.csv", 0.02, 1.2)
            shutil.copy(ROOT / "campaigns" / "stabilised.rhai", folder)
            if arguments.dwells:
                forecasts(mapper, folder, machine, arguments, pool, seeds)
                continue
            for order in arguments.orders.split(";") + (WAYS if machine == "turbo_a" and arguments.write else []):
                one = lambda seed: mapped(mapper, campaign(folder, machine, order, seed, arguments.dwell))
                rows.append(row(machine, order, list(pool.map(one, seeds))))
                print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
    if arguments.dwells:
        return
    table = [HEADS, ["---"] * 2 + ["---:"] * (len(HEADS) - 2), *rows]
    text = "\n".join("| " + " | ".join(cells) + " |" for cells in table)
    if arguments.write:
        Path(arguments.write).write_text(PAGE.format(date=datetime.date.today(), table=text, seeds=arguments.seeds))
    else:
        print(text)


PAGE = """\
# Orders of the same points

Made on {date} by this command, half an hour on two idle cores; do not edit:

    python3 benches/orders.py --mapper target/release/mapper --write docs/validation/orders.md

{seeds} seeds a row on the virtual lab, each with its own plan, noise, offsets and soak drawn from what is declared. The 48 points of
`campaigns/turbo_a.yaml`, each visited for 40 s, by `joint` after an isothermal zero; conventional mapping waits until T2 and the
housing drift by less than 0.1 K/min, and takes the efficiency from the temperature rise. Errors in points of efficiency.

turbo_a by four other ways, three without a zero: the same plan; `dynamic`, the method of the paper, with its two minutes a point; and
adiabatic mapping, which holds turbine inlet and oil at the compressor's outlet temperature and waits as conventional mapping does. The fourth is
`campaigns/turbo_a_screw_compressor.yaml`.

- **expected rms**: the plan's forecast, for a machine that is as declared. **rms**: realised, over all points and seeds.
- **covered**: share of the good points whose 95 % interval contains the truth.

{table}

The last machine is not as declared, so the forecast does not hold for it. No order can know alpha_A beforehand; the total gradient
decides how well the recording shows it.
"""


if __name__ == "__main__":
    main()
