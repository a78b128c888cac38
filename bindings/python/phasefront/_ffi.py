"""What is generated, with its documents. `_ffi.pyi` has its types."""

from ._documents import DOCUMENTS as _DOCUMENTS
from .ffi import phasefront_ffi as _generated
from .ffi.phasefront_ffi import *  # noqa: F403

for _name, _document in _DOCUMENTS.items():
    _described = _generated
    for _part in _name.split("."):
        _described = getattr(_described, _part)
    getattr(_described, "__func__", _described).__doc__ = _document
