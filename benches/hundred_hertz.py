"""What an hour of a run at 100 Hz with 24 sensors costs, and whether a sample is lost.

    cargo build --release --locked
    target/python-env/bin/python benches/hundred_hertz.py --mapper target/release/mapper

The virtual lab in scaled time, as fast as it goes: the time counted is that of the whole program, simulation, recording and
identification included, as user and system time of the process, which does not depend on what else the machine does.
"""

import argparse
import json
import re
import resource
import subprocess
import tempfile
from pathlib import Path

from mcap.reader import make_reader

from machines import ROOT


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--recording", help="counts the samples of this one instead of running")
    arguments = parser.parse_args()
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    for before, after in [
        ("order: thermal_gradient ", "order: listed "),
        ("method: joint ", "method: dynamic "),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
        ("  virtual_lab: {}\n", "  virtual_lab: {sample_rate: 100 Hz}\n"),
        ("  dwell: 40 s ", "  dwell: 75 s "),
        ("seed: 1 ", "repeats: off\nreturn_to_first: false\nseed: 1 "),
    ]:
        assert before in text, before
        text = text.replace(before, after)
    # 19 channels, of which two have five single sensors besides.
    text = re.sub(r"(  T2: +\{)", r"\1count: 3, ", text)
    text = re.sub(r"(  T1: +\{)", r"\1count: 2, ", text)
    with tempfile.TemporaryDirectory() as scratch:
        folder, recording = Path(scratch), arguments.recording
        if recording is None:
            (folder / "campaign.yaml").write_text(text)
            mapper = str(Path(arguments.mapper).resolve())
            subprocess.run([mapper, "run", str(folder / "campaign.yaml"), "--out", str(folder / "runs")], check=True, capture_output=True)
            recording = next((folder / "runs").glob("*/recording.mcap"))
            used = resource.getrusage(resource.RUSAGE_CHILDREN)
            print(f"{used.ru_utime + used.ru_stime:.1f} s of one core")
        expected, lost, count, last_ns, fields = None, 0, 0, 0, 0
        with open(recording, "rb") as file:
            for _, channel, message in make_reader(file).iter_messages(topics=["/rig/compressor", "/rig/elements"]):
                if channel.topic == "/rig/elements":
                    fields = len(json.loads(message.data))
                    continue
                lost += expected is not None and message.sequence != expected
                expected, count, last_ns = message.sequence + 1, count + 1, message.log_time
        print(f"{count} samples up to {last_ns / 1e9:.2f} s, {lost} gaps in their numbers, {fields} single sensors")


if __name__ == "__main__":
    main()
