"""The joint fit of mapper-identify compared with scipy.optimize.least_squares on the same samples.

    python3 -m venv target/peers-venv && target/peers-venv/bin/pip install scipy numpy
    OMP_NUM_THREADS=1 target/peers-venv/bin/python benches/peers/joint_scipy.py

30 points at 10 Hz with the noise of a rig, alpha_A 0.2 and a probe of 1.5 mm that neither knows. Like for like is ONE
fit: the same rows (block means, smoothed), model, weights, priors, parameters and start, from ready rows to the minimum;
scipy, vectorised over all rows, with its own differences and with differences grouped by the arrow's shape (a step's
parameters touch no other step). In addition mapper's whole identification: rows, fits that learn their weights, the
correction for noise in the inputs, the weighing of the refinements, covariance, the smoothness of the map, the doubts.
"""

import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

AREA_M2, PIPE_M, CP_FROM_K = 29e-3, 35e-3, 200.0
NOISE = {"t1_k": 0.1, "t2_k": 0.1, "tc_k": 0.15, "p1_pa": 20.0, "p2_pa": 60.0, "flow_kg_s": 1.5e-4}
SHARE, TAU_S = 0.36, 2.0
TERMS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (1, 2), (2, 1), (3, 0), (0, 3), (2, 2)]
TERM_SIGMAS = np.array([1.0, 0.3, 0.3, 0.2, 0.2, 0.2, 0.1, 0.1, 0.1, 0.05, 0.05])
LN_A, EXPONENT, ALPHA, PROBE, DIRECTION, SURFACE = 0, 1, 2, 3, 4, 5
SHARED = SURFACE + len(TERMS)
ETA, DEVIATION, FIRST, SLOPE = range(4)


def cp(t_k):
    return 1002.5 + 275e-6 * (t_k - CP_FROM_K) ** 2


def viscosity(t_k):
    return 1.458e-6 * t_k * np.sqrt(t_k) / (t_k + 110.4)


def conductivity(t_k):
    return 0.02624 * (t_k / 300.0) ** 0.8646


def reynolds(flow, t_k):
    return 4.0 * flow / (np.pi * PIPE_M * viscosity(t_k))


def rows_of(step):
    """Block means from 1.5 s after the jump: 0.5 s, 1 s after 20 s; smoothed by local cubics as mapper does."""
    step = step[step[:, 0] >= 1.5 - 1e-9]
    t = step[:, 0]
    rows, white, first_order, start = [], [], [], 0
    while start < len(t):
        block = 1.0 if t[start] - t[0] >= 20.0 else 0.5
        end = int(np.searchsorted(t, t[start] + block - 5e-10))
        rows.append(step[start:end].mean(axis=0))
        n = end - start
        x = (t[end - 1] - t[start]) * n / max(n - 1, 1) / TAU_S if n > 1 else 0.0
        if n < 2:
            white.append(1.0 - SHARE)
            first_order.append(SHARE)
        else:
            part = SHARE * (2.0 * np.cosh(x) - 2.0) / x**2
            own = SHARE * 2.0 * (x - 1.0 + np.exp(-x)) / x**2
            w = (1.0 - SHARE) / n
            white.append(max(w + own - part, 0.02 * (w + own)))
            first_order.append(part)
        start = end
    rows = np.array(rows)
    t = rows[:, 0]
    smooth = rows.copy()
    for i in range(len(t)):
        half = min(3.0 + 0.5 * (t[i] - t[0]), 10.0)
        near = np.flatnonzero((t >= t[i] - half) & (t <= t[i] + half))
        if len(near) >= 6:
            powers = ((t[near] - t[i]) / 10.0)[:, None] ** np.arange(4)
            weights = np.linalg.solve(powers.T @ powers, np.eye(4)[0]) @ powers.T
            for column in (1, 2, 3, 4, 5, 7):
                smooth[i, column] = weights @ rows[near, column]
    return smooth, np.array(white), np.array(first_order)


def load(path):
    data = np.loadtxt(path, delimiter=",", skiprows=1)
    return [data[data[:, 0] == index, 1:] for index in np.unique(data[:, 0])]


class Fit:
    """Columns of the rows: t, speed, flow, P1, T1, P2, T2, Tc; arrays are row by step."""

    def __init__(self, steps):
        made = [rows_of(step) for step in steps]
        n = min(len(rows) for rows, _, _ in made)
        self.rows = np.stack([rows[:n] for rows, _, _ in made], axis=1)
        self.count = len(steps)
        ends = np.stack([step[step[:, 0] >= step[-1, 0] - 10.0].mean(axis=0) for step in steps])
        speed = lambda x: x[..., 1] * np.sqrt(298.0 / x[..., 4])
        flow = lambda x: x[..., 2] * np.sqrt(x[..., 4] / 298.0) * 100e3 / x[..., 3]
        n_end, m_end = speed(ends), flow(ends)
        middle = lambda x: (0.5 * (x.min() + x.max()), 0.5 * (x.max() - x.min()))
        (n_mid, n_half) = middle(n_end)
        power = np.polyfit(np.log(n_end), np.log(m_end), 1)[0]
        reduced = lambda n, m: m / (n / n_mid) ** power
        (v_mid, v_half) = middle(reduced(n_end, m_end))

        def terms(x):
            u = (speed(x) - n_mid) / n_half
            v = (reduced(speed(x), flow(x)) - v_mid) / v_half
            return np.stack([u**i * v**j for i, j in TERMS], axis=-1)

        self.end_terms = terms(ends)
        self.terms = terms(self.rows) - self.end_terms
        self.re_reference = np.exp(np.log(reynolds(ends[:, 2], ends[:, 6])).mean())
        self.start = np.zeros(SHARED + 4 * self.count)
        self.start[LN_A] = np.log(0.004) + 1.13 * np.log(self.re_reference)
        self.start[[EXPONENT, PROBE, SURFACE]] = 1.13, 0.5, 0.65
        local = self.start[SHARED:].reshape(self.count, 4)
        local[:, ETA], local[:, FIRST], local[:, SLOPE] = 0.65, self.rows[0, :, 6], 1.0
        self.prior_mean = self.start.copy()
        self.prior_mean[[PROBE, EXPONENT, SURFACE]] = 0.0, 0.9, 0.65
        self.prior_sigma = np.concatenate(
            [[3.0, 0.5, 0.3, 10.0, 0.5], TERM_SIGMAS, np.tile([np.inf, 0.01, 5.0, 0.05], self.count)]
        )
        # Noise of all inputs at each step's end, as it moves the prediction.
        at_end = lambda x: self.gas(x[None], np.zeros((1, self.count, len(TERMS))), self.start, local)[0]
        square = NOISE["t2_k"] ** 2
        for column, name in ((2, "flow_kg_s"), (3, "p1_pa"), (4, "t1_k"), (5, "p2_pa"), (7, "tc_k")):
            moved = ends.copy()
            moved[:, column] += NOISE[name]
            square = square + (at_end(moved) - at_end(ends)) ** 2
        sigma = np.sqrt(square)
        self.gains = self.kalman(made[0][1][:n], made[0][2][:n], sigma)

    def kalman(self, white, first_order, sigma):
        gains, spread, last = [], np.zeros(self.count), -np.inf
        ratio = (NOISE["t2_k"] / sigma) ** 2
        for i, t in enumerate(self.rows[:, 0, 0]):
            memory = np.exp((last - t) / TAU_S)
            spread = memory**2 * spread + (1.0 - memory**2) * first_order[i]
            innovation = spread + white[i] * ratio
            gain = spread / innovation
            spread = spread * (1.0 - gain)
            last = t
            gains.append((memory, gain, 1.0 / (sigma * np.sqrt(innovation))))
        return gains

    def gas(self, x, terms, shared, local):
        """T2 of the gas by eqs. 1-3."""
        flow, p1, t1, p2, tc = (x[..., column] for column in (2, 3, 4, 5, 7))
        eta = np.maximum(local[:, ETA] + local[:, SLOPE] * (terms @ shared[SURFACE:SHARED]), 0.02)
        rise = (p2 / p1) ** (287.05 / cp(t1)) - 1.0
        bulk = t1 * (1.0 + rise / eta)
        mu, k = viscosity(bulk), conductivity(bulk)
        ln_nusselt = (
            shared[LN_A]
            + local[:, DEVIATION]
            + shared[EXPONENT] * np.log(reynolds(flow, bulk) / self.re_reference)
            + np.log(cp(bulk) * mu / k) / 3.0
            + 0.14 * np.log(mu / viscosity(tc))
        )
        h = np.exp(ln_nusselt) * k / PIPE_M
        outward = np.exp(shared[DIRECTION])
        before = h * AREA_M2 * shared[ALPHA] * np.where(tc > t1, outward, 1.0)
        t1_prime = t1 - before * (t1 - tc) / (flow * cp(t1))
        t2_prime = t1_prime * (1.0 + rise / eta)
        after = h * AREA_M2 * (1.0 - shared[ALPHA]) * np.where(tc > t2_prime, outward, 1.0)
        units = after / (flow * cp(bulk))
        return (t2_prime + units * tc) / (1.0 + units)

    def probe(self, gas, square, first):
        diameter = 1e-3 * np.sqrt(max(square, 0.0))
        flow, t = self.rows[..., 2], self.rows[..., 0]
        mu, k = viscosity(gas), conductivity(gas)
        re = 4.0 * flow * diameter / (np.pi * PIPE_M**2 * mu)
        nusselt = 2.0 + (0.4 * np.sqrt(re) + 0.06 * np.cbrt(re) ** 2) * (cp(gas) * mu / k) ** 0.4
        tau = np.maximum(8600.0 * 480.0 * diameter**2 / (6.0 * nusselt * k), 1e-9)
        x = np.diff(t, axis=0) / (0.5 * (tau[1:] + tau[:-1]))
        kept = np.exp(-x)
        mean = -np.expm1(-x) / x
        fed = (mean - kept) * gas[:-1] + (1.0 - mean) * gas[1:]
        readings = np.empty_like(gas)
        readings[0] = reading = first
        for i in range(len(x)):
            reading = kept[i] * reading + fed[i]
            readings[i + 1] = reading
        return readings

    def residual(self, parameters):
        shared, local = parameters[:SHARED], parameters[SHARED:].reshape(self.count, 4)
        gas = self.gas(self.rows, self.terms, shared, local)
        off = self.rows[..., 6] - self.probe(gas, shared[PROBE], local[:, FIRST])
        state = np.zeros(self.count)
        white = np.empty_like(off)
        for i, (memory, gain, scale) in enumerate(self.gains):
            state = state * memory
            innovation = off[i] - state
            state = state + gain * innovation
            white[i] = innovation * scale
        surface = (local[:, ETA] - self.end_terms @ shared[SURFACE:SHARED]) / 0.005
        priors = (parameters - self.prior_mean) / self.prior_sigma
        return np.concatenate([white.ravel(), surface, priors])

    def jacobian(self, parameters):
        base = self.residual(parameters)
        jacobian = np.zeros((len(base), len(parameters)))
        for index in range(SHARED):
            step = 1e-6 * max(abs(parameters[index]), 0.1)
            moved = parameters.copy()
            moved[index] += step
            jacobian[:, index] = (self.residual(moved) - base) / step
        n = self.rows.shape[0]
        for own in range(4):
            columns = SHARED + own + 4 * np.arange(self.count)
            step = 1e-6 * np.maximum(np.abs(parameters[columns]), 0.1)
            moved = parameters.copy()
            moved[columns] += step
            change = self.residual(moved) - base
            by_row = change[: n * self.count].reshape(n, self.count) / step
            each = np.arange(self.count)
            whitened = np.zeros((n, self.count, self.count))
            whitened[:, each, each] = by_row
            jacobian[: n * self.count, columns] = whitened.reshape(n * self.count, self.count)
            jacobian[n * self.count + each, columns] = change[n * self.count + each] / step
            rows = n * self.count + self.count + columns
            jacobian[rows, columns] = 1.0 / self.prior_sigma[columns]
        return jacobian


def main():
    directory = Path(tempfile.mkdtemp())
    command = ["cargo", "run", "--release", "--quiet", "-p", "mapper-identify", "--example", "joint_timing", "--"]
    if len(sys.argv) > 1:
        command = [sys.argv[1]]
    subprocess.run(command + ["5", str(directory)], check=True)
    found = next(csv.DictReader(open(directory / "found.csv")))
    points = np.loadtxt(directory / "points.csv", delimiter=",", skiprows=1)
    fit = Fit(load(directory / "samples.csv"))
    lowest = np.full(len(fit.start), -np.inf)
    lowest[PROBE] = 0.0
    rms = lambda x: 100.0 * np.sqrt(np.mean(np.square(x)))
    ours = float(found["fastest_s"])
    print("| | s | over mapper's one fit | alpha_A | probe, mm | eta off the truth, points rms | off mapper's fit |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    fit_s = float(found["fit_s"])
    print(
        f"| mapper, one fit | {fit_s:.3f} | 1 | {float(found['fit_alpha_area_ratio']):.4f} |"
        f" {1e3 * float(found['fit_probe_diameter_m']):.3f} | {rms(points[:, 2] - points[:, 1]):.2f} | |"
    )
    print(
        f"| mapper, all of the identification | {ours:.3f} | {ours / fit_s:.1f} | {float(found['alpha_area_ratio']):.4f} |"
        f" {1e3 * float(found['probe_diameter_m']):.3f} | {rms(points[:, 0] - points[:, 1]):.2f} | |"
    )
    for name, jacobian, rounds in (
        ("scipy, one fit, derivatives grouped by hand", fit.jacobian, 5),
        ("scipy, one fit, its own `2-point` derivatives", "2-point", 2),
    ):
        times, result = [], None
        for _ in range(rounds):
            started = time.perf_counter()
            result = least_squares(fit.residual, fit.start, jacobian, bounds=(lowest, np.inf), x_scale="jac")
            times.append(time.perf_counter() - started)
        eta = result.x[SHARED:].reshape(-1, 4)[:, ETA]
        print(
            f"| {name} | {min(times):.2f} | {min(times) / fit_s:.1f} | {result.x[ALPHA]:.4f} |"
            f" {np.sqrt(result.x[PROBE]):.3f} | {rms(eta - points[:, 1]):.2f} | {rms(eta - points[:, 2]):.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
