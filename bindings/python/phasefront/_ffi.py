"""The generated module with docstrings, and with fields in its representations. `_ffi.pyi` declares its types."""

import dataclasses as _dataclasses

from ._documents import DOCUMENTS as _DOCUMENTS
from .ffi import phasefront_ffi as _generated
from .ffi.phasefront_ffi import *  # noqa: F403

for _name, _document in _DOCUMENTS.items():
    _described = _generated
    for _part in _name.split("."):
        _described = getattr(_described, _part)
    getattr(_described, "__func__", _described).__doc__ = _document
    if _dataclasses.is_dataclass(_described):
        # The dataclass representation shows no fields, because the generated code declares none.
        _described.__repr__ = _described.__str__
