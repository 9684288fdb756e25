"""Effects of a diagnosis as Python functions."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np


class Parameter(NamedTuple):
    """A parameter of an effect: a fit searches it between ``low`` and ``high``."""

    unit: str
    low: float
    high: float
    step: float
    neutral: float = 0.0


class Number:
    """A number that an effect computes with: an expression that the model evaluates at every instant of a simulation."""

    def __init__(self, text: str) -> None:
        self._text = text

    def _with(self, form: str, other: object) -> Number:
        return Number(form.format(self._text, _text(other)))

    def __add__(self, other: object) -> Number:
        """Add."""
        return self._with("({0} + {1})", other)

    def __radd__(self, other: object) -> Number:
        """Add."""
        return self._with("({1} + {0})", other)

    def __sub__(self, other: object) -> Number:
        """Subtract."""
        return self._with("({0} - {1})", other)

    def __rsub__(self, other: object) -> Number:
        """Subtract."""
        return self._with("({1} - {0})", other)

    def __mul__(self, other: object) -> Number:
        """Multiply."""
        return self._with("({0} * {1})", other)

    def __rmul__(self, other: object) -> Number:
        """Multiply."""
        return self._with("({1} * {0})", other)

    def __truediv__(self, other: object) -> Number:
        """Divide."""
        return self._with("({0} / {1})", other)

    def __rtruediv__(self, other: object) -> Number:
        """Divide."""
        return self._with("({1} / {0})", other)

    def __pow__(self, other: object) -> Number:
        """Raise to a power."""
        return self._with("({0} ** {1})", other)

    def __rpow__(self, other: object) -> Number:
        """Raise to a power."""
        return self._with("({1} ** {0})", other)

    def __neg__(self) -> Number:
        """Negate."""
        return Number(f"(-{self._text})")

    def __abs__(self) -> Number:
        """Return the absolute value."""
        return self._function("abs")

    def __bool__(self) -> bool:
        """Refuse a branch."""
        message = "an effect in Python has no branches, since it is read once: write one with `if` in rhai (docs/reference/effects.md)"
        raise TypeError(message)

    __lt__ = __le__ = __gt__ = __ge__ = lambda self, _: bool(self)

    def __float__(self) -> float:
        """Refuse a conversion."""
        raise TypeError("an effect is computed by the model: use NumPy's functions, such as np.exp, not those of math")

    def _function(self, name: str) -> Number:
        return Number(f"{name}({self._text})")

    # NumPy calls a method of the function's name for every object that is not a number.
    def exp(self) -> Number:
        """Return the exponential."""
        return self._function("exp")

    def log(self) -> Number:
        """Return the natural logarithm."""
        return self._function("ln")

    def sqrt(self) -> Number:
        """Return the square root."""
        return self._function("sqrt")

    def sin(self) -> Number:
        """Return the sine of radians."""
        return self._function("sin")

    def cos(self) -> Number:
        """Return the cosine of radians."""
        return self._function("cos")

    def tanh(self) -> Number:
        """Return the hyperbolic tangent."""
        return self._function("tanh")


class _Values:
    """The machine at an instant, or the parameters: a number for each name."""

    def __init__(self, variable: str, names: list[str] | None = None) -> None:
        self._variable = variable
        self._names = names

    def __getattr__(self, name: str) -> Number:
        if name.startswith("_") or (self._names is not None and name not in self._names):
            raise AttributeError(f"there is no `{self._variable}.{name}`; there are {', '.join(self._names or [])}")
        return Number(f"{self._variable}.{name}")


Hook = Callable[..., object]


class Effect:
    """A candidate effect of a diagnosis, with its equation as Python functions.

    The functions are called once, when the effect is made, and their arithmetic becomes a script, which the model evaluates without Python: a
    diagnosis with it gives the same numbers, in the same time, as with the script written by hand.

    Parameters
    ----------
    id
        Name: lower-case letters, digits and ``_``.
    submodel
        Part of the rig that it belongs to, for example ``compressor_housing``.
    parameters
        Its parameters by name, at most four: ``Parameter(unit, low, high, step)``.
    description
        One line for reports.
    hooks
        Functions by the name of their hook (docs/reference/effects.md), for example ``heat_to_compressor_w``. Each is called with ``at``, the
        machine at an instant, ``p``, the parameters, and, where the hook changes a value, that value. They use arithmetic and NumPy's ``exp``,
        ``log``, ``sqrt``, ``sin``, ``cos``, ``tanh`` and ``abs``.

    Attributes
    ----------
    text : str
        The script.

    Examples
    --------
    >>> coolant = mapper.Effect(
    ...     "coolant_passage",
    ...     submodel="compressor_housing",
    ...     parameters={"G": mapper.Parameter("W/K", 0, 20, step=1.5)},
    ...     heat_to_compressor_w=lambda at, p: p.G * (358.15 - at.tc_k),
    ... )
    >>> mapper.diagnose(recording, campaign, effects=[coolant])
    """

    def __init__(
        self,
        id: str,
        *,
        submodel: str,
        parameters: Mapping[str, Parameter | tuple[str, float, float, float]],
        description: str = "",
        **hooks: Hook,
    ) -> None:
        lines = [f"//! effect: {id}", f"//! submodel: {submodel}"]
        if description:
            lines.append(f"//! description: {' '.join(description.split())}")
        for name, given in parameters.items():
            unit, low, high, step, neutral = Parameter(*given)
            lines.append(f"//! parameter: {name} [{unit}] {low} .. {high}, neutral {neutral}, step {step}")
        for name, hook in hooks.items():
            arguments = [_Values("at"), _Values("p", list(parameters)), Number("value")]
            count = len(inspect.signature(hook).parameters)
            body = _text(hook(*arguments[:count]))
            lines += ["", f"fn {name}({', '.join(['at', 'p', 'value'][:count])}) {{", f"    {body}", "}"]
        self.id = id
        self.text = "\n".join(lines) + "\n"

    def write(self, directory: Path) -> Path:
        """Write the script into a directory, by its name, and return its path."""
        path = directory / f"{self.id}.rhai"
        path.write_text(self.text, encoding="utf-8")
        return path

    def __repr__(self) -> str:
        """Return a line on the effect."""
        return f"Effect({self.id!r})"


def _text(value: object) -> str:
    if isinstance(value, Number):
        return value._text
    if not isinstance(value, (int, float, np.floating, np.integer)) or not np.isfinite(float(value)):
        raise TypeError(f"{value!r} is not a finite number, which is what an effect computes with")
    return f"({float(value)!r})" if value < 0 else repr(float(value))
