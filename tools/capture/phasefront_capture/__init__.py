"""Shows and photographs the patterns of `phasefront calibrate`.

A program that drives your modulator and camera calls `serve` with one function:

    import phasefront_capture

    def take(levels, request):
        ...  # show the levels, uint8, (H, W), and return the photograph, uint8 or uint16, (H, W)

    phasefront_capture.serve(take)

and `phasefront calibrate lut … --capture python bench.py` runs it. `phasefront_capture.slmsuite.Bench` is such a
function for every SLM and camera of slmsuite.
"""

from ._serve import Photograph, Request, serve

__all__ = ["Photograph", "Request", "serve"]
