"""Campaigns and plans."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd

from mapper import _mapper, _plots, _tables
from mapper._backend import Backend, listening
from mapper._progress import Progress, observer
from mapper._run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Wheel of the machine of Burke et al., whose sizes a template scales (docs/reference/constants.md).
_WHEEL_M = 0.052


class Campaign:
    """A checked campaign: machine, sensors, rig, grid, limits.

    Made by :meth:`load`, :meth:`template`, :meth:`from_dict` or :meth:`from_text`.
    """

    def __init__(self, inner: _mapper.Campaign) -> None:
        self._inner = inner

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Campaign:
        """Read and check a campaign file.

        Parameters
        ----------
        path
            Campaign file (YAML).

        Raises
        ------
        CampaignError
            The file cannot be read, or has mistakes; the message shows each with line, caret and remedy.
        """
        return cls(_mapper.Campaign.load(Path(path)))

    @classmethod
    def from_text(cls, text: str, directory: str | os.PathLike[str] = ".") -> Campaign:
        """Check the text of a campaign.

        Parameters
        ----------
        text
            The campaign (YAML).
        directory
            Base of the relative paths in the text.

        Raises
        ------
        CampaignError
            The text has mistakes.
        """
        return cls(_mapper.Campaign.check(text, Path(directory) / "campaign.yaml"))

    @classmethod
    def from_dict(cls, campaign: Mapping[str, Any], directory: str | os.PathLike[str] = ".") -> Campaign:
        """Check a campaign given as a dict with the keys of the file; quantities are texts with units (``"50 krpm"``).

        Parameters
        ----------
        campaign
            The campaign.
        directory
            Base of its relative paths.

        Raises
        ------
        CampaignError
            It has mistakes; line and caret refer to the dict as indented JSON.
        """
        return cls.from_text(json.dumps(campaign, indent=2, ensure_ascii=False), directory)

    @classmethod
    def template(
        cls,
        rig: str = "virtual_lab",
        *,
        wheel_diameter_m: float = _WHEEL_M,
        name: str = "my_turbo",
        directory: str | os.PathLike[str] | None = None,
        map: str | os.PathLike[str] | None = None,
        reference: str | None = None,
    ) -> Campaign:
        """Make the first campaign of a machine, as ``mapper init`` does.

        Parameters
        ----------
        rig
            Source of the recordings: ``virtual_lab``, ``gas_stand`` or ``log``.
        wheel_diameter_m
            Diameter of the compressor's wheel at its exit, m. The default is that of the machine of Burke et al.
        name
            Name of the campaign and of its files.
        directory
            Directory for the files, to edit them; they are not kept if it is None.
        map
            The machine's own map; that of a similar compressor by default.
        reference
            Reference state of map and results: ``SAE``, ``Garrett``, ``BorgWarner`` or ``"T, P"``; that of the map's file by default.

        Raises
        ------
        MapperError
            A file exists already, the template is unknown, or the map cannot be read.
        """
        with TemporaryDirectory(prefix="mapper-") as temporary:
            place = Path(temporary if directory is None else directory)
            own = None if map is None else Path(map)
            written = json.loads(_mapper.write_template(name, place, rig, wheel_diameter_m, own, reference))
            return cls.load(written["campaign"])

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self._inner.name

    @property
    def machine(self) -> str:
        """Name of the machine."""
        return self._inner.machine

    @property
    def text(self) -> str:
        """The campaign as YAML."""
        return self._inner.text

    def plan(self, *, effort: float | None = None) -> Plan:
        """Order the points and forecast every step.

        Parameters
        ----------
        effort
            Effort of the search: 1 is normal, 100 takes a hundred times as long.

        Raises
        ------
        CampaignError
            Points cannot be reached, or no order is allowed.
        """
        return Plan(json.loads(self._inner.plan(effort)))

    def run(
        self,
        out: str | os.PathLike[str] | None = None,
        *,
        backend: Backend | Callable[[dict[str, Any]], Backend] | None = None,
        progress: bool | Callable[[dict[str, Any]], object] = False,
    ) -> Run:
        """Plan, run on the simulated rig, record, identify, and write the results to a new directory.

        Ctrl-C stops the run at the next sample. ``KeyboardInterrupt`` is raised when the rig is safe; the recording up to then is kept.

        Parameters
        ----------
        out
            Parent of the run's directory; the campaign's ``outputs.directory`` by default.
        backend
            Simulated rig in Python, or a function (a class, for example) that makes it from the settings below ``backend.NAME`` in the
            campaign. NAME is any name that no backend of ``mapper`` has.
        progress
            True shows a bar (needs tqdm). A function is called with each event.

        Raises
        ------
        CampaignError
            There is no plan, or the backend's settings are wrong.
        MapperError
            The rig failed, or it is a rig in real time: use the command ``mapper run`` for it. An exception of a rig in Python is its cause.
        """
        parent = Path(self._inner.output_directory if out is None else out)
        now = datetime.now(timezone.utc)
        started_name, started_ns = now.strftime("%Y%m%dT%H%M%SZ"), int(now.timestamp() * 1e9)
        with Progress.of(progress) as shown, listening(self._inner.backend, backend) as socket:
            return Run(_mapper.run(self._inner, parent, started_name, started_ns, observer(shown), socket))

    def __repr__(self) -> str:
        """Return a line on the campaign."""
        inner = self._inner
        return f"Campaign({inner.name!r}, machine {inner.machine!r}, {inner.points} points on {inner.backend!r})"


class Plan:
    """An ordered list of steps with their expected results.

    Attributes
    ----------
    json : dict
        The plan as ``mapper plan --json`` prints it.
    """

    def __init__(self, plan: dict[str, Any]) -> None:
        self.json = plan

    @property
    def steps(self) -> pd.DataFrame:
        """The steps in order, by their number. Speeds in rpm, pressures in Pa, temperatures in K, flows in kg/s."""
        return _tables.table(self.json["steps"], "step")

    @property
    def minutes(self) -> float:
        """Duration of the run, min."""
        return float(self.json["figures"]["minutes"])

    @property
    def remarks(self) -> list[str]:
        """Remarks for the operator."""
        return [remark["message"] for remark in self.json["remarks"]]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the order of the steps over mass flow and pressure ratio."""
        return _plots.plot_plan(self.steps, ax)

    def __repr__(self) -> str:
        """Return a line on the plan."""
        return f"Plan({self.json['campaign']!r}, {len(self.json['steps'])} steps in {self.minutes:.0f} min)"

    def _repr_html_(self) -> str:
        columns = ["speed_rpm", "valve", "p3_pa", "dwell_s", "predicted_flow_kg_s", "predicted_pressure_ratio"]
        return _tables.html(self.steps, [*columns, "predicted_sigma_eta"], repr(self))
