"""Two workers of one core each against one, on the same study: how much of the second is lost to what they share.

    python3 benches/fleet_two.py --mapper target/release/mapper [--items 40] [--times 5]

Each worker is held to a core of its own (taskset); the study is a night of 30 points by two methods. Prints the wall time of both ways, s, their ratio
for each time, median and worst. Nothing else should want the processor meanwhile.
"""

import argparse
import pathlib
import shutil
import statistics
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]


def worker(mapper, directory, core, shard):
    command = ["taskset", "-c", str(core), str(mapper), "fleet", "work", str(directory), "--shard", shard, "--progress", "off"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def timed(mapper, study, directory, workers):
    shutil.rmtree(directory, ignore_errors=True)
    subprocess.run([mapper, "fleet", "make", study, "--out", directory, "--progress", "off"], check=True, stdout=subprocess.DEVNULL)
    begun = time.monotonic()
    running = [worker(mapper, directory, core, f"{core + 1}/{workers}") for core in range(workers)]
    assert [one.wait() for one in running] == [0] * workers
    return time.monotonic() - begun


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--items", type=int, default=40)
    parser.add_argument("--times", type=int, default=5)
    arguments = parser.parse_args()
    mapper = pathlib.Path(arguments.mapper).resolve()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        seeds = ", ".join(str(seed) for seed in range(1, arguments.items // 2 + 1))
        campaign = ROOT / "campaigns/nightly/turbo_a.yaml"
        night = f"nightly: two\nruns:\n  - {{campaign: {campaign}, methods: [joint, dynamic], seeds: [{seeds}]}}\n"
        (folder / "nightly.yaml").write_text(night)
        study = folder / "study.yaml"
        study.write_text("fleet: two\nstudy: nightly\nnightly: nightly.yaml\n")
        ratios = []
        for _ in range(arguments.times):
            one, two = (timed(mapper, study, folder / "fleet", workers) for workers in (1, 2))
            ratios.append(one / two)
            print(f"one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times", flush=True)
        print(f"median {statistics.median(ratios):.2f}, worst {min(ratios):.2f}")


if __name__ == "__main__":
    main()
