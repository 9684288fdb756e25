"""How fast and in how much memory a long log becomes points, compared with polars on the same file.

usage: python benches/log_speed.py MAPPER [HOURS]

Writes 24 channels at 100 Hz for 12 hours as CSV (900 MB) into a temporary folder, proposes a channel map, identifies by `steady`, and
reads the file with polars' `read_csv`. Prints processor time and the largest memory of each. Needs numpy and polars.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import polars as pl

CAMPAIGN = Path(__file__).resolve().parent.parent / "campaigns" / "gap_rig.yaml"
# Name and unit, and what is read at three speeds in turn.
COLUMNS = {
    "N_TC [rpm]": (60e3, 90e3, 120e3),
    "m_dot [kg/s]": (0.05, 0.06, 0.07),
    "p1 [kPa]": (100, 100, 100),
    "p2 [kPa]": (120, 160, 210),
    "T1 [degC]": (25, 25, 25),
    "T2 [degC]": (45, 75, 115),
    "Tc [degC]": (50, 70, 100),
    "m_t [kg/s]": (0.03, 0.03, 0.03),
    "p3 [kPa]": (130, 170, 230),
    "T3 [degC]": (500, 500, 500),
    "p4 [kPa]": (110, 110, 110),
    "T4 [degC]": (450, 450, 450),
}


def write(path, hours):
    """The log; as many further columns as make 24 channels."""
    random = np.random.default_rng(1)
    t_s = np.arange(int(hours * 3600 * 100)) / 100.0
    place = (t_s // 600).astype(int) % 3
    log = {"time [s]": t_s}
    for name, levels in COLUMNS.items():
        noise = 1e-4 * np.mean(levels) * random.standard_normal(len(t_s))
        log[name] = np.round(np.array(levels, dtype=float)[place] + noise, 5)
    for further in range(24 - len(COLUMNS)):
        log[f"x{further} [V]"] = np.round(random.standard_normal(len(t_s)), 4)
    pl.DataFrame(log).write_csv(path)


def measured(*command):
    """Processor time, s, and largest memory, MB, of a command: in a process of its own, whose only child it is."""
    code = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)"
    )
    done = subprocess.run([sys.executable, "-c", code, *command], check=True, capture_output=True, text=True)
    return tuple(map(float, done.stdout.split()))


def main():
    mapper, hours = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 12.0
    with tempfile.TemporaryDirectory() as folder:
        log, channels = Path(folder) / "log.csv", Path(folder) / "channels.yaml"
        write(log, hours)
        print(f"{log.stat().st_size / 1e6:.0f} MB")
        subprocess.run([mapper, "log", "inspect", log, "--write-channels", channels], check=True, stdout=subprocess.DEVNULL)
        given = ["--channels", str(channels), "--campaign", str(CAMPAIGN), "--method", "steady"]
        for name, command in {
            "mapper identify": [mapper, "identify", str(log), *given],
            "polars read_csv": [sys.executable, "-c", f"import polars; polars.read_csv({str(log)!r})"],
        }.items():
            seconds, megabytes = measured(*command)
            print(f"{name}: {seconds:.1f} s of processor time, {megabytes:.0f} MB")


if __name__ == "__main__":
    main()
