"""A map before and after `mapper gap correct`, on recordings of the virtual lab with one withheld cause that biases the efficiency.

usage: python3 benches/gap_correct.py PROGRAM SEEDS [CAUSE...] [--write FILE]

PROGRAM is the built `mapper`; seeds are 1 to SEEDS. Each run is one of campaigns/gap_rig.yaml with one effect or sensor error, with a property of the
machine that biases nothing, or with a cause that is not in the library (`OUTSIDE`). Without CAUSE all are run; `outside` stands for those of `OUTSIDE`. Prints a
line a run on standard error and a table as Markdown, or writes it. Needs nothing but Python; a run takes about 20 s of one core.
"""

import json
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
CAUSES = {
    "nothing": {},
    "humidity": {"effects": "{humidity: 0.025}"},
    "recovery": {"effects": "{recovery: 0.3}"},
    "stem conduction": {"effects": "{stem_conduction: 8 %}"},
    "recirculation": {"effects": "{recirculation: 5 %}"},
    "inlet preheat": {"effects": "{inlet_preheat: 2 W/K}"},
    "heating/cooling ratio": {"effects": "{directional_htc: 0.6}"},
    "T2 offset": {"offset_of": "{T2: 2.5 K}"},
    "T1 offset": {"offset_of": "{T1: 2.5 K}"},
    "T1 towards the wall": {"effects": "{t1_towards_wall: 0.05}"},
    "Tc offset": {"offset_of": "{Tc: 4 K}"},
    "P2 offset": {"offset_of": "{P2: 1500 Pa}"},
    "lower efficiency": {"effects": "{efficiency_scale: 0.97}"},
    "larger flow map": {"effects": "{flow_map_scale: 1.03}"},
    "larger valve": {"effects": "{valve_area: 1.05}"},
}
# Causes outside the library as scripts: part of the machine, unit and range of the size, function, and size.
OUTSIDE = {
    "coolant": ("compressor_housing", "[W/K] 0 .. 20", "heat_to_compressor_w(at, p) { p.s * (358.15 - at.tc_k) }", "3 W/K"),
    "duct to the cell": ("compressor_gas", "[W/K] 0 .. 20", "gas_outlet_k(at, p, value) { value + (at.ambient_k - value) * (1.0 - (-p.s / (1006.0 * at.flow_kg_s)).exp()) }", "1 W/K"),
    "oil to the inlet": ("compressor_gas", "[W/K] 0 .. 20", "gas_before_k(at, p, value) { value + (at.oil_k - value) * (1.0 - (-p.s / (1006.0 * at.flow_kg_s)).exp()) }", "2 W/K"),
    "turbine to the outlet": ("compressor_gas", "[W/K] 0 .. 2", "gas_outlet_k(at, p, value) { value + (at.tt_k - value) * (1.0 - (-p.s / (1006.0 * at.flow_kg_s)).exp()) }", "0.2 W/K"),
    "T2 towards the oil": ("t2_probe", "[1] 0 .. 1", "reading_T2(at, p, value) { value + p.s * (at.oil_k - value) }", "0.04"),
    "T2 towards the turbine": ("t2_probe", "[1] 0 .. 1", "reading_T2(at, p, value) { value + p.s * (at.tt_k - value) }", "0.01"),
    "T2 gain": ("t2_probe", "[1] 0 .. 1", "reading_T2(at, p, value) { value + p.s * (value - 293.15) }", "0.03"),
}
CAUSES.update({name: {"script": OUTSIDE[name]} for name in OUTSIDE})


def errors(points):
    """Errors of the efficiency in points, and whether each 95 % interval contains the truth."""
    found = [
        (100 * (point["eta"] - point["truth"]["eta"]), point["eta_low"] <= point["truth"]["eta"] <= point["eta_high"])
        for point in points
        if point.get("eta") is not None and point.get("truth")
    ]
    return [abs(error) for error, _ in found], [holds for _, holds in found]


def corrected(program, cause, seed):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        text = (REPOSITORY / "campaigns/gap_rig.yaml").read_text()
        text = re.sub(r"^seed: \d+", f"seed: {seed}", text, flags=re.MULTILINE)
        file, nominal = folder / "planted.yaml", folder / "gap_rig.yaml"
        nominal.write_text(text)
        keys = dict(CAUSES[cause])
        if "script" in keys:
            part, limits, function, size = keys.pop("script")
            unit = limits.split("]")[0].strip("[")
            script = folder / "outside.rhai"
            script.write_text(
                f"//! effect: withheld\n//! description: withheld\n//! equation: withheld\n//! submodel: {part}\n"
                f"//! parameter: s [{unit}] {limits.split('] ')[1]}, neutral 0, step 0.01\n\nfn {function}\n"
            )
            keys["effects"] = f"{{{script}: {{s: {size}}}}}"
        keys = "".join(f"    {key}: {value}\n" for key, value in keys.items())
        file.write_text(text.replace("    start: settled\n", "    start: settled\n" + keys))
        run = subprocess.run([program, "run", file, "--out", folder / "runs", "--json"], capture_output=True, text=True)
        if not run.stdout:
            return {"cause": cause, "seed": seed, "failed": run.stderr.strip()[-200:]}
        recording = json.loads(run.stdout)["recording"]
        before = json.loads(
            subprocess.run(
                [program, "identify", recording, "--campaign", nominal, "--json"], capture_output=True, text=True, check=True
            ).stdout
        )
        after = subprocess.run(
            [program, "gap", "correct", nominal, recording, "--json"], capture_output=True, text=True
        )
        if after.returncode:
            return {"cause": cause, "seed": seed, "failed": after.stderr.strip()[-200:]}
        after = json.loads(after.stdout)
        refused = after["correction"]["refused"]
        return {
            "cause": cause,
            "seed": seed,
            "refused": refused and refused["reason"],
            "named": [" + ".join(cause["effects"]) for cause in after["correction"]["causes"]],
            "before": errors(before["points"]),
            "after": errors(after["identified"]["points"]),
        }


def main(arguments):
    target = None
    if "--write" in arguments:
        at = arguments.index("--write")
        target = pathlib.Path(arguments[at + 1])
        del arguments[at : at + 2]
    program, seeds, causes = arguments[0], int(arguments[1]), arguments[2:] or list(CAUSES)
    causes = [name for cause in causes for name in (OUTSIDE if cause == "outside" else [cause])]
    lines = [
        "| cause | corrected | median error before | after | worst before | after | intervals that hold before | after |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for cause in causes:
        with ThreadPoolExecutor(2) as pool:
            results = list(pool.map(lambda seed: corrected(program, cause, seed), range(1, seeds + 1)))
        for result in results:
            brief = {key: result.get(key) for key in ["cause", "seed", "refused", "named", "failed"]}
            if "before" in result:
                brief["error"] = [round(statistics.median(result[when][0]), 3) for when in ["before", "after"]]
            print(brief, file=sys.stderr, flush=True)
        good = [result for result in results if "before" in result]
        if not good:
            continue
        gathered = {
            when: ([e for r in good for e in r[when][0]], [h for r in good for h in r[when][1]]) for when in ["before", "after"]
        }
        cells = [cause, f"{sum(r['refused'] is None for r in good)} of {len(results)}"]
        for read in (statistics.median, max):
            cells += [f"{read(gathered[when][0]):.2f}" for when in ["before", "after"]]
        cells += [f"{100 * statistics.mean(gathered[when][1]):.0f} %" for when in ["before", "after"]]
        lines.append("| " + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n"
    if target:
        target.write_text(text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main(sys.argv[1:])
