"""Compressor maps."""

from __future__ import annotations

import json
import os
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from mapper import _mapper, _plots, _tables

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A line is vertical at its choke end: its top is where this share of its largest flow is first reached from the surge side, as in
# the map's choke line.
_CHOKE_RATIO = 0.998


class Map:
    """A compressor map: speed lines with their points, and a fitted surface if there is one.

    Flows and speeds are corrected to the reference state of the map.
    """

    def __init__(self, inner: _mapper.Map, remarks: list[str] | None = None) -> None:
        self._inner = inner
        self.remarks: list[str] = [] if remarks is None else remarks

    @classmethod
    def read(cls, path: str | os.PathLike[str], *, reference: str | None = None) -> Map:
        """Read a map file in any layout that ``mapper map inspect`` understands.

        Parameters
        ----------
        path
            Map file.
        reference
            Reference state if the file does not give it: ``SAE``, ``Garrett``, ``BorgWarner`` or ``"T, P"``.

        Raises
        ------
        MapperError
            The file cannot be read as a map; the message names the line.
        """
        inner, remarks = _mapper.Map.read(Path(path), reference)
        return cls(inner, [_remark(remark) for remark in json.loads(remarks)])

    @property
    def machine(self) -> str:
        """Name of the machine."""
        return self._inner.machine

    @cached_property
    def json(self) -> dict[str, Any]:
        """The map as the format ``json`` has it."""
        return json.loads(self._inner.json())  # type: ignore[no-any-return]

    @property
    def reference(self) -> dict[str, Any]:
        """Reference state of corrected flow and speed: temperature, K, and pressure, Pa."""
        return dict(self.json["reference"])

    @property
    def points(self) -> pd.DataFrame:
        """The points on their lines: flows in kg/s, speeds in rpm, ``eta`` as a fraction with its 95 % interval."""
        rows = []
        for line in self.json["lines"]:
            for point in line["points"]:
                row = {"line_speed_corrected_rpm": line["speed_corrected_rpm"], **point["identified"]}
                # The place on the line counts, not the one as measured.
                rows.append({**row, **{key: point[key] for key in ("flow_corrected_kg_s", "pressure_ratio", "eta")}})
        return _tables.table(rows)

    @property
    def fitted(self) -> pd.DataFrame | None:
        """Nodes of the fitted surface, from the choke end (beta 0) to the surge end (beta 1); None without a fit.

        Flows in kg/s, speeds in rpm, ``eta`` as a fraction; errors are one standard error.
        """
        surface = self.json.get("fitted")
        if surface is None:
            return None
        rows = [
            {
                "line_speed_corrected_rpm": line["speed_corrected_rpm"],
                "measured": line["measured"],
                "beta_ratio": beta,
                **node,
            }
            for line in surface["lines"]
            for beta, node in zip(surface["beta_ratio"], line["nodes"], strict=True)
        ]
        return _tables.table(rows)

    def fit(self) -> Map:
        """Return the map with a surface fitted through its points, as ``mapper map fit`` does.

        Raises
        ------
        MapperError
            There are not enough points.
        """
        return Map(self._inner.fit(), self.remarks)

    def at_reference(self, reference: str) -> Map:
        """Return the map corrected to another reference state: ``SAE``, ``Garrett``, ``BorgWarner`` or ``"T, P"``."""
        return Map(self._inner.at_reference(reference), self.remarks)

    def eta(self, *, speed_rpm: npt.ArrayLike, flow_kg_s: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the isentropic efficiency of the fitted surface, by linear interpolation between its nodes.

        Parameters
        ----------
        speed_rpm
            Corrected speed, rpm.
        flow_kg_s
            Corrected mass flow, kg/s.

        Returns
        -------
        numpy.ndarray
            Efficiency, fraction; NaN outside the fitted lines.

        Raises
        ------
        MapperError
            The map has no fitted surface: use :meth:`fit`.
        """
        return self._interpolated("eta", speed_rpm, flow_kg_s)

    def pressure_ratio(self, *, speed_rpm: npt.ArrayLike, flow_kg_s: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the total pressure ratio of the fitted surface; arguments as for :meth:`eta`."""
        return self._interpolated("pressure_ratio", speed_rpm, flow_kg_s)

    def _interpolated(
        self, quantity: str, speed_rpm: npt.ArrayLike, flow_kg_s: npt.ArrayLike
    ) -> npt.NDArray[np.float64]:
        surface = self.json.get("fitted")
        if surface is None:
            raise _mapper.MapperError("the map has no fitted surface; make one with `.fit()`")
        lines = surface["lines"]
        speeds = np.array([line["speed_corrected_rpm"] for line in lines])

        def nodes(name: str) -> npt.NDArray[np.float64]:
            return np.array([[node[name] for node in line["nodes"]] for line in lines], dtype=np.float64)

        flows, values = nodes("flow_corrected_kg_s"), nodes(quantity)

        def at(speed: float, flow: float) -> float:
            if not speeds[0] <= speed <= speeds[-1]:
                return float("nan")
            above = int(np.clip(np.searchsorted(speeds, speed), 1, len(speeds) - 1))
            share = (speed - speeds[above - 1]) / (speeds[above] - speeds[above - 1])
            # Equal beta on every line; from the surge end on, so that flow rises.
            on_line = ((1 - share) * flows[above - 1] + share * flows[above])[::-1]
            value = ((1 - share) * values[above - 1] + share * values[above])[::-1]
            end = int(np.argmax(on_line >= _CHOKE_RATIO * on_line.max())) + 1
            return float(np.interp(flow, on_line[:end], value[:end], left=np.nan, right=np.nan))

        return np.asarray(np.vectorize(at, otypes=[np.float64])(speed_rpm, flow_kg_s), dtype=np.float64)

    def to(self, format: str, path: str | os.PathLike[str] | None = None, *, replace: bool = False) -> bytes:
        """Write the map in a format of :func:`map_formats`. A format that tabulates the whole map gets a fitted one.

        Parameters
        ----------
        format
            Name of the format, for example ``csv``, ``simscape``, ``sae``.
        path
            File to write; none is written if it is None.
        replace
            Whether an existing file is replaced.

        Returns
        -------
        bytes
            Content of the file.

        Raises
        ------
        MapperError
            The format is unknown or cannot represent the map, or the file exists.
        """
        if path is not None:
            self._inner.write(Path(path), format, replace)
            return Path(path).read_bytes()
        with TemporaryDirectory(prefix="mapper-") as directory:
            file = Path(directory) / "map"
            self._inner.write(file, format, False)
            return file.read_bytes()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the map: pressure ratio over corrected flow, efficiency by colour."""
        return _plots.plot_map(self.points, self.fitted, self.machine, ax)

    def __repr__(self) -> str:
        """Return a line on the map."""
        lines = self.json["lines"]
        count = sum(len(line["points"]) for line in lines)
        fitted = "fitted" if self.json.get("fitted") else "not fitted"
        return f"Map({self.machine!r}, {count} points on {len(lines)} speed lines, {fitted})"

    def _repr_html_(self) -> str:
        return f"<p>{self!r}</p>{self.to('svg').decode()}"


def reduce(measured: pd.DataFrame, *, reference: str | None = None) -> Map:
    """Reduce steady measured points to a map, as the map reader does with a file that has these columns.

    Parameters
    ----------
    measured
        One row per point. Columns are named as in map files, with units: ``N [rpm]``, ``m [kg/s]``, ``P1 [kPa]``, ``T1 [degC]``,
        ``P2 [kPa]``, ``T2 [degC]``. Efficiencies of temperatures are apparent, heat transfer included.
    reference
        Reference state of corrected flow and speed: ``SAE``, ``Garrett``, ``BorgWarner`` or ``"T, P"``; ``SAE`` by default.

    Raises
    ------
    MapperError
        The columns are not those of a map; the message names what is missing.
    """
    with TemporaryDirectory(prefix="mapper-") as directory:
        file = Path(directory) / "points.csv"
        measured.to_csv(file, index=False)
        return Map.read(file, reference=reference)


def map_formats() -> pd.DataFrame:
    """Return the formats that maps are written in: extension and description by name."""
    formats = pd.DataFrame(_mapper.map_formats(), columns=["name", "extension", "description"])
    return formats.set_index("name")


def _remark(remark: Any) -> str:
    """Return the key of a remark, with its values."""
    return remark if isinstance(remark, str) else json.dumps(remark)
