"""Diagnosis of the gap between a rig and the nominal model."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from mapper import _mapper, _tables
from mapper._campaign import Campaign
from mapper._effect import Effect
from mapper._progress import Progress, observer
from mapper._recording import Recording
from mapper._result import Result
from mapper._run import Run


class Diagnosis:
    """Where a recording departs from the nominal model, and why.

    Attributes
    ----------
    json : dict
        What ``mapper gap diagnose --json`` prints.
    """

    def __init__(self, diagnosis: dict[str, Any], correct: Callable[[str | None], tuple[str, _mapper.Identified]]) -> None:
        self.json = diagnosis
        self._correct = correct

    @property
    def verdict(self) -> str:
        """``within_tolerance``, ``explained``, ``partly_explained`` or ``unexplained``."""
        return str(self.json["verdict"])

    @property
    def causes(self) -> pd.DataFrame:
        """Candidate causes, best first: what it is, its probability, its size, and causes that cannot be distinguished from it.

        The values of its parameters with their intervals are in ``json["candidates"]``.
        """
        columns = ["cause", "probability", "size", "effects", "equivalent"]
        rows = []
        for candidate in self.json["candidates"]:
            sizes = [f"{key} {value['size']}" for key, value in candidate["parameters"].items()]
            row = {"cause": " and ".join(candidate["names"]), "size": ", ".join(sizes)}
            rows.append(row | {key: candidate[key] for key in ("probability", "effects", "equivalent")})
        frame = pd.DataFrame(rows, columns=columns)
        frame.attrs["units"] = {"probability": "1"}
        return frame

    @property
    def places(self) -> pd.DataFrame:
        """Locations of the gap, largest first; ``size`` is in the unit of the column ``unit``."""
        return _tables.table(self.json["locations"])

    def corrected(self, method: Result | str | None = None) -> Result:
        """Identify the recording again without the causes found, as ``mapper gap correct`` does.

        The intervals contain the uncertainty of the correction. ``json["correction"]`` has each point before and after, and the reason
        under ``refused`` where nothing was corrected: the points are then as recorded. It takes as long as the diagnosis.

        Parameters
        ----------
        method
            ``steady``, ``dynamic`` or ``joint``, or a result whose method is used; the campaign's if none is given.
        """
        if isinstance(method, Result):
            method = next((str(point["method"]) for point in method._points), None)
        correction, inner = self._correct(method)
        result = Result(inner)
        result.json["correction"] = json.loads(correction)
        return result

    @property
    def warnings(self) -> list[str]:
        """Unusable data and caveats."""
        return list(self.json["warnings"])

    def __repr__(self) -> str:
        """Return a line on the diagnosis."""
        return f"Diagnosis({self.verdict}, {len(self.json['candidates'])} candidate causes)"

    def _repr_html_(self) -> str:
        causes = self.causes
        return _tables.html(causes, [str(name) for name in causes.columns], repr(self))


def diagnose(
    recording: Recording | Run,
    campaign: Campaign,
    *,
    effects: Sequence[Effect | str | os.PathLike[str]] = (),
    baseline: Recording | Run | None = None,
    progress: bool | Callable[[dict[str, Any]], object] = False,
) -> Diagnosis:
    """Say where a recording departs from the nominal model and which effect causes it, as ``mapper gap diagnose`` does.

    It takes up to a minute.

    Parameters
    ----------
    recording
        Recording or run of the rig.
    campaign
        Campaign with machine, declared uncertainties and tolerances.
    effects
        Suspected effects: files written in rhai, or :class:`mapper.Effect`.
    baseline
        Reference recording of the same rig and steps: the diagnosis then covers only changes since then.
    progress
        True shows a bar (needs tqdm). A function is called with each event.

    Raises
    ------
    IdentificationError
        Required data are missing, or the recording is of another machine.
    """
    inner = _recorded(recording)
    reference = None if baseline is None else _recorded(baseline)
    with Progress.of(progress) as shown, TemporaryDirectory(prefix="mapper-") as scripts:
        found = _mapper.diagnose(inner, campaign._inner, _files(effects, scripts), reference, observer(shown))

    def correct(method: str | None) -> tuple[str, _mapper.Identified]:
        with TemporaryDirectory(prefix="mapper-") as scripts:
            return _mapper.correct(inner, campaign._inner, _files(effects, scripts), method)

    return Diagnosis(json.loads(found), correct)


def _files(effects: Sequence[Effect | str | os.PathLike[str]], scripts: str) -> list[Path]:
    return [effect.write(Path(scripts)) if isinstance(effect, Effect) else Path(effect) for effect in effects]


def _recorded(given: Recording | Run) -> _mapper.Recording:
    return (given.recording if isinstance(given, Run) else given)._inner
