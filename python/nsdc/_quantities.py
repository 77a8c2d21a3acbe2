"""The quantities of an experiment, and values that are given for them."""

from __future__ import annotations

import difflib
import html
import math
import operator
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: What a run may be given.
GIVEN = "parameter, initial value or input"
#: `x[1]`, `A[1,2]`: what it is an entry of, and its indices from 1.
ENTRY = re.compile(r"^(?P<base>.*)\[(?P<indices>[0-9, ]+)\]$")


@dataclass(frozen=True)
class Quantity:
    """A parameter, state, control, input or output of a model.

    >>> import nsdc
    >>> file = nsdc.loads('''
    ...     model ball { param g : m/s^2 in [0, 100] = 9.81; state q[2] = [0, 1]; q' = [1, -g]; }
    ...     simulate falls of ball { horizon 1; }''')
    >>> q = file["falls"].states["q"]
    >>> q.shape, q.entries, q.value.tolist()
    ((2,), ['q[1]', 'q[2]'], [0.0, 1.0])
    """

    name: str
    #: Sizes: none for a scalar, one for a vector, two for a matrix.
    shape: tuple[int, ...]
    #: Its unit as it is declared.
    unit: str | None
    #: What the doc comment in front of it says.
    doc: str | None
    #: Its value in the experiment, of a state the initial one: a float, or an array of its shape; none where a run decides it.
    value: float | NDArray[np.float64] | None
    #: The least and the largest value that each entry may have.
    range: tuple[Any, Any]

    @property
    def entries(self) -> list[str]:
        """The names of its entries, a matrix row by row: `x`, or `x[1]`, `x[2]`, or `A[1,1]`, `A[1,2]`."""
        return entries(self.name, self.shape)

    def __repr__(self) -> str:
        unit = "" if self.unit is None else f" [{self.unit}]"
        value = "" if self.value is None else f" = {np.array2string(np.asarray(self.value))}"
        return f"{self.name}{value}{unit}"


def entries(name: str, shape: tuple[int, ...]) -> list[str]:
    """The names of the entries of a quantity, a matrix row by row."""
    if not shape:
        return [name]
    indices = np.ndindex(shape)
    return [f"{name}[{','.join(str(i + 1) for i in index)}]" for index in indices]


def named(argument: str, name: Any) -> str:
    """A name as the language compares it, in Unicode's form NFKC; `TypeError` where it is none."""
    if not isinstance(name, str):
        raise TypeError(f"{argument}: expected a name, got {name!r}")
    return name if name.isascii() else unicodedata.normalize("NFKC", name)


def plain_name(name: str) -> str:
    """A name in letters, digits and underscores of ASCII, which begins with a letter: `phi` of `φ`, `a` of `ä`."""

    def plain(letter: str) -> str:
        if letter == "_" or letter.isascii() and letter.isalnum():
            return letter
        words = unicodedata.name(letter, "_").split()
        if unicodedata.combining(letter) or not words[-1].isalpha():
            return "" if unicodedata.combining(letter) else "_"
        return words[-1].capitalize() if "CAPITAL" in words else words[-1].lower()

    found = "".join(map(plain, unicodedata.normalize("NFKD", name))).lstrip("_")
    return found if found[:1].isalpha() else f"x{found}"


def names(argument: str, all: Any) -> list[str]:
    """Names; `TypeError` where they are no list of such."""
    if isinstance(all, (str, bytes)) or not isinstance(all, Iterable):
        raise TypeError(f"{argument}: expected a list of names, got {all!r}")
    return [named(argument, name) for name in all]


def by_name(argument: str, values: Any) -> list[tuple[str, Any]]:
    """Values by names; `TypeError` where there are none."""
    if not isinstance(values, Mapping):
        raise TypeError(f"{argument}: expected values by name, got {values!r}")
    return [(named(argument, name), value) for name, value in values.items()]


class Quantities(Mapping[str, Quantity]):
    """Quantities by their names, in order of declaration; a table in a notebook.

    >>> import nsdc
    >>> decay = nsdc.loads("model decay { param k = 2; state x = 1; x' = -k*x; } simulate d of decay { horizon 1; }")["d"]
    >>> decay.parameters
    k = 2.
    """

    def __init__(self, described: list[dict[str, Any]]) -> None:
        self._all = {one["name"]: _quantity(one) for one in described}

    def __getitem__(self, name: str) -> Quantity:
        return self._all[named("name", name) if isinstance(name, str) else name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._all.values())) or "(none)"

    def _repr_html_(self) -> str:
        def row(one: Quantity) -> str:
            low, high = one.range
            bounds = "" if np.all(np.isinf([low, high])) else f"{low} to {high}"
            value = "" if one.value is None else one.value
            cells = [one.name, value, one.unit or "", bounds, one.doc or ""]
            return "".join(f"<td>{html.escape(str(cell))}</td>" for cell in cells)

        rows = "".join(f"<tr>{row(one)}</tr>" for one in self._all.values())
        heads = ["", "value", "unit", "range", ""]
        head = "".join(f"<th>{head}</th>" for head in heads)
        return f"<table><tr>{head}</tr>{rows}</table>"


def _quantity(one: dict[str, Any]) -> Quantity:
    shape = tuple(one["shape"])

    def shaped(values: list[float | None], missing: float) -> Any:
        """What is not finite is null in JSON, and nothing is known of some."""
        flat = [missing if value is None else value for value in values]
        return shaped_like(fixed(flat), shape) if flat else None

    value = shaped(one["value"], math.nan)
    bounds = (shaped(one["low"], -math.inf), shaped(one["high"], math.inf))
    bounds = (-math.inf, math.inf) if bounds[0] is None else bounds
    return Quantity(one["name"], shape, one["unit"], one["doc"], value, bounds)


def fixed(values: list[float]) -> NDArray[np.float64]:
    """A read-only array."""
    found = np.array(values, dtype=float)
    found.flags.writeable = False
    return found


def rows(
    values: Mapping[str, NDArray[np.float64]], name: str, behind: int = 0
) -> NDArray[np.float64]:
    """The rows of a quantity or of an entry of one, `x` or `x[1]`; the last axes, so many, are not of the quantity.

    `KeyError` where there is none of that name, and `TypeError` for what is no name."""
    name = named("name", name)
    if name in values:
        return values[name]
    match = ENTRY.match(name)
    if match and match["base"] in values:
        whole = values[match["base"]]
        axes = whole.ndim - behind
        names = entries(match["base"], whole.shape[1:axes])
        plain = re.sub(r"\s", "", name)
        if plain in names:
            flat = whole.reshape(len(whole), len(names), *whole.shape[axes:])
            return flat[:, names.index(plain)]
    raise KeyError(f"{name}; there are {', '.join(values)}")


def shaped_like(
    flat: NDArray[np.float64], shape: tuple[int, ...]
) -> float | NDArray[np.float64]:
    """Entries as a float, or as an array of a shape."""
    return float(flat[0]) if not shape else flat.reshape(shape)


def unknown(
    name: str, known: Iterable[str], settings: Iterable[str] = (), kind: str = GIVEN
) -> TypeError:
    """That a name is none of those that are known, which are of this kind."""
    known, all_known = list(known), [*known, *settings]
    close = difflib.get_close_matches(name, [one for one in all_known if one != name], n=1)
    help = f"did you mean `{close[0]}`?" if close else f"there are {', '.join(known) or 'none'}"
    return TypeError(f"`{name}` is no {kind}; {help}")


def finite(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The entries of a value for a quantity of a shape.

    Raises `TypeError` where it is no number or array of numbers, and `ValueError` where it has another shape or an entry that
    is not finite.
    """
    found = real(name, value)
    if found.shape != shape:
        expected = "a number" if not shape else f"an array of shape {shape}"
        raise ValueError(f"{name}: expected {expected}, got one of shape {found.shape}")
    if not np.all(np.isfinite(found)):
        raise ValueError(f"{name}: {value} is not finite")
    return found.reshape(-1)


def real(name: str, value: Any) -> NDArray[np.float64]:
    """An array of floating-point numbers; `TypeError` where it is none."""
    if value is None or isinstance(value, (str, bytes)):
        raise TypeError(f"{name}: expected a number, got {value!r}")
    if np.ma.is_masked(value):
        raise TypeError(f"{name}: expected numbers, got some that are masked")
    try:
        found = np.asarray(value)
    except ValueError:
        raise TypeError(f"{name}: expected numbers of one shape, got {value!r}") from None
    # Whole numbers of Python have any size.
    is_whole = found.dtype == object and all(type(one) is int for one in found.flat)
    if found.dtype.kind not in "biuf" and not is_whole:
        raise TypeError(f"{name}: expected numbers, got {type(value).__name__} of {found.dtype}")
    try:
        return found.astype(float)
    except OverflowError:
        raise ValueError(f"{name}: expected numbers that a float can hold, got one beyond 1.8e308") from None


def both(
    values: Mapping[str, Any], params: Mapping[str, Any] | None
) -> list[tuple[str, Any]]:
    """What is given by keywords, and by names."""
    return [*by_name("values", values), *by_name("params", {} if params is None else params)]


def given(
    known: Mapping[str, Quantity], values: Iterable[tuple[str, Any]], settings: Iterable[str] = ()
) -> list[tuple[str, float]]:
    """Values by the names of entries, of values by the names of quantities or of entries, each of which is given once."""
    found: dict[str, float] = {}
    for name, value in values:
        quantity = known.get(name)
        if quantity is None:
            pairs = [(entry(known, name, settings), float(finite(name, value, ())[0]))]
        elif type(value) is float and not quantity.shape and math.isfinite(value):
            pairs = [(name, value)]
        else:
            pairs = list(zip(quantity.entries, finite(name, value, quantity.shape).tolist()))
        for one, number in pairs:
            if one in found:
                raise TypeError(f"`{one}` is given twice")
            found[one] = number
    return list(found.items())


def entry(
    known: Mapping[str, Quantity], name: str, settings: Iterable[str] = (), kind: str = GIVEN
) -> str:
    """The name of an entry as it stands in the language; `TypeError` where there is none of that name."""
    match = ENTRY.match(name)
    quantity = known.get(match["base"]) if match else None
    plain = re.sub(r"\s", "", name)
    if quantity is None or plain not in quantity.entries:
        raise unknown(name, known, settings, kind)
    return plain


def count(name: str, value: Any, least: int) -> int | None:
    """A whole number from some least one on, or none; `TypeError` and `ValueError` name the argument."""
    if value is None:
        return None
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected a whole number, got {value!r}") from None
    if not least <= number < 2**63:
        raise ValueError(f"{name}: expected {least} or more, and less than 2^63, got {number}")
    return number


def flag(name: str, value: Any) -> bool:
    """Whether something holds; `TypeError` where it is neither true nor false."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name}: expected True or False, got {value!r}")
    return bool(value)
