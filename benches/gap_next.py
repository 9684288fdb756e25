#!/usr/bin/env python3
"""How often `what next` of a gap diagnosis keeps what it says.

    python3 benches/gap_next.py target/release/mapper DIR [--cases 60] [--seed 1] [--sizes 0.7 1.2] [--effects oil_scale,ventilation] [--jobs 2] [--minutes 60]

Each case is a rig with one effect of the catalogue, about as large as what is just seen, that has run three steps. If the diagnosis
leaves causes open and states what the stand can do, the best experiment of each kind is run: the same rig does the same three steps and then
the lines that the diagnosis gives, or begins with a soak. Afterwards the true cause has 95 % of what was open, or it has not; the
forecast gave the probability. An offset that the soak determines is subtracted before anything is diagnosed: then it is reported, and
the remaining share of the others shows whether it has been settled. A table of both is printed, and every experiment is a line of
DIR/experiments.jsonl.
"""
import argparse, concurrent.futures, json, pathlib, random, re, subprocess, time

ROOT = pathlib.Path(__file__).resolve().parent.parent
SPEEDS, OPENINGS = "[90 krpm, 130 krpm, 70 krpm]", "[0.7]"
SETTLED = 0.95
AT_REST = {"t1_offset": "t1", "t2_offset": "t2", "tc_offset": "tc"}


def campaign(effect, seed):
    text = (ROOT / "campaigns/gap_rig.yaml").read_text()
    text = re.sub(r"speeds: .*", f"speeds: {SPEEDS}", text)
    text = re.sub(r"openings: .*", f"openings: {OPENINGS}", text)
    text = re.sub(r"^seed: .*", f"seed: {seed}", text, flags=re.M)
    if effect:
        line = f"    effects: {{{effect}}}"
        text = text.replace("    tolerances: drawn", "    tolerances: drawn\n" + line)
    return text


def diagnosed(mapper, folder, text):
    """Runs a campaign and diagnoses it."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "campaign.yaml"
    file.write_text(text)
    for old in folder.glob("gap_rig-*"):
        subprocess.run(["rm", "-rf", str(old)], check=True)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([mapper, "run", str(file), "--out", str(folder)], **quiet)
    run = next(folder.glob("gap_rig-*"), None)
    if run is None:
        return None
    answer = subprocess.run([mapper, "gap", "diagnose", str(file), "--recording", str(run / "recording.mcap"), "--json"],
                            capture_output=True, text=True)
    return json.loads(answer.stdout) if answer.returncode == 0 else None


def effects(mapper, folder):
    """Each effect with one parameter: what is just seen of it."""
    seen = diagnosed(mapper, folder, campaign(None, 1))["smallest_seen"]
    listed = subprocess.run([mapper, "gap", "effects", "--json"], capture_output=True, text=True)
    listed = json.loads(listed.stdout)
    listed = {e["id"]: e["parameters"] for e in (listed["effects"] if isinstance(listed, dict) else listed)}
    return [(s["effect"], p[0], s["value"]) for s in seen
            if s["value"] is not None and len(p := listed[s["effect"]]) == 1]


def case(mapper, folder, number, seed, sizes, candidates):
    draw = random.Random(seed * 100003 + number)
    name, parameter, seen = draw.choice(candidates)
    value = parameter["neutral"] + draw.uniform(*sizes) * (seen - parameter["neutral"])
    unit = parameter["unit"]
    written = f"{value:.6g}" if unit in ("1", "-", "") else f"{value:.6g} {unit}"
    folder = folder / f"case_{number:03}"
    own = campaign(f"{name}: {written}", number + 1000 * seed)
    first = diagnosed(mapper, folder / "first", own)
    if first is None:
        return {"case": number, "effect": name, "outcome": "refused"}, []
    if not first.get("experiments"):
        return {"case": number, "effect": name, "outcome": "nothing open" if first["verdict"] == "explained" else first["verdict"]}, []
    is_open = [c["effects"] for c in first["candidates"][:4]]
    if [name] not in is_open:
        return {"case": number, "effect": name, "outcome": "truth not among the open"}, []
    rows, kinds = [], set()
    for suggestion in first["experiments"]:
        kind = suggestion["kind"]
        if kind in kinds or kind == "sensor":
            continue
        kinds.add(kind)
        place = folder / kind
        place.mkdir(parents=True, exist_ok=True)
        if kind == "soak":
            text = own + "\n".join(suggestion["script"]) + "\n"
        else:
            (place / "next.rhai").write_text("for p in grid() { jump(p); }\n" + "\n".join(suggestion["script"]) + "\n")
            text = re.sub(r"^order: .*", "sequence: next.rhai", own, flags=re.M)
            text = re.sub(r"^(repeats|return_to_first): .*\n", "", text, flags=re.M)
        then = diagnosed(mapper, place, text)
        if then is None:
            rows.append({"case": number, "effect": name, "kind": kind, "refused": True})
            continue
        after = {tuple(c["effects"]): c["probability"] for c in then["candidates"]}
        total = sum(after.get(tuple(c), 0.0) for c in is_open)
        if first["verdict"] == "within_tolerance":
            total += then["probability_none"]
        share = after.get((name,), 0.0) / total if total > 0 else 0.0
        if kind == "soak" and name in AT_REST:
            total = sum(after.get(tuple(c), 0.0) for c in is_open)
            reported = any(w.startswith(f"{AT_REST[name].capitalize()} reads") for w in then["offsets_at_rest"])
            share = 1.0 - total if reported else 0.0
        rows.append({"case": number, "effect": name, "kind": kind, "forecast": suggestion["probability_settled"],
                     "bit": suggestion["entropy_drop_bit"], "share": share, "settled": share >= SETTLED,
                     "outside": then["probability_outside"], "outside_before": first["probability_outside"]})
    return {"case": number, "effect": name, "outcome": "open"}, rows


def table(rows):
    lines = ["| forecast | experiments | mean forecast | true cause has 95 % |", "|---|---|---|---|"]
    for low, high in [(0, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)]:
        these = [r for r in rows if low <= r["forecast"] < high]
        if these:
            mean = sum(r["forecast"] for r in these) / len(these)
            lines.append(f"| {100 * low:.0f} .. {min(100 * high, 100):.0f} % | {len(these)} | {100 * mean:.0f} % | "
                         f"{sum(r['settled'] for r in these)} ({100 * sum(r['settled'] for r in these) / len(these):.0f} %) |")
    for kind in sorted({r["kind"] for r in rows}):
        these = [r for r in rows if r["kind"] == kind]
        lines.append(f"| all of kind {kind} | {len(these)} | {100 * sum(r['forecast'] for r in these) / len(these):.0f} % | "
                     f"{sum(r['settled'] for r in these)} ({100 * sum(r['settled'] for r in these) / len(these):.0f} %) |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mapper")
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sizes", type=float, nargs=2, default=(0.7, 1.2), help="least and most, of what is just seen")
    parser.add_argument("--effects", help="draw from these alone")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=60.0, help="no case is begun after")
    given = parser.parse_args()
    mapper, start = str(pathlib.Path(given.mapper).resolve()), time.monotonic()
    folder = given.directory.resolve()
    candidates = effects(mapper, folder / "nothing")
    if given.effects:
        candidates = [c for c in candidates if c[0] in given.effects.split(",")]
    cases, rows = [], []

    def one(number):
        if time.monotonic() - start > 60 * given.minutes:
            return None
        return case(mapper, folder, number, given.seed, given.sizes, candidates)

    with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool, open(folder / "experiments.jsonl", "w") as out:
        for answer in pool.map(one, range(given.cases)):
            if answer is None:
                continue
            cases.append(answer[0])
            rows.extend(r for r in answer[1] if "forecast" in r)
            out.write("".join(json.dumps(r) + "\n" for r in [answer[0], *answer[1]]))
            out.flush()
    outcomes = [c["outcome"] for c in cases]
    print(", ".join(f"{outcomes.count(o)} {o}" for o in sorted(set(outcomes))), f"of {len(cases)} cases\n")
    print(table(rows))


if __name__ == "__main__":
    main()
