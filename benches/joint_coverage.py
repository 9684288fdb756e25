"""How far `joint` and `dynamic` are off on rig-like recordings, and how often their intervals hold.

    cargo build --release -p mapper-cli
    target/release/mapper gap blind make --out cases --seed 1 --cases 40
    python3 benches/joint_coverage.py cases --mapper target/release/mapper

The directory holds what `mapper gap blind make` writes (`answers.json`, native recordings), or NAME.mcap next to
NAME.truth.json with a channel map: `--channels examples/channels/gap_rig.yaml`. For each recording and for all together:
root mean square of the efficiency's error (points) of both methods, of the part that no common temperature offset
explains, share of the points whose 95 % intervals of eta and h hold the truth, and verdicts. Recordings are classified
by what was put into the rig: nothing that touches eqs. 1-3 or a reading that enters them; something that `joint` looks
for; something that it does not know.
"""

import argparse
import concurrent.futures
import json
import math
import subprocess
from pathlib import Path

# Neither eqs. 1-3 nor T1, T2, Tc, P1, P2, m_c are touched, or only the size of h or eta.
UNTOUCHED = {
    "oil_scale", "ventilation", "turbine_radiation", "bearing_friction", "turbine_efficiency", "efficiency_scale",
    "flow_map_scale", "valve_area", "actuator_lag", "htc_scale", "X_mount_conduction", "X_coolant_passage",
    "X_coulomb_friction", "X_flow_dependent_htc", "X_speed_gain",
}
SOUGHT = {"area_split", "tip_diameter", "directional_htc"}


def kind(effects):
    touching = set(effects) - UNTOUCHED
    if not touching:
        return "untouched"
    return "sought" if touching <= SOUGHT else "unknown"


def cases(directory):
    """Name, recording, effects and true points of each."""
    answers = directory / "answers.json"
    if answers.exists():
        truths = json.loads(answers.read_text())
    else:
        truths = [json.loads(path.read_text()) for path in sorted(directory.glob("*.truth.json"))]
    return [(t["name"], directory / f"{t['name']}.mcap", t["effects"], t["points"]) for t in truths]


def identified(mapper, recording, method, arguments):
    command = [str(mapper), "identify", str(recording), "--method", method, "--json", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


class Errors:
    """Errors of one method at the points of one recording, or of many."""

    def __init__(self):
        self.eta, self.sigma, self.h, self.held_eta, self.held_h, self.good = [], [], [], [], [], []
        self.absent = 0

    def add(self, points, truths):
        # A recording without markers has its hold before the first point as part of it.
        for point, truth in zip(points[-len(truths):], truths):
            if point["eta"] is None:
                self.absent += 1
                continue
            self.eta.append(100.0 * (point["eta"] - truth["eta"]))
            self.sigma.append(100.0 * (point["eta_high"] - point["eta_low"]) / 3.92)
            self.held_eta.append(point["eta_low"] <= truth["eta"] <= point["eta_high"])
            self.good.append(point["verdict"] == "good")
            if point["h_w_m2k"] is not None:
                self.h.append(100.0 * (point["h_w_m2k"] / truth["h"] - 1.0))
                self.held_h.append(point["h_low_w_m2k"] <= truth["h"] <= point["h_high_w_m2k"])

    def join(self, other):
        for name, values in vars(other).items():
            mine = getattr(self, name)
            setattr(self, name, mine + values)


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def share(flags):
    return f"{sum(flags)}/{len(flags)}"


def line(name, dynamic, joint, good_held, note):
    print(
        f"| {name} | {rms(dynamic.eta):.2f} | {rms(joint.eta):.2f} | {rms(joint.sigma):.2f} | {share(dynamic.held_eta)} |"
        f" {share(joint.held_eta)} | {rms(dynamic.h):.1f} | {rms(joint.h):.1f} | {share(joint.held_h)} |"
        f" {share(joint.good)} | {good_held} | {note} |"
    )


def shown(value):
    """A shared number with its standard error."""
    if value["origin"] == "assumed":
        return "-"
    number = "?" if value["value"] is None else f"{value['value']:.4g}"
    sigma = math.hypot(value["uncertainty"]["noise_standard_error"], value["uncertainty"]["bias_standard_error"])
    return f"{number}({sigma:.2g})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--mapper", type=Path, default=Path("target/release/mapper"))
    parser.add_argument("--channels", help="channel map of recordings made by others")
    parser.add_argument("--campaign", default="campaigns/gap_rig.yaml")
    parser.add_argument("--only", default="", help="only recordings with this in their name or effects")
    parser.add_argument("--points", action="store_true", help="also each point's error")
    parser.add_argument("--shared", action="store_true", help="also what the points share")
    options = parser.parse_args()
    arguments = ["--campaign", options.campaign]
    arguments += ["--channels", options.channels] if options.channels else []
    wanted = [c for c in cases(options.directory) if options.only in c[0] + " ".join(c[2])]

    def one(case):
        return tuple(identified(options.mapper, case[1], method, arguments) for method in ("dynamic", "joint"))

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        found = list(pool.map(one, wanted))
    print("| recording | eta dynamic | eta joint | stated | dynamic holds | joint holds | h dynamic, % | h joint, % | h holds | good | of these hold | |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|")
    pooled, worse = {}, {}
    for which in ("untouched", "sought", "unknown"):
        for (name, _, effects, truths), (plain, together) in zip(wanted, found):
            if kind(effects) != which:
                continue
            dynamic, joint = Errors(), Errors()
            dynamic.add(plain["points"], truths)
            joint.add(together["points"], truths)
            for key in (which, "all"):
                pair = pooled.setdefault(key, (Errors(), Errors()))
                pair[0].join(dynamic)
                pair[1].join(joint)
                worse.setdefault(key, []).append(rms(joint.eta) > rms(dynamic.eta))
            causes = ", ".join(f"{k} {v if not isinstance(v, str) else v.split('= ')[-1]}" for k, v in effects.items())
            held = share([h for h, g in zip(joint.held_eta, joint.good) if g])
            line(name, dynamic, joint, held, causes or "none")
            if options.points:
                print("   eta joint  ", " ".join(f"{e:+.2f}" for e in joint.eta))
                print("   eta stated ", " ".join(f"{e:.2f}" for e in joint.sigma))
                print("   eta dynamic", " ".join(f"{e:+.2f}" for e in dynamic.eta))
                print("   h joint %  ", " ".join(f"{e:+.1f}" for e in joint.h))
            if options.shared and together["thermal"]:
                thermal = together["thermal"]
                law = thermal["convection"]
                print(
                    "   alpha", shown(thermal["alpha_area_ratio"]), "probe", shown(thermal["probe_diameter_m"]),
                    "direction", shown(thermal["direction_factor"]), "exponent", shown(law["exponent"]) if law else "-",
                    "scatter", f"{law['deviation_ratio']:.4f}" if law else "-", thermal["doubts"],
                )
    for which, (dynamic, joint) in pooled.items():
        held = share([h for h, g in zip(joint.held_eta, joint.good) if g])
        line(f"**{which}**", dynamic, joint, held, f"joint is worse in {share(worse[which])}")


if __name__ == "__main__":
    main()
