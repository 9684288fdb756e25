"""Every shipped campaign, run on the virtual lab without any effect and diagnosed with its own file: what is found, where nothing is wrong.

usage: python3 benches/shipped.py PROGRAM SEEDS [CAMPAIGN...] [--write FILE]

PROGRAM is the built `mapper`; seeds are 1 to SEEDS; campaigns are the names of files in campaigns/, all that run in a step plan without one.
Prints a line a run on standard error and a table as Markdown, or writes it. Needs nothing but Python; a run takes 20 to 60 s of one core.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
SHIPPED = ["gap_rig", "grid18", "turbo_a", "turbo_a_adiabatic", "turbo_a_conventional", "turbo_a_lines", "turbo_a_redundant", "turbo_a_surge", "turbo_paper"]


def diagnosed(program, name, seed):
    """Verdict of the diagnosis, number of faults that identification names, points that are good."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        text = re.sub(r"^seed: \d+", f"seed: {seed}", (REPOSITORY / "campaigns" / f"{name}.yaml").read_text(), flags=re.MULTILINE)
        file = folder / f"{name}.yaml"
        file.write_text(text)
        for script in (REPOSITORY / "campaigns").glob("*.rhai"):
            (folder / script.name).write_text(script.read_text())
        run = subprocess.run([program, "run", file, "--out", folder / "runs", "--json"], capture_output=True, text=True)
        if not run.stdout:
            return {"verdict": f"no run: {run.stderr.strip()[-100:]}"}
        recording = json.loads(run.stdout)["recording"]
        gap = subprocess.run([program, "gap", "diagnose", file, recording, "--json"], capture_output=True, text=True)
        if gap.returncode:
            return {"verdict": f"exit {gap.returncode}: {gap.stderr.strip()[-100:]}"}
        diagnosis = json.loads(gap.stdout)
        first = diagnosis["candidates"][0]["effects"] if diagnosis["candidates"] else []
        return {"verdict": diagnosis["verdict"], "first": " + ".join(first), "outside": diagnosis["probability_outside"]}


def main(arguments):
    target = None
    if "--write" in arguments:
        at = arguments.index("--write")
        target = pathlib.Path(arguments[at + 1])
        del arguments[at : at + 2]
    program, seeds, names = arguments[0], int(arguments[1]), arguments[2:] or SHIPPED
    lines = ["| campaign | runs | within tolerance | otherwise |", "|---|---|---|---|"]
    for name in names:
        with ThreadPoolExecutor(2) as pool:
            found = list(pool.map(lambda seed: diagnosed(program, name, seed), range(1, seeds + 1)))
        otherwise = []
        for seed, result in zip(range(1, seeds + 1), found):
            print(name, seed, result, file=sys.stderr, flush=True)
            if result["verdict"] != "within_tolerance":
                words = result["verdict"].replace("_", " ")
                if result.get("first") and result["verdict"] != "unexplained":
                    words += f" ({result['first']})"
                otherwise.append(f"seed {seed}: {words}")
        lines.append(f"| {name} | {seeds} | {seeds - len(otherwise)} | {'; '.join(otherwise)} |")
    text = "\n".join(lines) + "\n"
    if target is None:
        print(text, end="")
    else:
        target.write_text(f"# Shipped campaigns, nothing wrong\n\n`python3 benches/shipped.py target/release/mapper {seeds}`\n\n{text}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1:])
