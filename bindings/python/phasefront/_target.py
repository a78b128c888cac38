"""What holograms are made for."""

from __future__ import annotations

from . import _ffi


class Target(_ffi.Target):
    __doc__ = _ffi.Target.__doc__

    #: The table of `with_look_up_table`.
    _table: bytes | None = None
    #: Whether there is more to it than what a hologram's file says.
    _calibrated = True

    @classmethod
    def of_display(cls, display: _ffi.Display) -> Target:
        """A display with levels in equal steps of phase, as many as its bits have.

        Errors: A display that cannot be.
        """
        target = super().of_display(display)
        assert isinstance(target, cls)
        target._calibrated = False
        return target

    @classmethod
    def with_look_up_table(cls, display: _ffi.Display, levels: bytes) -> Target:
        """A display whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase 2πi/256.

        Errors: A display that cannot be, or another number of levels.
        """
        target = super().with_look_up_table(display, levels)
        assert isinstance(target, cls)
        target._calibrated, target._table = False, bytes(levels)
        return target
