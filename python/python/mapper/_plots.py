"""Pictures, drawn with matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def axes(given: Axes | None) -> Axes:
    """Return the given axes, or new ones."""
    if given is not None:
        return given
    try:
        from matplotlib import pyplot
    except ImportError as error:
        message = "plots need matplotlib: pip install 'mapper-turbo[plot]'"
        raise ImportError(message) from error
    made: Any = pyplot.subplots(layout="constrained")[1]
    return made  # type: ignore[no-any-return]


def plot_plan(steps: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the order of the steps on the map."""
    drawn = axes(ax)
    flow, ratio = steps["predicted_flow_kg_s"], steps["predicted_pressure_ratio"]
    drawn.plot(flow, ratio, "-", color="0.7", linewidth=0.8)
    points = drawn.scatter(flow, ratio, c=steps["speed_rpm"] / 1e3, zorder=2)
    for number, x, y in zip(steps.index, flow, ratio, strict=True):
        drawn.annotate(str(number), (x, y), xytext=(3, 3), textcoords="offset points", fontsize="x-small")
    drawn.figure.colorbar(points, ax=drawn, label="shaft speed [krpm]")
    drawn.set(xlabel="mass flow [kg/s]", ylabel="pressure ratio", title="Order of the steps")
    return drawn


def plot_map(points: pd.DataFrame, fitted: pd.DataFrame | None, title: str, ax: Axes | None) -> Axes:
    """Draw speed lines, and efficiency by colour."""
    drawn = axes(ax)
    if fitted is not None:
        measured = fitted[fitted["measured"] & ~fitted["extrapolated"]]
        for _, line in measured.groupby("line_speed_corrected_rpm"):
            drawn.plot(line["flow_corrected_kg_s"], line["pressure_ratio"], "-", color="0.7", linewidth=0.8)
    shown = drawn.scatter(points["flow_corrected_kg_s"], points["pressure_ratio"], c=100 * points["eta"], zorder=2)
    for speed, line in points.groupby("line_speed_corrected_rpm"):
        end = line.sort_values("flow_corrected_kg_s").iloc[0]
        place = (end["flow_corrected_kg_s"], end["pressure_ratio"])
        label = f"{float(str(speed)) / 1e3:.0f} krpm"
        drawn.annotate(label, place, xytext=(-4, 4), textcoords="offset points", ha="right", fontsize="x-small")
    # Room for the labels at the left ends.
    drawn.margins(x=0.16)
    drawn.figure.colorbar(shown, ax=drawn, label="isentropic efficiency [%]")
    drawn.set(xlabel="corrected mass flow [kg/s]", ylabel="pressure ratio", title=title)
    return drawn
