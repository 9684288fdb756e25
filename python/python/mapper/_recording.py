"""Recordings."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import pandas as pd

from mapper import _mapper, _tables


class Described(Protocol):
    """What a recording needs of a :class:`mapper.Campaign`: machine, sensors and window, not its plans and runs."""

    _inner: _mapper.Campaign


class Recording:
    """Samples, steps and events of a rig, in SI units.

    Made by :meth:`read` or :meth:`from_frame`.
    """

    def __init__(self, inner: _mapper.Recording) -> None:
        self._inner = inner

    @cached_property
    def _summary(self) -> dict[str, Any]:
        summary: dict[str, Any] = json.loads(self._inner.summary)
        return summary

    @cached_property
    def _units(self) -> dict[str, str]:
        return dict(self._inner.channels)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        channels: str | os.PathLike[str] | None = None,
        *,
        campaign: Described | None = None,
    ) -> Recording:
        """Read a run directory, an MCAP file or a log of another program.

        Parameters
        ----------
        path
            Run directory, MCAP file, CSV, Excel or MDF 4 log.
        channels
            Channel map (YAML): which column of a log is which channel. Recordings of this program need none.
        campaign
            Campaign with machine, sensors and window, instead of the one in the recording.

        Raises
        ------
        RecordingError
            The recording cannot be read, or the channel map has mistakes, shown with line and caret.
        CampaignError
            The campaign in the recording has mistakes, for example because another version made it: give `campaign`.
        """
        own = None if campaign is None else campaign._inner
        return cls(_mapper.Recording.read(Path(path), None if channels is None else Path(channels), own))

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        channels: Mapping[str, str | Mapping[str, Any]],
        *,
        time: str | None = None,
        ambient_pressure: str | Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> Recording:
        """Take the samples of a DataFrame, by the same import as a log file.

        Parameters
        ----------
        frame
            One row per sample.
        channels
            For each channel (``N``, ``m_c``, ``P1``, ``T1``, ``P2``, ``T2``, ``Tc``, ...) its column with its unit: ``"T_out [degC]"``. Gauge
            pressures and other settings: ``{"column": "p2", "unit": "kPa", "gauge": True}``.
        time
            Column with the time: seconds, dates or durations. The index by default, if it is not a plain row number.
        ambient_pressure
            Reference of gauge pressures: a value (``"98.7 kPa"``), or a column as for ``channels``.
        options
            Further keys of a channel map: ``machine``, ``sensors``, ``window``, ``reference``.

        Raises
        ------
        RecordingError
            A column is missing, or a unit is wrong; line and caret refer to the channel map as indented JSON.
        """
        # Attributes would be copied with every column.
        frame = frame.copy(deep=False)
        frame.attrs = {}
        t_s, start_time_ns = _clock(frame, time)
        columns: dict[str, npt.NDArray[np.float64]] = {}
        sources = {}
        for symbol, source in channels.items():
            sources[symbol] = _source(frame, symbol, source, columns)
        mapping: dict[str, Any] = {"channels": sources, **(options or {})}
        if isinstance(ambient_pressure, Mapping) or _column(frame, ambient_pressure) is not None:
            assert ambient_pressure is not None
            mapping["ambient_pressure"] = _source(frame, "ambient", ambient_pressure, columns)
        elif ambient_pressure is not None:
            mapping["ambient_pressure"] = ambient_pressure
        header = json.dumps({"columns": list(columns), "start_time_ns": start_time_ns})
        # The only copy of the samples on this side.
        content = b"".join((b"mapper DataFrame\n", header.encode(), b"\n", *(column.data for column in (t_s, *columns.values()))))
        return cls(_mapper.Recording.of_frame(content, json.dumps(mapping, indent=2, ensure_ascii=False)))

    @property
    def channels(self) -> dict[str, str]:
        """Unit of each channel, by symbol."""
        return dict(self._units)

    @property
    def warnings(self) -> list[str]:
        """Problems of the file; empty for an intact one."""
        return list(self._summary["warnings"])

    @property
    def events(self) -> pd.DataFrame:
        """Events of the run: tripped guards, stops, the safe state; times in s."""
        return _tables.table(self._summary["events"])

    @property
    def steps(self) -> pd.DataFrame:
        """The steps: times in s, speeds in rpm, pressures in Pa."""
        return _tables.table(self._summary["steps"], "step")

    @property
    def frame(self) -> pd.DataFrame:
        """All channels in SI units over the run time, s."""
        frame = pd.concat({symbol: self[symbol] for symbol in self._units}, axis=1)
        frame.attrs["units"] = self.channels
        return frame

    def __getitem__(self, symbol: str) -> pd.Series[float]:
        """Return the samples of a channel in its SI unit (rpm for speed) over the run time, s."""
        t_s, values = (np.frombuffer(data) for data in self._inner.samples(symbol))
        series = pd.Series(values, index=pd.Index(t_s, name="t_s"), name=symbol)
        series.attrs["units"] = self._units[symbol]
        return series

    def __repr__(self) -> str:
        """Return a line on the recording."""
        return f"Recording({self._summary['path']!r}, {len(self._units)} channels, {len(self._summary['steps'])} steps)"


def _clock(frame: pd.DataFrame, time: str | None) -> tuple[npt.NDArray[np.float64], int | None]:
    """Return the time of each row, s, and the date of time 0, ns since 1970-01-01 UTC."""
    if time is not None:
        if time not in frame:
            raise _mapper.RecordingError(f"the DataFrame has no column `{time}` for the time")
        clock = pd.Index(frame[time])
    elif isinstance(frame.index, pd.RangeIndex) and frame.index.name is None:
        raise _mapper.RecordingError("the rows have numbers and no times; name the column of the time with `time=`")
    else:
        clock = frame.index
    start_time_ns = None
    if pd.api.types.is_datetime64_any_dtype(clock.dtype):
        start = clock.min()
        start_time_ns = None if pd.isna(start) else int(start.value)
        clock = clock - start
    if isinstance(clock, pd.TimedeltaIndex):
        clock = clock.total_seconds()
    return _numbers(clock, "time"), start_time_ns


def _numbers(column: pd.Series[Any] | pd.Index[Any], symbol: str) -> npt.NDArray[np.float64]:
    """Return the values of a column, one after the other in memory; empty cells are NaN."""
    try:
        return np.ascontiguousarray(column.to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError) as error:
        message = f"{symbol}: column `{column.name}` has values that are not numbers: {error}"
        raise _mapper.RecordingError(message) from error


def _column(frame: pd.DataFrame, text: object) -> tuple[str, str | None] | None:
    """Return column and unit of ``name [unit]``; None if there is no such column."""
    if not isinstance(text, str):
        return None
    name, bracket, unit = text.removesuffix("]").rpartition("[")
    if bracket:
        for column in (text, name.strip()):
            if column in frame:
                return column, unit.strip()
    return (text, None) if text in frame else None


def _source(
    frame: pd.DataFrame, symbol: str, source: str | Mapping[str, Any], columns: dict[str, npt.NDArray[np.float64]]
) -> dict[str, Any]:
    """Take the column of a channel and return its line of the channel map."""
    rest = {} if isinstance(source, str) else {key: value for key, value in source.items() if key != "column"}
    named = source if isinstance(source, str) else source.get("column")
    found = _column(frame, named)
    if found is None:
        known = ", ".join(str(column) for column in frame.columns)
        raise _mapper.RecordingError(f"{symbol}: the DataFrame has no column `{named}`; it has {known}")
    column, unit = found
    columns[symbol] = _numbers(frame[column], symbol)
    return {"field": symbol, **({} if unit is None else {"unit": unit}), **rest}
