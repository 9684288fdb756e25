"""Progress of long work."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import TracebackType
from typing import Any

Event = dict[str, Any]


class Progress:
    """Shows events: in a bar, by a function of the user, or not at all."""

    def __init__(self, show: Callable[[Event], object] | None, bar: Any = None) -> None:
        self.show = show
        self._bar = bar

    @classmethod
    def of(cls, asked: bool | Callable[[Event], object]) -> Progress:
        """Return what the argument ``progress`` asks for."""
        if not isinstance(asked, bool):
            return cls(asked)
        if not asked:
            return cls(None)
        try:
            from tqdm.auto import tqdm
        except ImportError as error:
            message = "progress=True needs tqdm: pip install 'mapper-turbo[progress]'"
            raise ImportError(message) from error
        bar = tqdm(total=1.0, bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}")
        return cls(_Bar(bar).show, bar)

    def __enter__(self) -> Progress:
        """Begin."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the bar."""
        if self._bar is not None:
            self._bar.close()


class _Bar:
    """A bar of tqdm over the rig's time, and then over the work on the results."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar
        self._duration_s = 0.0

    def show(self, event: Event) -> None:
        kind = event["event"]
        if kind == "run_started":
            self._duration_s = event["duration_s"]
            self._bar.set_description("run", refresh=False)
        elif kind == "rig_time" and self._duration_s > 0.0:
            self._move(event["t_s"] / self._duration_s)
        elif kind == "progress":
            self._bar.set_description(event["what"], refresh=False)
            self._move(event["done_ratio"])

    def _move(self, done_ratio: float) -> None:
        # tqdm draws at its own interval. A second phase begins at 0 again.
        if done_ratio < self._bar.n:
            self._bar.reset()
        self._bar.update(min(done_ratio, 1.0) - self._bar.n)


def observer(shown: Progress) -> Callable[[str], None] | None:
    """Return the function that takes events as JSON; None if no one looks."""
    show = shown.show
    if show is None:
        return None

    def take(event: str) -> None:
        show(json.loads(event))

    return take
