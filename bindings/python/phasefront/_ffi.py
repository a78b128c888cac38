"""What is generated, with its documents, and its fields where it is shown. `_ffi.pyi` has its types."""

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
        # That of a dataclass knows no fields here, for what is generated declares none.
        _described.__repr__ = _described.__str__
