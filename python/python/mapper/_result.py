"""Identification."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pandas as pd

from mapper import _mapper, _tables
from mapper._campaign import Campaign
from mapper._map import Map
from mapper._recording import Recording
from mapper._run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Result:
    """Identified points."""

    def __init__(self, inner: _mapper.Identified) -> None:
        self._inner = inner
        self._points: list[dict[str, Any]] = json.loads(inner.points)

    @cached_property
    def json(self) -> dict[str, Any]:
        """What ``mapper identify --json`` prints."""
        report: dict[str, Any] = json.loads(self._inner.json)
        return report

    @property
    def points(self) -> pd.DataFrame:
        """The points, by the number of their step.

        Speeds in rpm, flows in kg/s, temperatures in K, pressures in Pa; ``eta`` is the isentropic efficiency, fraction, and ``h_w_m2k``
        the heat-transfer coefficient, W/(m^2 K), each with its 95 % interval. ``attrs["units"]`` has all units.
        """
        return _tables.table(self._points, "step", _tables.POINT)

    @property
    def turbine_points(self) -> pd.DataFrame:
        """The turbine at the points whose turbine side was measured, by the number of their step; empty without such points.

        ``efficiency`` is turbine times mechanical efficiency, total to static, fraction, with its 95 % interval. Speed and flow are reduced by
        the total state at the inlet: rpm/K^0.5 and kg K^0.5/(s kPa).
        """
        rows = json.loads(self._inner.turbine_points)
        kept = [
            {name: value for name, value in row.items() if name not in ("budget", "common", "doubts")} for row in rows
        ]
        return _tables.table(kept, "step")

    @property
    def turbine_map(self) -> pd.DataFrame:
        """The fitted map of the turbine, a row per node with 95 % intervals; empty with fewer than four usable points."""
        lines = json.loads(self._inner.turbine_map) or []
        nodes = [
            {**{k: v for k, v in line.items() if k != "nodes"}, **node} for line in lines for node in line["nodes"]
        ]
        return _tables.table(nodes)

    @property
    def remarks(self) -> list[str]:
        """Remarks of the identification, and warnings of the reader."""
        return [*self.json["recording_warnings"], *(remark["message"] for remark in self.json["remarks"])]

    @cached_property
    def map(self) -> Map:
        """The map of the points, with a fitted surface if there are enough of them.

        Raises
        ------
        IdentificationError
            The points do not make a map; the message says why.
        """
        return Map(self._inner.map())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the map of the points."""
        return self.map.plot(ax)

    def __repr__(self) -> str:
        """Return a line on the result."""
        good = sum(point["verdict"] == "good" for point in self._points)
        return f"Result({len(self._points)} points, {good} good)"

    def _repr_html_(self) -> str:
        return _tables.points_html(self.points, repr(self))


def identify(
    recordings: Recording | Run | Sequence[Recording | Run],
    campaign: Campaign | None = None,
    *,
    method: str | None = None,
) -> Result:
    """Identify efficiency and heat transfer from recordings, as ``mapper identify`` does.

    Parameters
    ----------
    recordings
        A recording or run; several of the same machine are identified together.
    campaign
        Campaign with machine, sensors and window, instead of the one in the recording.
    method
        ``steady``, ``dynamic`` or ``joint``; the campaign's by default.

    Raises
    ------
    IdentificationError
        The recording does not contain the required data, or its machine is unknown.
    """
    given = [recordings] if isinstance(recordings, (Recording, Run)) else list(recordings)
    read = [(one.recording if isinstance(one, Run) else one)._inner for one in given]
    return Result(_mapper.identify(read, None if campaign is None else campaign._inner, method))
