"""Runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from mapper import _mapper, _tables
from mapper._map import Map
from mapper._recording import Recording


class Run:
    """A run that has ended; the rig is safe and the recording is kept.

    Attributes
    ----------
    end : str
        How it ended: ``completed``, ``drifted``, ``tripped`` or ``interrupted``.
    outcome : str
        The same in a sentence.
    json : dict or None
        What ``mapper run --json`` prints; None if the run ended before there was anything to identify.
    """

    def __init__(self, outcome: _mapper.Outcome) -> None:
        self._outcome = outcome
        self.end = outcome.end
        self.outcome = outcome.sentence
        self.json: dict[str, Any] | None = None if outcome.json is None else json.loads(outcome.json)

    @property
    def directory(self) -> Path:
        """The run's directory, with campaign, plan, recording, points, map and report."""
        return self._outcome.directory

    @property
    def recording(self) -> Recording:
        """The recording of the run."""
        return Recording.read(self.directory)

    @property
    def points(self) -> pd.DataFrame:
        """The identified points, by the number of their step; see :attr:`mapper.Result.points`."""
        return _tables.table([] if self.json is None else self.json["points"], "step", _tables.POINT)

    @property
    def map(self) -> Map:
        """The map of the run.

        Raises
        ------
        IdentificationError
            The run has no map.
        """
        made = self._outcome.map
        if made is None:
            remarks = [] if self.json is None else [remark["message"] for remark in self.json["remarks"]]
            raise _mapper.IdentificationError("; ".join(remarks) or self.outcome)
        return Map(made)

    def __repr__(self) -> str:
        """Return a line on the run."""
        count = 0 if self.json is None else len(self.json["points"])
        return f"Run({str(self.directory)!r}, {self.end}, {count} points)"

    def _repr_html_(self) -> str:
        return _tables.points_html(self.points, repr(self))
