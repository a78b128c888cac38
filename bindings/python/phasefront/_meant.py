"""What numbers, pairs, names and networks stand for where the library needs a value with fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ._take import MEANT
from .ffi import phasefront_ffi as _generated


def _method(value: Any) -> Any:
    if isinstance(value, _generated.Network):
        return _generated.Method.TRAINED(network=value)
    return _named(value, {
        "auto": _generated.Method.AUTO,
        "sweep": _generated.Method.SWEEP,
        "network": lambda: _generated.Method.TRAINED(network=_generated.Network.built_in()),
    })  # fmt: skip


def _encoding(value: Any) -> Any:
    return _named(value, {
        "double-phase": _generated.Encoding.DOUBLE_PHASE,
        "anti-alias": lambda: _generated.Encoding.ANTI_ALIAS(sigma=0.7, width=3),
        "band-limit": lambda: _generated.Encoding.BAND_LIMIT(k=1.0),
    })  # fmt: skip


def _brightness(value: Any) -> Any:
    if _is_number(value):
        return _generated.Brightness.FIXED(scale=value)
    return _named(value, {"smoothed": _generated.Brightness.SMOOTHED, "frame-max": _generated.Brightness.FRAME_MAX})


def _focus(value: Any) -> Any:
    return _named(value, {"coherent": _generated.Focus.COHERENT, "natural": lambda: _generated.Focus.NATURAL(steps=0)})


def _depth_range(value: Any) -> Any:
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return _generated.DepthRange.FIXED(near_m=value[0], far_m=value[1])
    return _named(value, {"percentiles": _generated.DepthRange.PERCENTILES})


def _quality(value: Any) -> Any:
    if _is_number(value):
        return _generated.Quality.FIXED(quality_level=value)
    return _named(value, {"adaptive": _generated.Quality.ADAPTIVE})


def _is_number(value: Any) -> bool:
    return not isinstance(value, (bool, str)) and hasattr(value, "__float__") and getattr(value, "ndim", 0) == 0


def _named(value: Any, kinds: dict[str, Callable[[], Any]]) -> Any:
    """Returns the value that a name stands for, or `value` if it is no name.

    Raises `SettingError` for any other name.
    """
    if not isinstance(value, str):
        return value
    name = value.lower().replace("_", "-")
    if name not in kinds:
        raise _generated.SettingError(f"there is no {value!r}; there are {', '.join(kinds)}")
    return kinds[name]()


MEANT[_generated.Method] = _method
MEANT[_generated.Encoding] = _encoding
MEANT[_generated.Brightness] = _brightness
MEANT[_generated.Focus] = _focus
MEANT[_generated.DepthRange] = _depth_range
MEANT[_generated.Quality] = _quality
