"""The target that holograms are made for."""

from __future__ import annotations

from typing import Any, TypeAlias

from . import _ffi
from ._ffi import Display, SettingError
from ._take import MEANT, shown


class Target(_ffi.Target):
    __doc__ = _ffi.Target.__doc__

    #: The table of `with_look_up_table`.
    _table: bytes | None = None
    #: Whether the target holds more than the metadata of a hologram's file.
    _calibrated = True

    @classmethod
    def of_display(cls, display: _ffi.Display) -> Target:
        """Creates a target whose levels are equal steps of phase, as many as the display's bits allow.

        Errors: An impossible display.
        """
        target = super().of_display(display)
        assert isinstance(target, cls)
        target._calibrated = False
        return target

    @classmethod
    def with_look_up_table(cls, display: _ffi.Display, levels: bytes) -> Target:
        """Creates a target whose modulator was calibrated as a whole: the i-th of 256 levels has the phase 2πi/256.

        Errors: An impossible display, or another number of levels.
        """
        target = super().with_look_up_table(display, levels)
        assert isinstance(target, cls)
        target._calibrated, target._table = False, bytes(levels)
        return target

    def __repr__(self) -> str:
        return f"Target({self.display()})"


class Modulated:
    """Whatever has a target: `Modulator`."""

    target: _ffi.Target


#: What stands for a target: itself, a display, a modulator or its name.
Targeted: TypeAlias = _ffi.Target | Display | Modulated | str


def target_of(value: Any) -> _ffi.Target:
    """Returns the target that `value` is or stands for; for None, the display of 1920×1080.

    Raises `DisplayError` for an impossible display or an unknown modulator, and `SettingError` for anything else.
    """
    if isinstance(value, _ffi.Target):
        return value
    if isinstance(value, Modulated):
        return value.target
    if isinstance(value, str):
        return _ffi.RawModulator.named(value).target()
    if value is None or isinstance(value, Display):
        return Target.of_display(Display() if value is None else value)
    raise SettingError(f"target is {shown(value)}; a Display, a Target, a Modulator or the name of a modulator is right")


MEANT[_ffi.Target] = target_of
