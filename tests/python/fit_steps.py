"""Fits efficiency and heat-transfer coefficient to recorded steps with scipy, sharing no code with the program.

usage: python fit_steps.py RECORDING INTERNAL_AREA_M2 ALPHA_A START_S END_S [START_S END_S ...]

For each window (run time, both ends included) the model of Burke et al., eqs. 1-3, is fitted to the measured T2:

    q1  = h alpha_A A (T1 - Tc),         T1' = T1 - q1 / (m cp(T1))
    T2' = T1' (1 + (PR^kappa - 1)/eta),  kappa = R / cp(T1)
    q2  = h (1 - alpha_A) A (T2 - Tc),   T2  = T2' - q2 / (m cp(T2'))

with eta and h constant in the window. Prints [{"eta", "h_w_m2k", "residual_rms_k", "samples"}, ...].
"""

import json
import sys

import numpy as np
from mcap.reader import make_reader
from scipy.optimize import least_squares

R = 287.05
FIELDS = ["flow_kg_s", "inlet_pressure_pa", "inlet_temperature_k", "outlet_pressure_pa", "outlet_temperature_k",
          "housing_temperature_k"]


def cp(temperature_k):
    return 1002.5 + 275e-6 * (temperature_k - 200.0) ** 2


def read(path):
    times, rows = [], []
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        start_ns = next(int(m.metadata["start_time_ns"]) for m in reader.iter_metadata())
        for _, _, message in reader.iter_messages(topics=["/rig/compressor"]):
            data = json.loads(message.data)
            times.append((message.log_time - start_ns) / 1e9)
            rows.append([data[field] for field in FIELDS])
    return np.array(times), np.array(rows, dtype=float)


def fit(rows, area_m2, alpha):
    flow, p1, t1, p2, t2, tc = rows.T
    rise = (p2 / p1) ** (R / cp(t1)) - 1.0

    def residual(parameters):
        eta, h = parameters[0], 1000.0 * parameters[1]
        t1_prime = t1 - h * alpha * area_m2 * (t1 - tc) / (flow * cp(t1))
        t2_prime = t1_prime * (1.0 + rise / eta)
        # Eq. 3 solved for T2, which is on both sides.
        transfer = h * (1.0 - alpha) * area_m2 / (flow * cp(t2_prime))
        return (t2_prime + transfer * tc) / (1.0 + transfer) - t2

    found = least_squares(residual, [0.6, 0.5], x_scale=[0.1, 0.1], ftol=1e-15, xtol=1e-15, gtol=1e-15)
    return {
        "eta": found.x[0],
        "h_w_m2k": 1000.0 * found.x[1],
        "residual_rms_k": float(np.sqrt(np.mean(found.fun ** 2))),
        "samples": len(t2),
    }


def main():
    if len(sys.argv) < 6 or len(sys.argv) % 2:
        sys.exit(__doc__)
    area_m2, alpha, *bounds = (float(argument) for argument in sys.argv[2:])
    times, rows = read(sys.argv[1])
    results = []
    for start_s, end_s in zip(bounds[::2], bounds[1::2]):
        inside = (times >= start_s) & (times <= end_s)
        results.append(fit(rows[inside], area_m2, alpha))
    json.dump(results, sys.stdout)


if __name__ == "__main__":
    main()
