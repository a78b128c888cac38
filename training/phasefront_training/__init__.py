"""Training of the networks of Phasefront: data, two stages, quantization, export, evaluation."""

from .pretrained import from_pretrained

__all__ = ["from_pretrained"]
