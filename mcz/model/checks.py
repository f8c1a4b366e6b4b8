"""Checks of fields of the data model, arguments, parameters of codecs, and indices of rows."""

from __future__ import annotations

import inspect
import math
import operator
import os
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from functools import partial, wraps
from itertools import chain
from numbers import Real
from types import MappingProxyType
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from mcz.errors import MotionError, OptionError, OutOfRangeError
from mcz.model.types import Ints, Items


class Rule(NamedTuple):
    """A form of a field in words, and the function that converts to it; TypeError or ValueError."""

    words: str
    form: Callable[[Any], Any]


def check_fields(instance: object, rules: Mapping[str, Rule]) -> None:
    """Convert fields of a frozen dataclass by their rules; MotionError names the field."""
    for name, rule in rules.items():
        value = getattr(instance, name)
        try:
            converted = rule.form(value)
        except (TypeError, ValueError, OverflowError, AttributeError):
            kind = type(instance).__name__.lower()
            text = " ".join(reprlib.repr(value).split())  # in one line
            raise MotionError(f"{kind}: {name} is {text}; it must be {rule.words}") from None
        if converted is not value:
            object.__setattr__(instance, name, converted)


class ArgumentType(NamedTuple):
    """A type of arguments in words, and its test."""

    words: str
    accepts: Callable[[object], bool]


def _are_all(accepts: Callable[[object], bool], values: object) -> bool:
    if isinstance(values, (str, bytes, Mapping)) or not isinstance(values, Iterable):
        return False
    return not isinstance(values, Collection) or all(map(accepts, values))


def _is_file(value: object) -> bool:
    return isinstance(value, (str, os.PathLike, bytes)) or hasattr(value, "read")


def _are_numbers(values: object) -> bool:
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # rows of different lengths
        return False
    return array.ndim > 0 and array.dtype.kind in "biuf"


def _is_number(value: object) -> bool:
    return isinstance(value, (Real, np.number)) and not isinstance(value, bool)


def _is_integer(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _are_frames(value: object) -> bool:
    if not isinstance(value, (tuple, list, np.ndarray)) or len(value) != 2:
        return isinstance(value, slice)
    return all(end is None or _is_integer(end) for end in value)


def _is_dtype(value: Any) -> bool:
    try:
        return bool(np.dtype(value))
    except (TypeError, ValueError):
        return False


PATH = ArgumentType("a path", lambda value: isinstance(value, (str, os.PathLike)))
PATHS = ArgumentType("a list of paths", partial(_are_all, PATH.accepts))
FILES = ArgumentType("a list of paths, bytes or streams", partial(_are_all, _is_file))
STRING = ArgumentType("a string", lambda value: isinstance(value, str))
MAPPING = ArgumentType("a dict", lambda value: isinstance(value, Mapping))
NAMES = ArgumentType("a name or a list of names", lambda value: isinstance(value, Iterable))
JOINTS = ArgumentType(
    "a joint or a list of joints, each a name or an index",
    lambda value: isinstance(value, (str, int, np.integer, Iterable)),
)
ITEM = ArgumentType("a name or an index", lambda value: isinstance(value, (str, int, np.integer)))
AXIS = ArgumentType("x, y, z, -x, -y or -z", lambda value: value in "x y z -x -y -z".split())
FRAMES = ArgumentType("a pair of integers (a, b), or a slice", _are_frames)
NUMBERS = ArgumentType("an array of numbers", _are_numbers)
REAL = ArgumentType("a number", _is_number)
WHOLE = ArgumentType("an integer", _is_integer)
SIZE = ArgumentType(
    "a pair of integers",
    lambda value: isinstance(value, (tuple, list)) and [*map(_is_integer, value)] == [True] * 2,
)
DTYPE = ArgumentType("a type of numbers, such as float32", _is_dtype)

USUAL_TYPES: Mapping[str, ArgumentType] = {
    **dict.fromkeys("unit up up_axis codec effort arrays theme view form order".split(), STRING),
    **dict.fromkeys("axis what turns space software by rest profile".split(), STRING),
    **dict.fromkeys("params info metadata pairs joint_map".split(), MAPPING),
    **dict.fromkeys("names clip clips match_rest fields channels codecs".split(), NAMES),
    **dict.fromkeys("scale shell_cm key_error_mm redundancy speed unit_cm".split(), REAL),
    **dict.fromkeys("window stride sheet repeat max_decoded resolution".split(), WHOLE),
    **dict.fromkeys("folder root".split(), PATH),
    **dict.fromkeys("offsets translations bone_lengths betas".split(), NUMBERS),
    "joints": JOINTS,
    "joint": ITEM,
    "signal": ITEM,
    "size": SIZE,
    "dtype": DTYPE,
}
"""Types of arguments that mean the same in all public functions."""

P = ParamSpec("P")
T = TypeVar("T")


def check_arguments(**types: ArgumentType) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorate a public function: OptionError for an argument that is not of its type.

    ``types`` come before USUAL_TYPES. The default, and None if annotated, are accepted.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        parameters = inspect.signature(function).parameters
        known = {name: USUAL_TYPES[name] for name in USUAL_TYPES.keys() & parameters} | types
        optional = {name for name in known if "None" in str(parameters[name].annotation)}

        @wraps(function)
        def checking(*args: P.args, **kwargs: P.kwargs) -> T:
            for name, value in chain(zip(parameters, args, strict=False), kwargs.items()):
                if name not in known or value is parameters[name].default:
                    continue
                if not (known[name].accepts(value) or (value is None and name in optional)):
                    text = " ".join(reprlib.repr(value).split())
                    raise OptionError(f"{name} is {text}; it must be {known[name].words}")
            return function(*args, **kwargs)

        return checking

    return decorate


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return str(value)


def _name(value: object) -> str:
    text = _text(value)
    text.encode()  # half a surrogate pair raises UnicodeEncodeError, a ValueError
    return text


def _integer(value: Any) -> int:
    if isinstance(value, (bool, np.bool_)):
        raise TypeError
    return operator.index(value)


def _to_bool(value: object) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError
    return bool(value)


def _data(value: object) -> bytes:
    if not isinstance(value, (bytes, bytearray, memoryview)):
        raise TypeError
    return bytes(value)


def _hash(value: object) -> bytes:
    data = _data(value)
    if len(data) not in (0, 32):
        raise ValueError
    return data


def _number(value: Any) -> float:
    if isinstance(value, (str, bytes, bool, np.bool_, np.ndarray)):
        raise TypeError
    number = float(value)
    if not math.isfinite(number):  # SKEL-08
        raise ValueError
    return number


def _vector(value: Any) -> tuple[float, float, float]:
    x, y, z = map(_number, value)
    return x, y, z


def _texts(value: object) -> tuple[bytes, ...]:
    return tuple(map(_data, _items(value)))


def _text_map(value: object) -> Mapping[str, str]:
    if not isinstance(value, Mapping):
        raise TypeError
    for pair in value.items():
        list(map(_text, pair))
    return value


def _items(value: object) -> tuple[object, ...]:
    if isinstance(value, tuple):
        return value
    if not isinstance(value, list):
        raise TypeError
    return tuple(value)


def of_type(kind: type | tuple[type, ...], words: str) -> Rule:
    """The rule of a field that is a ``kind``."""

    def form(value: object) -> object:
        if not isinstance(value, kind):
            raise TypeError
        return value

    return Rule(words, form)


def one_of(choices: Collection[str]) -> Rule:
    """The rule of a field that is one of ``choices``."""

    def form(value: object) -> str:
        if value not in choices:
            raise ValueError
        return str(value)

    return Rule(f"one of {', '.join(filter(None, choices))}", form)


def several(rule: Rule, words: str) -> Rule:
    """The rule of a tuple or list whose items follow another rule."""

    def form(value: object) -> tuple[object, ...]:
        items = _items(value)
        formed = tuple(map(rule.form, items))
        is_unchanged = items is value and all(map(operator.is_, formed, items))
        return items if is_unchanged else formed

    return Rule(words, form)


def optional(rule: Rule) -> Rule:
    """The rule of a field that may also be None."""
    return Rule(f"{rule.words} or None", lambda value: None if value is None else rule.form(value))


def array_of(kinds: str, n_dimensions: int, words: str) -> Rule:
    """The rule of an array of types such as "f8", in the byte order and memory layout of C.

    A masked array counts as one only if nothing is masked.
    """

    def form(value: object) -> Items:
        if type(value) is not np.ndarray and np.ma.is_masked(value):  # imports numpy.ma
            raise ValueError
        array = np.asarray(value)
        if f"{array.dtype.kind}{array.dtype.itemsize}" not in kinds.split():
            raise TypeError
        if array.ndim != n_dimensions:
            raise ValueError
        return contiguous(array)

    return Rule(words, form)


def contiguous(array: Items) -> Items:
    """``array`` in the byte order of the machine, aligned and in C order; itself if it is."""
    flags = array.flags
    if array.dtype.isnative and flags.c_contiguous and flags.aligned:
        return array
    return np.array(array, array.dtype.newbyteorder("="), order="C")


TEXT, INTEGER, TRUTH = Rule("text", _text), Rule("an integer", _integer), Rule("a bool", _to_bool)
NAME = Rule("text that UTF-8 can hold", _name)
DATA, HASH = Rule("bytes", _data), Rule("32 bytes or none", _hash)
NUMBER = Rule("a finite number", _number)
VECTOR = Rule("three finite numbers", _vector)
TEXT_MAP = Rule("text to text", _text_map)
DATA_ITEMS = Rule("several bytes", _texts)


def in_range(text: str, parse: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Attach ``text``, the range in words, to ``parse``."""
    parse.range = text  # type: ignore[attr-defined]
    return parse


def integer(name: str, low: int, high: int) -> Callable[[Any], int]:
    """A parser of integers from ``low`` to ``high``."""

    def parse(text: Any) -> int:
        try:
            value = int(text)
            if isinstance(text, bool) or (isinstance(text, float) and value != text):
                raise ValueError
        except (TypeError, ValueError, OverflowError):
            raise OptionError(f"{name} is {text!r}; it must be an integer") from None
        if not low <= value <= high:
            raise OptionError(f"{name} is {value}; it must be {low} to {high}", value=value)
        return value

    return in_range(f"{low:,} to {high:,}", parse)


def number(name: str, low: float, high: float) -> Callable[[Any], float]:
    """A parser of numbers from ``low`` to ``high``."""

    def parse(text: Any) -> float:
        try:
            if isinstance(text, bool):
                raise ValueError
            value = float(text)
        except (TypeError, ValueError, OverflowError):
            raise OptionError(f"{name} is {text!r}; it must be a number") from None
        if not low <= value <= high:
            raise OptionError(f"{name} is {value}; it must be {low:g} to {high:g}", value=value)
        return value

    return in_range(f"{low:g} to {high:g}", parse)


def choice(
    name: str, among: tuple[str, ...], formerly: Mapping[str, str] = MappingProxyType({})
) -> Callable[[Any], str]:
    """A parser of one word of several; ``formerly`` maps words of older files to present ones."""

    def parse(text: Any) -> str:
        if isinstance(text, str):
            text = formerly.get(text, text)
        if text not in among:
            raise OptionError(f"{name} is {text!r}; it must be one of {', '.join(among)}")
        return str(text)

    return in_range(", ".join(among), parse)


Rows = int | range | Ints


def row_numbers(key: Any, n_rows: int, noun: str) -> Rows:
    """The rows among ``n_rows`` that ``key`` chooses, each 0 <= row < n_rows.

    An int for an integer, a range for a slice, otherwise int64 of the shape of the index; for a
    mask (bool, (n_rows,)) the numbers of its True entries. ``noun`` names a row in messages. Raises
    OutOfRangeError, which is also an IndexError.
    """
    if key is Ellipsis:
        key = slice(None)
    if isinstance(key, slice):
        try:
            return range(n_rows)[key]
        except (TypeError, ValueError) as error:
            raise OutOfRangeError(f"{noun}s {key}: {error}") from None
    if not isinstance(key, (bool, np.bool_)):
        with suppress(TypeError):  # not an integer
            return _single(operator.index(key), n_rows, noun)
    try:
        array = np.asarray(key)
    except ValueError:  # lists of different lengths
        raise OutOfRangeError(f"{noun}s cannot be indexed with {key!r}") from None
    if array.dtype == np.bool_:
        if array.shape not in ((n_rows,), (0,)):  # NumPy takes an empty mask of any axis
            raise OutOfRangeError(f"a mask of shape {array.shape} does not fit {n_rows} {noun}s")
        return np.flatnonzero(array)
    if array.size == 0 and not isinstance(key, np.ndarray):
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu":
        raise OutOfRangeError(
            f"index {noun}s with integers, slices or a mask, not with {array.dtype}"
        )
    wrong = array[(array < -n_rows) | (array >= n_rows)]
    if wrong.size:
        raise OutOfRangeError(f"{noun} {wrong[0]} is out of range; there are {n_rows}")
    numbers = array.astype(np.int64)
    return np.where(numbers < 0, numbers + n_rows, numbers)


def _single(number: int, n_rows: int, noun: str) -> int:
    if not -n_rows <= number < n_rows:
        raise OutOfRangeError(f"{noun} {number} is out of range; there are {n_rows}")
    return number % n_rows


def merged_ranges(ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Sort ranges, and join those that touch.

    >>> merged_ranges([(8, 9), (0, 4), (4, 6)])
    [(0, 6), (8, 9)]
    """
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(ranges):
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(stop, merged[-1][1])
        else:
            merged.append((start, stop))
    return merged
