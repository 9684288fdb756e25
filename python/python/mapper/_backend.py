"""Simulated rigs in Python."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from mapper import _driver, _mapper

Samples: TypeAlias = tuple[npt.ArrayLike, Mapping[str, npt.ArrayLike]]
Fast: TypeAlias = tuple[str, float, float, npt.ArrayLike]


class Backend:
    """A simulated rig in Python: a subclass with these methods drives :meth:`mapper.Campaign.run`.

    The run calls the methods from another thread, through the protocol of drivers (docs/reference/protocol.md): a rig in Python gets the same
    checks, leases and safe state as one behind a program. Times are in seconds since :meth:`arm`, values in SI units, shaft speed in rpm.

    Attributes
    ----------
    channels : sequence of str
        Symbols of the measured quantities and commands that :meth:`poll` returns, for example ``"T2"`` or ``"P3_command"``.
    sample_rate_hz : float
        Samples per second, Hz.
    accepts : mapping
        Smallest and largest setpoint: ``p3_pa``, ``t3_k``, ``valve_opening_ratio``, ``oil_temperature_k``.
    safe : mapping
        The way to the safe state: ``p3_slew_pa_s``, ``valve_opening_ratio`` and ``within_s``.
    needs_guarded : sequence of str
        Guards that a campaign on this rig must have.
    """

    channels: Sequence[str] = ()
    sample_rate_hz: float = 10.0
    accepts: ClassVar[Mapping[str, tuple[float, float]]] = {
        "p3_pa": (50e3, 600e3),
        "t3_k": (250.0, 1100.0),
        "valve_opening_ratio": (0.05, 2.5),
        "oil_temperature_k": (250.0, 450.0),
    }
    safe: ClassVar[Mapping[str, float]] = {"p3_slew_pa_s": 100e3, "valve_opening_ratio": 1.0, "within_s": 20.0}
    needs_guarded: Sequence[str] = ()

    def arm(self) -> None:
        """Arm the rig: time 0."""

    def set(self, setpoints: dict[str, Any]) -> None:
        """Take new setpoints.

        Parameters
        ----------
        setpoints
            ``mode`` (``"running"`` or ``"standstill"``), ``p3_pa``, ``t3_k``, ``valve_opening_ratio``, ``oil_temperature_k``; always within
            :attr:`accepts`.
        """
        raise NotImplementedError

    def poll(self, until_s: float) -> Samples | tuple[npt.ArrayLike, Mapping[str, npt.ArrayLike], Sequence[Fast]]:
        """Return the samples since the last call: their times, s, and the values of each channel; NaN is no reading.

        Fast samples of P1 or P2 may follow: for each stretch the channel, the time of its first value, s, the interval, at most 10 ms, in s, and
        the values.

        Parameters
        ----------
        until_s
            Time of the last sample at most, s.
        """
        raise NotImplementedError

    def make_safe(self) -> None:
        """Cut the air and open the valve, at any time while armed."""

    def disarm(self) -> None:
        """Disarm the rig."""


class _Rig(_driver.Rig):
    """A backend as the protocol's helper wants it; keeps the first exception of its author."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.error: Exception | None = None

    def describe(self) -> Any:
        of = self._backend
        return _driver.description(
            list(of.channels), float(of.sample_rate_hz), True, dict(of.accepts), dict(of.safe), list(of.needs_guarded)
        )

    def arm(self) -> None:
        self._call(self._backend.arm)

    def set(self, setpoints: dict[str, Any]) -> None:
        self._call(self._backend.set, dict(setpoints))

    def poll(self, until_s: float) -> tuple[list[float], dict[str, list[float | None]], list[Any], list[Any]]:
        times, columns, *fast = self._call(self._backend.poll, until_s)
        values = {
            name: [None if number != number else number for number in _plain(column)]
            for name, column in columns.items()
        }
        stretches = [(name, float(first), float(step), _plain(of)) for name, first, step, of in (fast or [[]])[0]]
        return _plain(times), values, [], stretches

    def make_safe(self) -> None:
        self._call(self._backend.make_safe)

    def disarm(self) -> None:
        self._call(self._backend.disarm)

    def _call(self, method: Callable[..., Any], *arguments: object) -> Any:
        try:
            return method(*arguments)
        except _driver.Refused:
            raise
        except Exception as error:
            self.error = self.error or error
            raise


def _plain(values: npt.ArrayLike) -> list[float]:
    """Return numbers as the protocol's JSON has them."""
    return [float(value) for value in np.asarray(values, dtype=np.float64)]


@contextmanager
def listening(name: str, backend: Backend | Callable[[dict[str, Any]], Backend] | None) -> Iterator[Path | None]:
    """Let a run reach a rig in Python: yields the socket at which a thread of this process serves it."""
    if backend is None:
        yield None
        return
    rigs: list[_Rig] = []

    def open_rig(settings: dict[str, Any] | None) -> _Rig:
        try:
            made = backend if isinstance(backend, Backend) else backend(dict(settings or {}))
        except Exception as error:
            raise _driver.Refused("settings", f"the rig could not be made: {error}") from error
        rigs.append(_Rig(made))
        return rigs[-1]

    with TemporaryDirectory(prefix="mapper-") as directory:
        socket = Path(directory) / f"{name}.socket"
        news: queue.Queue[Any] = queue.Queue()
        listener = _driver.listen_at(str(socket))
        arguments = (listener, str(socket), name, "in Python", open_rig, news)
        server = threading.Thread(target=_driver.serve_hosts, args=arguments, name=f"mapper rig {name}", daemon=True)
        server.start()
        try:
            yield socket
        except _mapper.MapperError as error:
            cause = next((rig.error for rig in rigs if rig.error is not None), None)
            if cause is None:
                raise
            raise error from cause
        finally:
            news.put(_driver.TERMINATE)
            server.join()
