"""Surge sought on the virtual lab, and the slowest line left out: many seeds, errors against the truth.

    cargo build --release --locked
    python3 benches/surge_lines.py --mapper target/release/mapper --write docs/validation/maps.md

Each seed draws noise and offsets; the margin at which the variation before surge begins is drawn from 18 to 30 %, its size from
0.2 to 0.5 % of the flow at half that margin. The rows differ in what else is drawn, and in the law of the growth, of which the
program knows nothing. The slowest line is left out of the map that `campaigns/turbo_a_surge.yaml` makes.
"""

import argparse
import concurrent.futures
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

from machines import ROOT, replaced

DRAWN = "tolerances: drawn, weather: wandering, "
# Row of the table: settings of the lab, exponent of the growth.
ROWS = {
    "flow meter without error": ("offsets: none, ", 1.0),
    "tolerances and weather drawn too": (DRAWN, 1.0),
    "the same, variance with margin^-0.8": (DRAWN, 0.8),
    "the same, variance with margin^-1.3": (DRAWN, 1.3),
}


def quantile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def lab(seed, settings, growth):
    rng = random.Random(seed)
    onset, size = rng.uniform(18.0, 30.0), 10.0 ** rng.uniform(-0.7, -0.3)
    return (
        f"virtual_lab: {{{settings}surge_precursor: {{onset: {onset:.2f} %, size: {size:.3f} %, growth: {growth}}}}}"
    )


def run(mapper, text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "campaign.yaml"
        path.write_text(text)
        done = subprocess.run(
            [mapper, "run", path, "--json", "--out", folder], capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            sys.exit(done.stderr)
        result = json.loads(done.stdout)
        return result["surge"], json.loads(Path(result["map"]["json"]).read_text())


def marks_alone(args):
    """The search alone, behind one opening of each line."""
    mapper, seed, settings, growth = args
    text = (ROOT / "campaigns" / "turbo_a_surge.yaml").read_text()
    text = replaced(text, "openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5]")
    text = replaced(text, "warm_up: 10 min ", "warm_up: 2 min ")
    text = replaced(text, "dwell: 120 s ", "dwell: 30 s ")
    text = replaced(text, "zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", "")
    text = replaced(text, "method: joint ", "method: steady ")
    text = replaced(text, "formats: [csv, json, svg, surge]", "formats: [json]")
    text = replaced(text, "order: thermal_gradient ", "repeats: off\norder: listed ")
    text = replaced(text, "virtual_lab: {}", lab(seed, settings, growth))
    return run(mapper, replaced(text, "seed: 1 ", f"seed: {seed} "))[0]


def whole_map(args):
    mapper, seed = args
    text = (ROOT / "campaigns" / "turbo_a_surge.yaml").read_text()
    text = replaced(text, "formats: [csv, json, svg, surge]", "formats: [json]")
    text = replaced(text, "virtual_lab: {}", lab(seed, DRAWN, 1.0))
    return run(mapper, replaced(text, "seed: 1 ", f"seed: {seed} "))[1]


def surge_row(name, searches):
    errors, held, surges, openings = [], 0, 0, 0
    for search in searches:
        surges += search["surges"]
        for mark in search["marks"]:
            truth = mark["truth_flow_corrected_kg_s"]
            error = mark["flow_corrected_kg_s"] - truth
            own, common = mark["flow_standard_error_kg_s"], mark["flow_common_standard_error_kg_s"]
            held += abs(error) <= 1.96 * (own**2 + common**2) ** 0.5
            errors.append(100.0 * abs(error) / truth)
            openings += mark["steps"]
    missing = sum(len(search["remarks"]) for search in searches)
    return (
        f"| {name} | {len(errors)} | {missing} | {surges} | {quantile(errors, 0.5):.2f} | {quantile(errors, 0.95):.2f} "
        f"| {max(errors):.2f} | {sum(error > 2.0 for error in errors)} | {100.0 * held / len(errors):.0f} "
        f"| {openings / len(errors):.0f} |"
    )


def low_speed_row(maps):
    slowest = [min(map_["fitted"]["left_out"], key=lambda line: line["speed_corrected_rpm"]) for map_ in maps]

    def column(key):
        return [100.0 * line[key] for line in slowest]

    distance, eta = column("distance_ratio"), column("eta")
    held = [sum(column(key)) / len(slowest) for key in ("distance_held_ratio", "eta_held_ratio")]
    return (
        f"| {len(maps)} | {quantile(distance, 0.5):.2f} | {max(distance):.2f} | {quantile(eta, 0.5):.2f} "
        f"| {max(eta):.2f} | {held[0]:.0f} | {held[1]:.0f} |"
    )


def between(text, name, table):
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    head, rest = text.split(begin)
    return head + begin + table + end + rest.split(end)[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", metavar="FILE", help="put the tables into this page")
    arguments = parser.parse_args()
    seeds = range(1, arguments.seeds + 1)
    surge = (
        "| virtual lab | lines | not found | surges | error, %: median | 95 % | worst | beyond 2 % | intervals that hold, % "
        "| openings a line |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n"
    )
    low = (
        "| seeds | distance, %: median | worst | efficiency, points: median | worst | within their 95 % bands, %: distance "
        "| efficiency |\n|---:|---:|---:|---:|---:|---:|---:|\n"
    )
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for name, (settings, growth) in ROWS.items():
            tasks = [(arguments.mapper, seed, settings, growth) for seed in seeds]
            row = surge_row(name, list(pool.map(marks_alone, tasks)))
            print(row, flush=True)
            surge += row + "\n"
        row = low_speed_row(list(pool.map(whole_map, [(arguments.mapper, seed) for seed in seeds])))
        print(row)
        low += row + "\n"
    if arguments.write:
        page = ROOT / arguments.write
        page.write_text(between(between(page.read_text(), "surge lines", surge), "low-speed end", low))


if __name__ == "__main__":
    main()
