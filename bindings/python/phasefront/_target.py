"""The target that holograms are made for."""

from __future__ import annotations

from . import _ffi


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
