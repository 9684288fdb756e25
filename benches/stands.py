"""The map of turbo_a on stands whose air and valve move at other speeds: highest speed, overshoot, surges, and what the points are worth.

usage: python3 benches/stands.py PROGRAM STUDY SEEDS [STAND...]
       python3 benches/stands.py random STUDY FIRST COUNT
       python3 benches/stands.py served BIN PYTHON FIRST COUNT

PROGRAM is the built `mapper`, STUDY the example `stand_study` of mapper-session. Each stand is `campaigns/turbo_a.yaml` with a speed limit of 170 krpm,
the highest target being 155 krpm; seeds are 1 to SEEDS. Prints a line a run on standard error and the table as Markdown. Run by run, on one core.

`random` draws stands, declared or not, with their machine (inertia, volume), grid and speed limit, and lists those on which the shaft leaves its limit or
exceeds the higher target of a jump by more than 2 %, the compressor surges, the surge margin falls below 4.5 %, or the run does not end.

`served` draws stands behind pymodbus (even numbers) and asyncua in real time, all at once: `mapper rig commission --write` measures the actuators on every
other two, which declare nothing, and compares on the rest; then four points are run with what the campaign has. BIN has `mapper`, its drivers and
`examples/stand_study`; PYTHON the packages of tests/python/requirements.txt.
"""

import json
import math
import os
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import threading

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent


def p3(lag, rate, dead="0 s"):
    return f"turbine_inlet_pressure: {{lag: {lag}, RATE: {rate}, dead_time: {dead}}}"


def valve(lag, rate, play="0 %"):
    return f"valve: {{lag: {lag}, RATE: {rate}}}", f"valve_play: {play}"


SLOW_VALVE = valve("1 s", "0.2 1/s")
# Motion of P3, of the valve and play: of the lab, and of the campaign if it declares them.
STANDS = {
    "fast valve": ([], True),
    "P3 3 s, 20 kPa/s": ([p3("3 s", "20 kPa/s")], True),
    "P3 3 s, 20 kPa/s, undeclared": ([p3("3 s", "20 kPa/s")], False),
    "P3 8 s, 5 kPa/s": ([p3("8 s", "5 kPa/s")], True),
    "P3 8 s, 5 kPa/s, undeclared": ([p3("8 s", "5 kPa/s")], False),
    "P3 stroke 30 s": ("stroke: 30 s", True),
    "P3 stroke 60 s": ("stroke: 60 s", True),
    "P3 stroke 120 s": ("stroke: 120 s", True),
    "valve 1 s, 0.2 1/s": ([SLOW_VALVE], True),
    "valve 1 s, 0.2 1/s, undeclared": ([SLOW_VALVE], False),
    "play 2 %": ([valve("0.2 s", "1 1/s", "2 %")], True),
    "play 5 %": ([valve("0.2 s", "1 1/s", "5 %")], True),
    "play 5 %, undeclared": ([valve("0.2 s", "1 1/s", "5 %")], False),
    "P3 8 s, 5 kPa/s, 1 s dead; valve 1 s, 0.2 1/s, play 2 %": ([p3("8 s", "5 kPa/s", "1 s"), valve("1 s", "0.2 1/s", "2 %")], True),
}


def campaign(stand, seed):
    motions, is_declared = STANDS[stand]
    text = (REPOSITORY / "campaigns" / "turbo_a.yaml").read_text()
    text = text.replace("seed: 1 ", f"seed: {seed} ").replace("speed: 180 krpm", "speed: 170 krpm")
    if isinstance(motions, str):
        text = text.replace("max: 500 kPa}", f"max: 500 kPa, {motions}}}")
        motions = [p3("0.3 s", f"{390 / int(motions.split()[1])} kPa/s")]
        is_declared = False
    flat = [part for motion in motions for part in ([motion] if isinstance(motion, str) else motion)]
    lab = ", ".join(part.replace("RATE", "slew") for part in flat)
    if is_declared:
        # The lab moves as declared.
        declared = [part.replace("RATE", "rate") for part in flat]
        play = [part for part in declared if part.startswith("valve_play")]
        declared = [part.replace("}", ", " + play[0].replace("valve_", "") + "}") if part.startswith("valve:") and play else part for part in declared]
        declared = ", ".join(part for part in declared if not part.startswith("valve_play"))
        return text.replace("order: thermal", f"rig: {{actuators: {{{declared}}}}}\norder: thermal") if flat else text
    return text.replace("virtual_lab: {}", f"virtual_lab: {{actuators: {{{lab}}}}}")


def run(program, study, stand, seed):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "stand.yaml"
        file.write_text(campaign(stand, seed))
        ran = subprocess.run([program, "run", file, "--out", f"{folder}/runs", "--json", "--truth", "--progress", "off"], capture_output=True, text=True)
        if not ran.stdout:
            return {"failure": ran.stderr.strip()[-200:]}
        result = json.loads(ran.stdout)
        if result.get("failure"):
            return {"failure": str(result["failure"])[:200]}
        seen = json.loads(subprocess.run([study, "recordings", result["recording"]], capture_output=True, text=True, check=True).stdout)
        points = [point for point in result["points"] if point.get("eta") is not None]
        good = [point for point in points if point["verdict"] == "good"]
        held = sum(point["eta_low"] <= point["truth"]["eta"] <= point["eta_high"] for point in good)
        errors = [100 * (point["eta"] - point["truth"]["eta"]) for point in good]
        return seen | {"points": len(result["points"]), "good": len(good), "held": held, "errors": errors}


def random_stand(number):
    """The campaign of the stand with this number, and what is drawn."""
    draw = random.Random(number)
    log = lambda low, high: low * (high / low) ** draw.random()
    lag, rate = log(0.2, 10), log(2, 50) if draw.random() < 0.8 else 200
    dead = draw.choice([0, 0, draw.uniform(0, 2)])
    valve_lag, valve_rate = log(0.1, 2), log(0.1, 2)
    play, band = draw.choice([0, draw.uniform(1, 8)]), draw.choice([0, draw.uniform(0, 2)])
    is_declared = draw.random() < 0.6
    speeds = sorted(draw.sample(range(45, 166, 5), draw.choice([2, 3, 4])))
    openings = sorted(draw.sample([0.45, 0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0, 2.5], draw.choice([2, 3, 4])))
    inertia, volume, limit = 16e-6 * log(0.3, 4), 0.78e-3 * log(0.3, 5), max(speeds) * draw.choice([1.04, 1.1])
    p3 = f"turbine_inlet_pressure: {{lag: {lag:.2f} s, RATE: {rate:.2f} kPa/s, dead_time: {dead:.2f} s}}"
    of_valve = f"lag: {valve_lag:.2f} s, RATE: {valve_rate:.2f} 1/s"
    declared = f"{p3}, valve: {{{of_valve}, play: {play:.1f} %, dead_band: {band:.1f} %}}".replace("RATE", "rate")
    true = f"{p3}, valve: {{{of_valve}}}, valve_play: {play:.1f} %, valve_dead_band: {band:.1f} %".replace("RATE", "slew")
    text = (REPOSITORY / "campaigns" / "turbo_a.yaml").read_text()
    text = re.sub(r"^zero: .*\n", "", text, flags=re.M)
    text = re.sub(r"speeds: \[.*\]", f"speeds: [{', '.join(f'{speed} krpm' for speed in speeds)}]", text, count=1)
    text = re.sub(r"openings: \[.*\]", f"openings: {openings}", text, count=1)
    for old, new in [
        ("shaft_inertia: 16e-6", f"shaft_inertia: {inertia:.3e}"),
        ("volume: 0.78e-3", f"volume: {volume:.3e}"),
        ("speed: 180 krpm", f"speed: {limit:.1f} krpm"),
        ("max: 500 kPa", "max: 600 kPa"),
        ("seed: 1 ", f"seed: {number} "),
        ("order: thermal", f"rig: {{actuators: {{{declared}}}}}\norder: thermal") if is_declared else ("virtual_lab: {}", f"virtual_lab: {{actuators: {{{true}}}}}"),
    ]:
        text = text.replace(old, new, 1)
    return text, limit, f"{'declared' if is_declared else 'undeclared'} {declared}, {inertia:.2g} kg m2, {volume:.2g} m3, {speeds} krpm, {openings}"


def sweep(study, first, count):
    line_of = re.compile(r"\| ([\d.]+) krpm \| overshoots \[(.*?)\] \| surges (\d+) \| margin (\S+) % .* \| (.*?) \|$")
    left = 0
    for number in range(int(first), int(first) + int(count)):
        text, limit, drawn = random_stand(number)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "stand.yaml"
            file.write_text(text)
            lines = subprocess.run([study, file, str(number)], capture_output=True, text=True).stdout.strip().splitlines()
        found = line_of.search(lines[-1]) if lines else None
        overshoots = [float(one) for one in re.findall(r"\(([\d.-]+), \d+\)", found[2])] if found else []
        if not found or float(found[1]) > limit or max(overshoots, default=0) > 2 or int(found[3]) or float(found[4]) < 4.5 or found[5] != "Completed":
            left += 1
            print(number, drawn, lines[-1:], flush=True)
    print(f"{left} of {count} stands leave a limit")


# A sample and a half.
TRANSPORT_S = 0.15


def served_stand(binaries, python, number):
    """What commissioning and a run give on a drawn stand behind a third-party server."""
    draw = random.Random(number)
    log = lambda low, high: round(low * (high / low) ** draw.random(), 2)
    p3 = {"lag": log(0.5, 5), "rate": log(5, 40), "dead_time": draw.choice([0, round(draw.uniform(0.2, 1.5), 1)])}
    valve = {"lag": log(0.3, 1.5), "rate": log(0.15, 1.5), "play": draw.choice([0, round(draw.uniform(1, 5), 1)]), "dead_band": draw.choice([0, round(draw.uniform(0.2, 1), 1)])}
    is_declared, driver = number // 2 % 2 == 0, ["modbus", "opcua"][number % 2]
    actuators = {"p3": p3 | {"rate": 1e3 * p3["rate"]}, "valve": valve | {"play": 0.01 * valve["play"], "dead_band": 0.01 * valve["dead_band"]}}
    script, arguments = ("modbus_rig.py", ["0", json.dumps(actuators)]) if driver == "modbus" else ("opcua_rig.py", ["0", "--actuators", json.dumps(actuators)])
    server = subprocess.Popen([python, REPOSITORY / "tests/python" / script, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    port = server.stdout.readline().strip()
    text = (REPOSITORY / "examples/rig" / ("first_points.yaml" if driver == "modbus" else "first_points_opcua.yaml")).read_text()
    text = re.sub(r"^    (user|password): .*\n", "", text, flags=re.M)
    declared = "turbine_inlet_pressure: {lag: LAG s, rate: RATE kPa/s, dead_time: DEAD s}".replace("LAG", str(p3["lag"])).replace("RATE", str(p3["rate"])).replace("DEAD", str(p3["dead_time"]))
    declared += f", valve: {{lag: {valve['lag']} s, rate: {valve['rate']} 1/s, play: {valve['play']} %, dead_band: {valve['dead_band']} %}}"
    for old, new in [
        (":5020 ", f":{port} "),
        (":4840", f":{port}"),
        ("basic256_sha256 ", "none "),
        ("timeout: 200 ms", "timeout: 800 ms"),
        ("timeout: 300 ms", "timeout: 800 ms"),
        ("rig: cell_3", f"rig: stand_{number}"),
        ("openings: [1.0]", "openings: [0.8, 1.3]"),
        ("dwell: 120 s", "dwell: 60 s"),
        ("limits:\n", f"rig: {{actuators: {{{declared}}}}}\nlimits:\n" if is_declared else "limits:\n"),
    ]:
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "stand.yaml"
        file.write_text(text)
        environment = os.environ | {"MAPPER_STATE_DIR": f"{folder}/state", "PATH": f"{binaries}:{os.environ['PATH']}"}

        def mapper(*words):
            ran = subprocess.run([f"{binaries}/mapper", *words, "--out", f"{folder}/runs", "--json", "--progress", "off"], capture_output=True, text=True, env=environment)
            return json.loads(ran.stdout) if ran.returncode == 0 else {"failure": (ran.stderr.strip() or ran.stdout)[:300]}

        commissioned = mapper("rig", "commission", file, *([] if is_declared else ["--write"]))
        true = {("turbine_inlet_pressure", key): value for key, value in p3.items()} | {("valve", key): value for key, value in valve.items()}
        within, outside = 0, []
        for value in commissioned.get("actuators", []):
            expected, measured = true.get((value["actuator"], value["key"])), value["measured"]
            if expected is None:
                continue
            high = math.inf if measured["high"] is None else measured["high"]
            # Bus and polling add to the dead time.
            if measured["low"] - (TRANSPORT_S if value["key"] == "dead_time" else 0) <= expected <= high:
                within += 1
            else:
                outside.append(f"{value['actuator']} {value['key']} {expected}: {measured['low']:.3g} to {high:.3g}")
        ran = mapper("run", file) if "failure" not in commissioned else {}
        seen = json.loads(subprocess.run([f"{binaries}/examples/stand_study", "recordings", ran["recording"]], capture_output=True, text=True, check=True).stdout) if "recording" in ran else {}
    server.stdin.close()
    server.wait()
    what = f"{number} {driver} {'declared' if is_declared else 'undeclared'} P3 {p3} valve {valve}"
    print(f"{what}: {within} within, outside {outside}, {seen}, {commissioned.get('failure') or ran.get('failure') or 'completed'}", flush=True)


def serve(binaries, python, first, count):
    threads = [threading.Thread(target=served_stand, args=(binaries, python, number)) for number in range(int(first), int(first) + int(count))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def main(program, study, seeds, *stands):
    print("| stand | runs | minutes | highest N, krpm | worst overshoot, % | surges | good | hold, % | rms error, points |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|", flush=True)
    for stand in stands or STANDS:
        runs = []
        for seed in range(1, int(seeds) + 1):
            found = run(program, study, stand, seed)
            print(stand, seed, {key: value for key, value in found.items() if key != "errors"}, file=sys.stderr, flush=True)
            if "failure" not in found:
                runs.append(found)
        total = lambda key: sum(found[key] for found in runs)
        errors = [error for found in runs for error in found["errors"]]
        rms = math.sqrt(statistics.mean(error * error for error in errors)) if errors else math.nan
        minutes = statistics.mean(found["steps_s"] for found in runs) / 60
        highest, overshoot = max(found["highest_rpm"] for found in runs), max(found["overshoot_ratio"] for found in runs)
        print(
            f"| {stand} | {len(runs)} of {seeds} | {minutes:.0f} | {highest / 1e3:.1f} | {100 * overshoot:.1f} | {total('surges')} | {total('good')} of {total('points')} "
            f"| {100 * total('held') / max(total('good'), 1):.1f} | {rms:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    {"random": sweep, "served": serve}.get(sys.argv[1], lambda *rest: main(sys.argv[1], *rest))(*sys.argv[2:])
