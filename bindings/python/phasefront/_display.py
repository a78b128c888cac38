"""Displays by the wavelengths of their lasers and by the names of their modulators."""

from __future__ import annotations

import functools
import inspect
from typing import Any

from ._take import take
from .ffi import phasefront_ffi as _generated

_THREE = ("red_nm", "green_nm", "blue_nm")


def _wavelengths(values: Any, fields: dict[str, Any]) -> dict[str, float]:
    """Returns the fields of a display that its wavelengths stand for."""
    known = [name for name in (*_THREE, "laser_nm") if name in fields]
    if known:
        raise _generated.SettingError(f"both wavelengths_nm and {known[0]} are given; either is right")
    nm = take("wavelengths_nm", values, list[float])
    if len(nm) not in (1, 3):
        raise _generated.SettingError(f"wavelengths_nm has {len(nm)} numbers; red, green and blue are right, or one laser")
    return dict(zip(_THREE, nm)) if len(nm) == 3 else {"laser_nm": nm[0]}


def install() -> None:
    """Adds `wavelengths_nm` and `named` to the generated class."""
    display: Any = _generated.Display
    generated = display.__init__

    @functools.wraps(generated)
    def start(self: Any, *, wavelengths_nm: Any = None, **fields: Any) -> None:
        if wavelengths_nm is not None:
            fields |= _wavelengths(wavelengths_nm, fields)
        generated(self, **fields)

    signature = inspect.signature(generated)
    added = inspect.Parameter("wavelengths_nm", inspect.Parameter.KEYWORD_ONLY, default=None)
    start.__signature__ = signature.replace(parameters=[*signature.parameters.values(), added])  # type: ignore[attr-defined]

    def wavelengths_nm(self: Any) -> list[float]:
        """The wavelengths of the lasers in nm: red, green and blue, or that of the only one."""
        return [getattr(self, name) for name in _THREE] if self.laser_nm is None else [self.laser_nm]

    def named(cls: Any, name: str) -> Any:
        """Returns the display of one of the modulators that `modulator_names` lists. The name itself, as the target of a
        session, also has the phases of the modulator's levels.

        Raises `DisplayError` for any other name.
        """
        return _generated.RawModulator.named(name).target().display()

    display.__init__ = start
    display.wavelengths_nm = property(wavelengths_nm)
    display.named = classmethod(named)
