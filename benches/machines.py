"""What the benches share: machines made from the shipped campaign, and statistics of points."""

import math
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# How even the shipped campaign declares its soak to leave the machine.
SHIPPED = "nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa"


def closed_form(n_krpm, pressure_ratio, low_speed_loss, steepness):
    """Flow, kg/s, and efficiency of turbo_a's closed form (SAE), with the changes asked for."""
    n = n_krpm / 100.0
    tip = math.pi * 0.052 * n_krpm * 1e3 / 60.0
    zero_slope = (1.0 + 1.06 * tip * tip / (2.0 * 1005.0 * 298.0)) ** 3.5
    choke = 1.0 + 0.15 * (zero_slope - 1.0)
    m_zs, m_ch = 0.0265 * n**1.35, 0.052 + 0.058 * n**1.25
    x = (pressure_ratio - choke) / (zero_slope - choke)
    flow = m_zs + (m_ch - m_zs) * math.sqrt(max(0.0, 1.0 - max(x, 0.0) ** 2.2))
    peak = 0.74 - 0.07 * (n - 1.05) ** 2 - 0.10 * max(0.0, n - 1.2) ** 2
    # Nothing at 150 krpm, all of it at 50 krpm.
    peak -= low_speed_loss * (n**-2 - 1.5**-2) / (0.5**-2 - 1.5**-2)
    away = (flow - (m_zs + 0.42 * (m_ch - m_zs))) / (m_ch - m_zs)
    beyond = steepness * max(0.0, away - 0.3) ** 2
    return flow, max(0.2, peak * (1.0 - 0.9 * away * away - beyond)), zero_slope, choke


def write_table(path, low_speed_loss, steepness):
    rows = ["speed_corrected_rpm,flow_corrected_kg_s,pressure_ratio,eta"]
    for n_krpm in range(30, 196, 5):
        *_, zero_slope, choke = closed_form(n_krpm, 1.0, low_speed_loss, steepness)
        for k in range(17):
            # Close together near surge, where flow changes fastest.
            pressure_ratio = choke + (zero_slope - choke) * math.sin(0.5 * math.pi * k / 16)
            flow, eta, *_ = closed_form(n_krpm, pressure_ratio, low_speed_loss, steepness)
            rows.append(f"{n_krpm * 1000},{flow:.8f},{pressure_ratio:.8f},{eta:.8f}")
    path.write_text("\n".join(rows) + "\n")


def replaced(text, old, new):
    if old not in text:
        raise SystemExit(f"the campaign does not hold {old!r} any more; correct benches/machines.py")
    return text.replace(old, new, 1)


def error_of(point):
    truth = point.get("truth")
    return None if point["eta"] is None or not truth else 100.0 * (point["eta"] - truth["eta"])


def half(point):
    return 50.0 * (point["eta_high"] - point["eta_low"])


def held(point, name):
    low, high = {"eta": ("eta_low", "eta_high"), "h_w_m2k": ("h_low_w_m2k", "h_high_w_m2k")}[name]
    if point.get(low) is None or not point.get("truth"):
        return None
    return point[low] <= point["truth"][name] <= point[high]


def share(answers):
    known = [answer for answer in answers if answer is not None]
    return f"{100 * sum(known) / len(known):.0f} %" if known else "-"


def quantile(values, p):
    """Type 7, as the program's."""
    ordered = sorted(values)
    if not ordered:
        return math.nan
    at = p * (len(ordered) - 1)
    low = math.floor(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
