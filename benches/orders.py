"""Orders of the same points at equal time: what the plan forecasts, and what many seeds then err.

    cargo build --release
    python3 benches/orders.py --mapper target/release/mapper --write docs/orders.md

Each seed draws its own noise and offsets from the declared spread; all steps last 40 s. The machines:

- turbo_a: the campaign that ships, and the machine as declared;
- grid18: the 18 points of the paper's figure 13;
- steep map: the same points on a machine whose efficiency drops more steeply towards choke, and by 2 points more towards low speed;
  the program knows its map;
- alpha_A 0.15: turbo_a with 0.15 of its internal area before the wheel, of which nothing is declared.
"""

import argparse
import concurrent.futures
import json
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from seeds import quantile, write_table

ROOT = Path(__file__).resolve().parent.parent
ZERO = "zero: {soak: 30 min, evenness: 0.03 K, pressure_evenness: 3 Pa}"
# Name in the table: method, zero.
METHODS = {"dynamic": ("dynamic", False), "joint": ("joint", False), "joint after the zero": ("joint", True)}
AFTER_THE_ZERO = ["joint after the zero"]
# Campaign, what is replaced in it, methods.
MACHINES = {
    "grid18": ("grid18", {}, list(METHODS)),
    "turbo_a": ("turbo_a", {}, list(METHODS)),
    "steep map": ("turbo_a", {"map: closed_form": "map: {file: steep.csv, reference: SAE}"}, list(METHODS)),
    "alpha_A 0.15": (
        "turbo_a", {"virtual_lab: {}": "virtual_lab: {machine: {alpha_area: 0.15}}"}, AFTER_THE_ZERO,
    ),
}
ORDERS = ["information", "information 75 %", "sum_gradient", "worst_gradient", "greedy", "speed_lines"]
DWELL = "40 s"


def campaign(folder, machine, method, order, seed):
    name, replaced, _ = MACHINES[machine]
    identification, zero = METHODS[method]
    text = (ROOT / "campaigns" / f"{name}.yaml").read_text()
    for old, new in replaced.items():
        if old not in text:
            raise SystemExit(f"the campaign does not hold {old!r} any more: mend benches/orders.py")
        text = text.replace(old, new, 1)
    text = re.sub(r"(?m)^(order|seed|zero|required_sigma_eta):.*\n", "", text)
    text = re.sub(r"(?m)^  (dwell|warm_up|method|window):.*\n", "", text)
    text = re.sub(r"(?m)^timing:.*$", f"timing:\n  dwell: {DWELL}\n  warm_up: 2 min", text)
    text = re.sub(r"(?m)^identification:.*$", f"identification:\n  method: {identification}", text)
    order, _, share = order.partition(" ")
    text += f"\norder: {order}\nseed: {seed}\n" + (ZERO + "\n" if zero else "") + (f"gradient_share: {share}\n" if share else "")
    path = folder / f"{order}{share[:2]}-{seed}.yaml"
    path.write_text(text)
    return path


def mapped(mapper, folder, machine, method, order, seed):
    """Plan's figures, errors of the points, minutes of the steps."""
    path = campaign(folder, machine, method, order, seed)
    out = folder / path.stem
    done = subprocess.run([mapper, "run", str(path), "--out", str(out)], capture_output=True, text=True)
    runs = list(out.glob("*/points.json"))
    if not runs:
        raise SystemExit(f"{machine}, {method}, {order}, seed {seed}: {done.stderr.strip()[-2000:]}")
    points = [p for p in json.loads(runs[0].read_text())["points"] if p["kind"] == "point"]
    plan = json.loads((runs[0].parent / "plan.json").read_text())
    for file in out.rglob("*.mcap"):
        file.unlink()
    known = [p for p in points if p["eta"] is not None]
    errors = [100.0 * (p["eta"] - p["truth"]["eta"]) for p in known]
    held = [p["eta_low"] <= p["truth"]["eta"] <= p["eta_high"] for p in known if p["eta_low"] is not None]
    good = sum(p["verdict"] == "good" for p in points) / len(points)
    return plan["figures"], errors, held, good


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def row(machine, method, order, runs):
    figures = runs[0][0]
    per_seed = [rms(errors) for _, errors, _, _ in runs]
    errors = [e for _, errors, _, _ in runs for e in errors]
    held = [h for _, _, held, _ in runs for h in held]
    percent = lambda value: "-" if value is None else f"{100 * value:.2f}"
    return [
        machine, method, order, f"{figures['minutes']:.0f}", f"{figures['sum_gradient_k']:.0f}",
        percent(figures["rms_error_eta"]), percent(figures["open_rms_error_eta"]),
        f"{rms(errors):.2f}", f"{quantile(per_seed, 0.5):.2f}", f"{max(per_seed):.2f}", f"{max(map(abs, errors)):.2f}",
        f"{100 * sum(held) / len(held):.0f} %" if held else "-", f"{100 * sum(g for *_, g in runs) / len(runs):.0f} %",
    ]


HEADS = [
    "machine", "method", "order", "min", "gradients, K", "forecast", "forecast, open", "rms", "median seed", "worst seed",
    "worst point", "held", "good",
]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--machines", default=",".join(MACHINES))
    parser.add_argument("--orders", default=",".join(ORDERS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", help="the page to write")
    arguments = parser.parse_args()
    mapper, rows = str(Path(arguments.mapper).resolve()), []
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for machine in arguments.machines.split(","):
            for method in MACHINES[machine][2]:
                folder = Path(scratch) / f"{machine}-{method}".replace(" ", "_")
                folder.mkdir()
                write_table(folder / "steep.csv", 0.02, 1.2)
                for order in arguments.orders.split(","):
                    if METHODS[method][0] != "joint" and " " in order:
                        continue  # Shares of the gradients are kept under `joint` alone.
                    one = lambda seed: mapped(mapper, folder, machine, method, order, seed)
                    runs = list(pool.map(one, range(1, arguments.seeds + 1)))
                    rows.append(row(machine, method, order, runs))
                    print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
    table = [HEADS, ["---"] * 3 + ["---:"] * (len(HEADS) - 3), *rows]
    text = "\n".join("| " + " | ".join(cells) + " |" for cells in table)
    if arguments.write:
        Path(arguments.write).write_text(PAGE.format(table=text, seeds=arguments.seeds))
    else:
        print(text)


PAGE = """\
# Orders of the same points at equal time

Generated; do not edit. The command, some half an hour on two cores:

    python3 benches/orders.py --mapper target/release/mapper --write docs/orders.md

{seeds} seeds a row on the virtual lab, each with its own noise, offsets and soak drawn from what is declared; every step lasts 40 s, jump
included, after a warm-up of 2 minutes (both, with repeats, are the minutes; a soak is not). Errors of the efficiency in points.
"Forecast" is the plan's rms error on a machine as declared, "forecast, open" where alpha_A, the probe and the direction of the heat
have to be found from the recording; "rms" is what all points of all seeds erred, then the middle and the worst seed and the worst
point of all. "information 75 %" is `order: information` with `gradient_share: 75 %`.

{table}

Twenty seeds are few: the worst two or three of them make most of a row's rms, and another twenty move it by a sixth. Within that, with 48
points and `joint` no order of large jumps is better than another, after the zero as without it; along speed lines the same points err
alike where all is as declared, half as much again on the steep map, and twice as much where alpha_A has to be found, and hardly any of
turbo_a's can be called good. With 18 points speed lines err two to ten times as much as jumps. That is what jumps are made for.

`information` ships for turbo_a: after the zero no order errs less, and by the open forecast none is better by more than a percent. It is not within
5 % of the best in every row: `sum_gradient` errs less on grid18 after the zero (0.24 beside 0.30 points), orders of larger gradients on the
steep map without a zero, and the share of 75 % with alpha_A undeclared: forecasts do not tell these apart.
`mapper plan --compare` and `mapper check` go by the forecast. Under `dynamic` the order of least error is `information` but on grid18, where
speed lines have the smallest jumps and so the least bias (1.23 beside 1.37): the paper's largest gradients cost that method a tenth.
`steady` is not here: it waits until nothing moves, see [methods.md](methods.md).
"""


if __name__ == "__main__":
    main()
