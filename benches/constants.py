"""Effect of each judgement on the results when the number is halved and doubled.

    python3 benches/constants.py --copy /tmp/constants RECORDING... [--gap RECORDING...] [--only NAME...] [--write PAGE]

The judgements are those of docs/reference/constants.md. They are compiled in, so each value is a build of its own: of a copy of the sources
in the folder `--copy`, which keeps what it has compiled. RECORDING is a run directory or an MCAP file; `--gap` names those that are diagnosed
with campaigns/gap_rig.yaml. Each row compares the results with those of the shipped numbers: the largest change of an efficiency, of the
half width of its interval, the number of other verdicts, and the number of diagnoses with other causes.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/reference/constants.md"
NUMBER = re.compile(r"(?<![\w.])(\d[\d_]*\.?\d*(?:e-?\d+)?)(?![\w.])")


def judgements():
    """Crate, file, name and value of each."""
    crate = None
    for line in PAGE.read_text().splitlines():
        if heading := re.match(r"## (\w+): \d+$", line):
            crate = heading[1]
        cells = [cell.strip() for cell in line.split(" | ")]
        if len(cells) == 6 and cells[3] == "judgement":
            yield crate, cells[5].strip(" |"), cells[0].strip("| `"), cells[1]


def scaled(value, factor):
    """All numbers of a value but the exponents of terms, which are whole."""

    def times(match):
        whole = "." not in match[1] and "e" not in match[1]
        if whole and "(" in value:
            return match[1]
        number = float(match[1].replace("_", "")) * factor
        return str(max(1, round(number))) if whole else repr(number)

    return NUMBER.sub(times, value)


def patched(text, name, value, factor):
    constant, _, field = name.partition(".")
    start = re.search(rf"\b(?:const|static) {constant}\s*:", text)
    if start is None:
        sys.exit(f"there is no constant {constant}")
    key = f"{field}: " if field else "= "
    plain = re.compile(re.escape(key) + r"\s*".join(re.escape(part) for part in value.split()))
    place = plain.search(text, start.end())
    if place is None:
        sys.exit(f"the value of {name} is not {value}: run `cargo xtask docs`")
    return text[: place.start()] + key + scaled(value, factor) + text[place.end() :]


def build(copy):
    done = subprocess.run(["cargo", "build", "--locked", "--bin", "mapper"], cwd=copy, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return copy / "target/debug/mapper"


def results(mapper, recordings, gaps):
    def run(*arguments):
        done = subprocess.run([mapper, *map(str, arguments), "--json"], capture_output=True, text=True, check=False)
        return json.loads(done.stdout) if done.returncode == 0 else {}

    points = {(str(path), point["step"]): point for path in recordings for point in run("identify", path).get("points", [])}
    causes = {}
    for path in gaps:
        found = run("gap", "diagnose", ROOT / "campaigns/gap_rig.yaml", path)
        first = (found.get("causes") or [{}])[0]
        causes[str(path)] = json.dumps(first.get("effects", first.get("cause")), sort_keys=True)
    return points, causes


def compared(before, after):
    (points, causes), (new_points, new_causes) = before, after
    eta, width, verdicts = 0.0, 0.0, 0
    for key, point in points.items():
        new = new_points.get(key, {})
        verdicts += point.get("verdict") != new.get("verdict")
        if None not in (point.get("eta"), new.get("eta")):
            eta = max(eta, abs(new["eta"] - point["eta"]))
        if None not in (point.get("eta_low"), new.get("eta_low")):
            width = max(width, abs((new["eta_high"] - new["eta_low"]) / (point["eta_high"] - point["eta_low"]) - 1.0))
    others = sum(new_causes.get(path) != cause for path, cause in causes.items())
    return f"{100 * eta:.2f} | {100 * width:.0f} | {verdicts} | {others}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--gap", nargs="*", type=Path, default=[])
    parser.add_argument("--copy", type=Path, required=True)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--write", type=Path, help="write the table to this file")
    args = parser.parse_args()
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    for name in tracked:
        source, target = ROOT / name, args.copy / name
        if source.is_file() and not (target.is_file() and target.read_bytes() == source.read_bytes()):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    before = results(build(args.copy), args.recordings, args.gap)
    lines = [
        "| number | halved: efficiency, points | interval, % | verdicts | causes | doubled: efficiency, points | interval, % | verdicts | causes |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for crate, file, name, value in judgements():
        if args.only and name not in args.only:
            continue
        path = args.copy / "crates" / crate / "src" / file
        text, cells = path.read_text(), []
        for factor in (0.5, 2.0):
            path.write_text(patched(text, name, value, factor))
            cells.append(compared(before, results(build(args.copy), args.recordings, args.gap)))
        path.write_text(text)
        lines.append(f"| `{name}` ({crate}) | " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    if args.write:
        args.write.write_text("\n".join(lines) + "\n")


main()
