"""Tables made from the JSON of the command."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

Json = dict[str, Any]

# Endings of names, the longest first.
_UNITS = (
    ("_w_m2k", "W/(m^2 K)"),
    ("_percent", "%"),
    ("_kg_s", "kg/s"),
    ("_rpm", "rpm"),
    ("_pa", "Pa"),
    ("_k", "K"),
    ("_s", "s"),
)
# What is read first of a point.
POINT = (
    *("speed_rpm", "valve", "flow_kg_s", "pressure_ratio", "eta", "eta_low", "eta_high"),
    *("h_w_m2k", "h_low_w_m2k", "h_high_w_m2k", "verdict", "warnings"),
)
_RATIOS = ("eta", "pressure_ratio", "valve", "work_ratio", "beta_ratio")


def unit_of(name: str) -> str | None:
    """Return the unit of a column from its name; None if it is not a number with a unit."""
    for ending, unit in _UNITS:
        if name.endswith(ending):
            return unit
    if name == "minutes" or name.endswith("_minutes"):
        return "min"
    if name.startswith(("h_uncertainty_", "common_h_")):
        return "W/(m^2 K)"
    if name.endswith("uncertainty"):
        return None
    if name.startswith("eta") or name.endswith(_RATIOS):
        return "1"
    return None


def table(rows: Sequence[Mapping[str, Any]], index: str | None = None, first: Sequence[str] = ()) -> pd.DataFrame:
    """Return a table with one row per object, these columns first; nested objects become columns with joined names."""
    objects = _objects(rows)
    flat = [_flat(row, objects) for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    columns: dict[str, list[Any]] = {}
    units = {}
    for name in [*(name for name in first if name in names), *(name for name in names if name not in first)]:
        values = [row.get(name) for row in flat]
        known = next((value for value in values if value is not None), None)
        unit = unit_of(name)
        # A column without any value has no type of its own: unknown numbers are NaN, and an object that is absent in all rows has no column.
        if known is not None:
            columns[name] = values
        elif unit is not None:
            columns[name] = [float("nan")] * len(flat)
        if unit is not None and (known is None or isinstance(known, int | float)):
            units[name] = unit
    rows_of = None if index is None or index not in columns else pd.Index(columns.pop(index), name=index)
    # From rows, pandas makes one block of each type, in three quarters of the time that it takes with a dict of columns.
    frame = pd.DataFrame(list(zip(*columns.values(), strict=True)), index=rows_of, columns=list(columns))
    frame.attrs["units"] = {name: unit for name, unit in units.items() if name in columns}
    return frame


def _objects(rows: Iterable[Mapping[str, Any]], before: str = "") -> set[str]:
    """Return the joined names of all nested objects."""
    found: set[str] = set()
    for row in rows:
        for key, value in row.items():
            if isinstance(value, dict):
                found |= {before + key} | _objects([value], f"{before}{key}_")
    return found


def _flat(row: Mapping[str, Any], objects: set[str], before: str = "") -> Json:
    flat: Json = {}
    for key, value in row.items():
        name = before + key
        if isinstance(value, dict):
            flat.update(_flat(value, objects, f"{name}_"))
        elif name.endswith("_changes") or name.endswith("_changes_w_m2k"):
            # Lists, one value for each shared parameter: they stay in the JSON.
            continue
        elif name == "warnings":
            flat[name] = "; ".join(warning["message"] for warning in value)
        elif value is not None or name not in objects:
            # An object that is absent in a row has the columns of the other rows.
            flat[name] = value
    return flat


def points_html(points: pd.DataFrame, title: str) -> str:
    """Return the main columns of points as HTML."""
    return html(points, [name for name in POINT if name not in ("valve", "warnings")], title)


def html(frame: pd.DataFrame, columns: Sequence[str], title: str) -> str:
    """Return some columns of a table as HTML, with units in the heading."""
    units = frame.attrs.get("units", {})
    shown = frame[[name for name in columns if name in frame]]
    headings = {name: f"{name} [{units[name]}]" for name in shown.columns if units.get(name, "1") != "1"}
    body = shown.rename(columns=headings).to_html(float_format=lambda value: f"{value:.5g}", na_rep="-")
    return f"<p>{title}</p>{body}"
