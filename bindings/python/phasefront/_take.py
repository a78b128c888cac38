"""Takes what is plainly meant for a value that the library needs, and refuses everything else in one line."""

from __future__ import annotations

import enum
import functools
import inspect
import operator
import os
import types
import typing
from collections.abc import Callable
from typing import Any

from .ffi import phasefront_ffi as _generated


class _Count(int):
    """A number of pixels, steps and the like, which is not negative."""


#: The types that the generated annotations name.
_NAMES = vars(_generated) | {"Int": _Count}
#: Functions that return what a value stands for where a class is needed, or the value itself.
MEANT: dict[type, Callable[[Any], Any]] = {}
#: The records whose fields are checked, besides those that only the library makes.
_RECORDS: set[type] = set()


def shown(value: object) -> str:
    """Returns a value in one short line."""
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"an array of {value.dtype}, {tuple(value.shape)}"
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}…"


def _refused(what: str, value: object, right: str) -> Exception:
    error: Exception = _generated.SettingError(f"{what} is {shown(value)}; {right} is right")
    return error


def _number(what: str, value: Any, kind: type) -> Any:
    """Returns a number as an `int` or a `float`."""
    least = "0 or more" if kind is _Count else "more"
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        if kind is float:
            return float(value)
        number = operator.index(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        raise _refused(what, value, "a number" if kind is float else "a whole number") from None
    if kind is _Count and not 0 <= number < 2**31:
        raise _refused(what, value, f"a whole number of {least}, below 2147483648,")
    return number


def _member(what: str, value: Any, kind: type[enum.Enum]) -> Any:
    """Returns a member of an enumeration, which may be given by name."""
    if isinstance(value, kind):
        return value
    names = {member.name: member for member in kind}
    name = value.upper().replace("-", "_") if isinstance(value, str) else None
    if name in names:
        return names[name]
    raise _refused(what, value, f"{kind.__name__}.{', '.join(names)}")


def take(what: str, value: Any, kind: Any) -> Any:
    """Returns `value`, the argument or field `what`, as the type `kind`.

    Raises `SettingError` if it is not of that type and does not plainly stand for one.
    """
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in inner:
            return None
        # An argument with a default value is annotated as a union with `object`.
        (kind,) = [of for of in inner if of not in (object, type(None))]
        return take(what, value, kind)
    if origin is list:
        try:
            values = list(value)
        except TypeError:
            raise _refused(what, value, "a list") from None
        return [take(f"{what}[{i}]", one, inner[0]) for i, one in enumerate(values)]
    if kind in (int, float, _Count):
        return _number(what, value, kind)
    if kind is bool:
        if not isinstance(value, bool) and getattr(getattr(value, "dtype", None), "kind", "") != "b":
            raise _refused(what, value, "True or False")
        return bool(value)
    if kind is str:
        if not isinstance(value, (str, os.PathLike)):
            raise _refused(what, value, "text")
        return os.fspath(value)
    if not isinstance(kind, type) or kind is bytes:
        return value
    if issubclass(kind, enum.Enum):
        return _member(what, value, kind)
    value = MEANT[kind](value) if kind in MEANT else value
    if not isinstance(value, kind):
        raise _refused(what, value, f"a {kind.__name__}")
    # Fields may have been set since.
    return kind(**vars(value)) if kind in _RECORDS else value


def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a generated function that takes its arguments by `take`."""
    signature = inspect.signature(function)
    hints = typing.get_type_hints(function, _NAMES)
    names = list(signature.parameters)

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        values = [take(name, value, hints[name]) if name in hints else value for name, value in zip(names, given)]
        # Python names missing and unknown arguments.
        rest = given[len(values) :]
        return function(*values, *rest, **{name: take(name, value, hints[name]) if name in hints else value for name, value in named.items()})

    return call


def _cannot_copy(self: object, protocol: object = None) -> typing.NoReturn:
    raise _generated.SettingError(
        f"a {type(self).__name__} holds memory of the library, which cannot be copied or pickled; make one in each process"
    )


def forbid_copies(kind: type) -> None:
    """Lets `copy` and `pickle` refuse the objects of a class, whose memory another owns."""
    for name in ("__reduce_ex__", "__reduce__", "__copy__", "__deepcopy__"):
        setattr(kind, name, _cannot_copy)


def _has_constructors(self: object, *_: object, **__: object) -> None:
    ways = [name for name, function in vars(type(self)).items() if isinstance(function, classmethod) and not name.startswith("_")]
    raise _generated.SettingError(f"a {type(self).__name__} is made by {', '.join(ways) or 'the library'}")


def install(records: list[str]) -> None:
    """Lets the generated module take what is plainly meant, in its functions, methods, and these records, and lets its
    objects refuse copies."""
    for name, thing in list(vars(_generated).items()):
        if name.startswith("_") or getattr(thing, "__module__", "") != _generated.__name__:
            continue
        if inspect.isfunction(thing):
            setattr(_generated, name, _checked(thing))
        elif not inspect.isclass(thing):
            continue
        elif hasattr(thing, "_uniffi_clone_handle"):
            forbid_copies(thing)
            if inspect.signature(thing.__init__).parameters.keys() == {"self", "args", "kwargs"}:
                setattr(thing, "__init__", _has_constructors)
            for method, function in list(vars(thing).items()):
                if method.startswith("_") and (method != "__init__" or function is _has_constructors):
                    continue
                if isinstance(function, classmethod):
                    setattr(thing, method, classmethod(_checked(function.__func__)))
                elif inspect.isfunction(function):
                    setattr(thing, method, _checked(function))
        elif name in records:
            _RECORDS.add(thing)
            setattr(thing, "__init__", _checked(thing.__init__))
        else:
            for kind in [inner for key, inner in vars(thing).items() if key.isupper() and inspect.isclass(inner)]:
                setattr(kind, "__init__", _checked(kind.__init__))
    forbid_copies(_generated.RawMemory)
