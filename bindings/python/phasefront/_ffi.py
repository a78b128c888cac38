"""The generated module with the names of Python, docstrings, and fields in its representations. `_ffi.pyi` declares its
types."""

import dataclasses as _dataclasses
from typing import Any as _Any

from . import _display, _meant, _take  # noqa: F401
from ._documents import DOCUMENTS as _DOCUMENTS
from .ffi import phasefront_ffi as _generated
from .ffi.phasefront_ffi import *  # noqa: F403


def _rename_errors() -> None:
    """Makes a kind of error, generated as PhasefrontError.Frame, a class of its own: FrameError."""
    for kind in list(vars(_generated.PhasefrontError).values()):
        if isinstance(kind, type):
            kind.__name__ = kind.__qualname__ = f"{kind.__name__}Error"
            kind.__module__, kind.__repr__ = "phasefront", Exception.__repr__
            setattr(_generated, kind.__name__, kind)
            globals()[kind.__name__] = kind


def _rename_values(owner: type) -> None:
    """Makes a kind of value with fields, generated as Method.TRAINED, a name in lower case: Method.trained."""
    for name, kind in list(vars(owner).items()):
        if name.isupper() and isinstance(kind, type):
            shown = f"{owner.__name__}.{name.lower()}"

            def show(value: object, shown: str = shown) -> str:
                return f"{shown}({', '.join(f'{field}={inner!r}' for field, inner in vars(value).items())})"

            named: _Any = kind
            named.__str__ = named.__repr__ = show
            setattr(owner, name.lower(), kind)


def _show_network(self: _Any) -> str:
    info = self.info()
    return f"Network(layers={info.layers}, filters={info.filters}, precision={info.precision!r})"


_rename_errors()
_generated.Network.__repr__ = _show_network
_take.install(
    ["Cameras", "Display", "EncoderOptions", "Intrinsics", "Orientation", "Placement", "Pose", "QualityLevel", "SessionOptions"]
)
_display.install()
for _name in _generated.__all__:
    globals()[_name] = getattr(_generated, _name)
for _owner in list(vars(_generated).values()):
    if isinstance(_owner, type):
        _rename_values(_owner)
for _name, _document in _DOCUMENTS.items():
    _described = _generated
    for _part in _name.split("."):
        _described = getattr(_described, _part)
    getattr(_described, "__func__", _described).__doc__ = _document
    if _dataclasses.is_dataclass(_described) and "." not in _name:
        # The dataclass representation shows no fields, because the generated code declares none.
        _described.__repr__ = _described.__str__
