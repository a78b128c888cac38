"""A bench of an SLM and a camera of slmsuite (https://slmsuite.readthedocs.io)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy
from numpy.typing import NDArray

from ._serve import Photograph, Request

#: The share of the camera's range that the brightest pixels shall have, at least and at most.
_EXPOSED = 0.45, 0.85
#: The share of pixels that may be brighter, because they are hot; the command allows as many in the photograph of a spot.
_HOT = 1e-5
#: How often the exposure changes at most.
_STEPS = 20


class Bench:
    """Shows levels on an SLM and photographs them, for `phasefront_capture.serve`.

    Args:
        slm: Any SLM of slmsuite. It gets levels, not phases, so its phase scaling and correction are not used.
        camera: Any camera of slmsuite. Its tone curve must be linear.
        switch: Switches on the laser of a request, and focuses the camera if its z changes. None for one laser and a
            fixed camera.
        frames: The number of frames that a photograph is the mean of, against noise.
    """

    def __init__(self, slm: Any, camera: Any, switch: Callable[[Request], object] | None = None, frames: int = 1):
        self._slm, self._camera, self._switch, self._frames = slm, camera, switch, frames

    def __call__(self, levels: NDArray[numpy.uint8], request: Request) -> Photograph:
        if levels.shape != tuple(self._slm.shape):
            raise ValueError(f"the pattern is {levels.shape}, the SLM {tuple(self._slm.shape)}; the display's file has another size")
        if self._switch is not None:
            self._switch(request)
        exposure_s = request.settings.get("exposure_s")
        if exposure_s is not None and exposure_s != self._camera.get_exposure():
            self._camera.set_exposure(exposure_s)
        # Integers of the display's type are shown as they are. With more bits, the upper ones are the levels.
        shown = levels.astype(self._slm.display.dtype) << max(0, self._slm.bitdepth - 8)
        self._slm.set_phase(shown, settle=True)
        image = self._photograph()
        for _ in range(_STEPS if request.expose else 0):
            brightest = 1 + int(_HOT * image.size)
            bright = numpy.partition(image.ravel(), -brightest)[-brightest] / (2**self._camera.bitdepth - 1)
            if _EXPOSED[0] <= bright <= _EXPOSED[1]:
                break
            before = self._camera.get_exposure()
            # A saturated image does not tell by how much.
            factor = 0.5 if bright > 0.99 else 0.65 / max(bright, 0.04)
            self._camera.set_exposure(before * factor)
            image = self._photograph()
            if self._camera.get_exposure() == before:
                break
        return Photograph(self._aligned(image), {"exposure_s": float(self._camera.get_exposure())})

    def _photograph(self) -> NDArray[Any]:
        """Returns the mean of frames, in the camera's numbers."""
        self._camera.flush()
        # The camera's own averaging is a sum, and its HDR has no fixed range.
        frames = [numpy.asarray(self._camera.get_image(hdr=False, averaging=False)) for _ in range(self._frames)]
        return frames[0] if len(frames) == 1 else numpy.mean(frames, axis=0)

    def _aligned(self, image: NDArray[Any]) -> NDArray[Any]:
        """Returns an image as uint8, or as uint16 with its bits at the upper end."""
        bits = self._camera.bitdepth
        whole = numpy.clip(numpy.rint(image), 0, 2**bits - 1).astype(numpy.uint16)
        aligned: NDArray[Any] = (whole << (8 - bits)).astype(numpy.uint8) if bits <= 8 else whole << (16 - bits)
        return aligned
