"""Writes a made-up production into a history and fits it with statsmodels, sharing no code with the program.

usage: python production.py HISTORY

24 machines in 8 nights, a day apart but one gap; a tenth of the runs is missing. Machines, nights and the rest scatter, the stand
drifts, and one machine (M-07) has 6 % less efficiency at all speeds, another (M-19) loses with 1/speed^2. At each place the mixed
model of the others is fitted by restricted maximum likelihood: a mean, a drift in time, machines and nights crossed. Prints
[{"speed_rpm", "mean", "drift_a_day", "drift_error", "machine_sigma", "night_sigma", "residual_sigma"}, ...].
"""

import json
import sqlite3
import sys
import warnings

import numpy as np
import pandas as pd
import statsmodels.formula.api as smf

DAYS = [0, 1, 2, 3, 6, 7, 8, 9]
SPEEDS_RPM = [50e3, 80e3, 110e3, 140e3]
OUTLIERS = {6: "M-07", 18: "M-19"}


def made():
    rng = np.random.default_rng(20261123)
    machine, night = rng.normal(0, 0.006, 24), rng.normal(0, 0.003, 8)
    rows = []
    for m in range(24):
        for n, day in enumerate(DAYS):
            if rng.random() < 0.1:
                continue
            for k, speed_rpm in enumerate(SPEEDS_RPM):
                eta = 0.70 - 0.01 * k + machine[m] * (1 + 0.2 * k) + night[n] - 0.0008 * day + rng.normal(0, 0.002)
                eta *= 0.94 if m == 6 else 1.0
                eta -= 0.08 * (50e3 / speed_rpm) ** 2 if m == 18 else 0.0
                rows.append((m, n, day, speed_rpm, eta))
    return pd.DataFrame(rows, columns=["machine", "night", "day", "speed_rpm", "eta"])


def store(frame, path):
    with sqlite3.connect(path) as db:
        for n, night in frame.groupby("night"):
            day = int(night["day"].iloc[0])
            cursor = db.execute(
                "INSERT INTO night (name, started_ms, duration_s, program, accepted, moved) VALUES ('made', ?, 1, 'made', 0, 0)",
                [1_790_000_000_000 + 86_400_000 * day],
            )
            for m, run in night.groupby("machine"):
                values = [cursor.lastrowid, f"M-{m + 1:02d}"]
                made = db.execute(
                    "INSERT INTO run (night_id, campaign, machine, method, seed, campaign_sha256, model_sha256) "
                    "VALUES (?, 'made', ?, 'joint', 1, '', '')", values)
                for row in run.itertuples():
                    db.execute("INSERT INTO point (run_id, speed_rpm, valve_opening_ratio, visit, eta) VALUES (?, ?, 1.0, 0, ?)",
                               [made.lastrowid, row.speed_rpm, row.eta])


def fitted(frame):
    frame = frame.assign(all=1, day=frame["day"] - frame["day"].mean())
    crossed = {"machine": "0 + C(machine)", "night": "0 + C(night)"}
    # Scaled: its search ends at an absolute gradient.
    frame["eta"] *= 100
    model = smf.mixedlm("eta ~ day", frame, groups="all", re_formula="0", vc_formula=crossed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = model.fit(reml=True, method=["lbfgs"], gtol=1e-9)
    sigmas = dict(zip(model.exog_vc.names, np.sqrt(fit.vcomp) / 100))
    return {
        "mean": fit.fe_params["Intercept"] / 100,
        "drift_a_day": fit.fe_params["day"] / 100,
        "drift_error": fit.bse_fe["day"] / 100,
        "machine_sigma": sigmas["machine"],
        "night_sigma": sigmas["night"],
        "residual_sigma": float(np.sqrt(fit.scale)) / 100,
    }


frame = made()
store(frame, sys.argv[1])
kept = frame[~frame["machine"].isin(OUTLIERS)]
print(json.dumps([{"speed_rpm": speed, **fitted(at)} for speed, at in kept.groupby("speed_rpm")]))
