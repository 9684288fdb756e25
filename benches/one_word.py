"""One campaign on five rigs, `backend:` changed by one word: virtual lab, the lab behind OPC UA and behind Modbus, the rig in Python, an FMU.

    python3 benches/one_word.py --bin target/release [--python target/python-env/bin/python] [--out DIRECTORY] [--real-time 'chrt -f 5']

Needs mapper, its drivers and mapper-lab-server in --bin and the packages of tests/python/requirements.txt. The two behind servers go on in real time,
signed and encrypted where it is OPC UA: twelve minutes. What --real-time says is put before those and their servers: on a computer that has other things
to do they have the processor first. Prints the efficiency of each point by each rig, and what `identify`, `gap` and `drift` say
of each recording.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
PARTS = [
    ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [80 krpm, 125 krpm]"),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("seed: 1 ", "repeats: off\nseed: 1 "),
    ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ("method: joint ", "method: dynamic "),
]
GUIDE = (ROOT / "docs/how-to/rig.md").read_text()


def campaign(path, backend):
    text = (ROOT / "campaigns/turbo_a.yaml").read_text()
    for old, new in [*PARTS, ("  virtual_lab: {}", backend)]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text)
    return path


def of_the_guide(driver, *replacements):
    settings = GUIDE.split(f"```yaml\nbackend:\n  {driver}:\n")[1].split("\n```")[0]
    for old, new in replacements:
        assert settings.count(old) == 1, old
        settings = settings.replace(old, new)
    return f"  {driver}:\n{settings}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    parser.add_argument("--python", type=pathlib.Path, default=sys.executable)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--real-time", type=str.split, default=[])
    arguments = parser.parse_args()
    bins, out = arguments.bin.resolve(), arguments.out or pathlib.Path(tempfile.mkdtemp())
    out.mkdir(parents=True, exist_ok=True)
    python = pathlib.Path(arguments.python).absolute()
    path = os.pathsep.join(map(str, [python.parent, ROOT / "plugins/drivers/python", os.environ["PATH"]]))
    environment = {**os.environ, "PATH": path, "MAPPER_STATE_DIR": str(out / "state"), "PLC_USER": "lab", "PLC_PASSWORD": "hunter2"}

    def call(program, *words, check=True):
        done = subprocess.run([str(bins / program), *map(str, words)], capture_output=True, text=True, env=environment, cwd=ROOT)
        if check and done.returncode:
            sys.exit(f"{program} {words}: {done.stderr}")
        return done

    # One lab each: two runs on one stand would disturb each other.
    lab = campaign(out / "virtual_lab.yaml", "  virtual_lab: {}")
    servers, places = [], {}
    for name in ("opcua", "modbus"):
        server = subprocess.Popen([*arguments.real_time, str(bins / "mapper-lab-server"), str(lab), f"--{name}", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True, env=environment)
        servers.append(server)
        places[name] = server.stdout.readline().split()[1]
    call("mapper-backend-opcua", "trust", places["opcua"])
    fmu = subprocess.run([str(python), str(ROOT / "tests/python/build_fmu.py"), str(out / "small.fmu")], capture_output=True, text=True, check=True).stdout
    files = {
        "virtual_lab": lab,
        "opcua": campaign(out / "opcua.yaml", of_the_guide("opcua", ("opc.tcp://127.0.0.1:4840", places["opcua"]), ("rig: cell_3 ", "rig: cell_4 "))),
        "modbus": campaign(out / "modbus.yaml", of_the_guide("modbus", ("127.0.0.1:5020", places["modbus"]))),
        "python_rig": campaign(out / "python_rig.yaml", "  python_rig: {noise: 1}"),
        "fmu": campaign(out / "fmu.yaml", "  fmu: " + fmu.strip()),
    }
    first = {name: arguments.real_time if name in places else [] for name in files}
    runs = {name: subprocess.Popen([*first[name], str(bins / "mapper"), "run", str(file), "--json", "--out", str(out / f"runs-{name}")], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env=environment, cwd=ROOT) for name, file in files.items()}
    results = {}
    for name, process in runs.items():
        printed, errors = process.communicate()
        if process.returncode:
            print(f"{name}: exit {process.returncode}\n{errors[-2000:]}")
        results[name] = {"points": [], **json.loads(printed)}
    for server in servers:
        server.kill()
    (out / "results.json").write_text(json.dumps(results))

    points = {name: {point["step"]: point for point in result["points"] if point.get("eta") is not None} for name, result in results.items()}
    steps = sorted(points["virtual_lab"])
    print("| step |", " | ".join(files), "|\n|---:|" + "---:|" * len(files))
    for step in steps:
        cells = [f"{100 * points[name][step]['eta']:.2f}" if step in points[name] else "-" for name in files]
        print(f"| {step} |", " | ".join(cells), "|")
    for name in files:
        common = [step for step in steps if step in points[name]]
        off = [0.0] + [abs(points[name][step]["eta"] - points["virtual_lab"][step]["eta"]) for step in common]
        print(f"{name}: {len(common)} points, at most {100 * max(off):.2f} percentage points of efficiency from the virtual lab's")
    for name in files:
        directory = next((out / f"runs-{name}").iterdir())
        again = json.loads(call("mapper", "identify", directory, "--json").stdout)
        eta = [point.get("eta") for point in again["points"]] == [point.get("eta") for point in results[name]["points"]]
        gap = call("mapper", "gap", "diagnose", directory / "campaign.yaml", "--recording", directory / "recording.mcap", "--json", check=False)
        drift = call("mapper", "drift", directory, "--json", check=False)
        print(f"{name}: identify {'the same points' if eta else 'OTHER POINTS'}; gap {json.loads(gap.stdout).get('verdict') if gap.returncode == 0 else gap.stderr[-100:]}; drift exit {drift.returncode}")
        (out / f"gap-{name}.json").write_text(gap.stdout + gap.stderr)
        (out / f"drift-{name}.json").write_text(drift.stdout + drift.stderr)


main()
