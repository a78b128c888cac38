"""A bench of slmsuite's simulated SLM and camera, with a second lens: `python relay.py UNIT` answers `phasefront calibrate`.

slmsuite's camera is in the Fourier plane of its SLM. Here it is behind that plane's aperture and a second lens, so that
it sees the modulator, or a plane in front of it. The lasers take turns. Liquid crystal and lenses delay all of them by
the same path, so that phases go with 1/wavelength.
"""

import sys
import warnings

import numpy
from slmsuite.hardware.cameras.simulated import SimulatedCamera
from slmsuite.hardware.slms.simulated import SimulatedSLM
from slmsuite.holography.algorithms import Hologram

import phasefront_capture
from phasefront_capture.slmsuite import Bench

SIZE = 144, 72
PITCH_UM = 8.0
WAVELENGTH_NM = 532
ZOOM = 2

#: Units: the range in turns, the S shape and the bow of their phase curves, and their aberration in rad, at 532 nm.
UNITS = {
    "one": (1.2, 0.35, 0.15, (0.9, -0.6, 0.4, 0.5, -0.7)),
    "two": (1.45, -0.3, -0.2, (-0.4, 0.5, 0.5, -0.4, 0.3)),
    "of three lasers": (1.2, 0.35, 0.15, (0.5, -0.4, 0.3, 0.3, -0.4)),
}


def curve(unit: str, wavelength_nm: float = WAVELENGTH_NM) -> numpy.ndarray:
    """Returns the phase of each level of a unit, in radians."""
    turns, steepness, bow, _ = UNITS[unit]
    t = numpy.arange(256) / 255
    return WAVELENGTH_NM / wavelength_nm * 2 * numpy.pi * turns * (t - steepness * numpy.sin(2 * numpy.pi * t) / (2 * numpy.pi) + bow * t * (1 - t))


def laser() -> numpy.ndarray:
    """Returns the laser's amplitude on the modulator."""
    y, x = numpy.mgrid[: SIZE[1], : SIZE[0]]
    return numpy.exp(-((x - 80) ** 2 + (y - 30) ** 2) / 150**2)


class RelayCamera(SimulatedCamera):
    """Images the SLM through an aperture in its Fourier plane, whose fields slmsuite computes."""

    def __init__(self, slm: SimulatedSLM, unit: str):
        self._unit, self.z_mm, self.wavelength_nm = unit, 0.0, float(WAVELENGTH_NM)
        height, width = (2 * ZOOM * n for n in slm.shape)
        super().__init__(slm, resolution=(width, height), bitdepth=12, pitch_um=(PITCH_UM / ZOOM,) * 2)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._hologram = Hologram((2 * slm.shape[0], 2 * slm.shape[1]), amp=slm.source["amplitude_sim"], slm_shape=slm)
        self._noise = numpy.random.default_rng(1)

    def _get_image_hw(self, timeout_s):
        self._hologram.reset_phase(curve(self._unit, self.wavelength_nm)[self._slm.display])
        spectrum = numpy.asarray(self._hologram.get_farfield())
        rows, columns = spectrum.shape
        fy = (numpy.arange(rows)[:, None] - rows // 2) / rows  # cycles a pixel
        fx = (numpy.arange(columns) - columns // 2) / columns
        x, y = 2 * fx, 2 * fy
        r2 = x**2 + y**2
        wavelength = self.wavelength_nm * 1e-9
        path = numpy.sqrt(wavelength**-2 - (fx**2 + fy**2) / (PITCH_UM * 1e-6) ** 2) - 1 / wavelength
        a = UNITS[self._unit][3]
        terms = (2 * r2 - 1, x**2 - y**2, 2 * x * y, (3 * r2 - 2) * x, (3 * r2 - 2) * y)
        aberration = WAVELENGTH_NM / self.wavelength_nm * sum(c * term for c, term in zip(a, terms))
        spectrum = spectrum * (r2 <= 1) * numpy.exp(1j * (2 * numpy.pi * self.z_mm * 1e-3 * path + aberration))
        wide = numpy.zeros((ZOOM * rows, ZOOM * columns), complex)
        top, left = (wide.shape[0] - rows) // 2, (wide.shape[1] - columns) // 2
        wide[top : top + rows, left : left + columns] = spectrum
        image = abs(numpy.fft.fftshift(numpy.fft.ifft2(numpy.fft.ifftshift(wide), norm="ortho"))) ** 2
        # Full light on a flat modulator is 0.3 of the range at an exposure of 1, before it is set.
        norm = numpy.sum(self._slm.source["amplitude_sim"] ** 2) * ZOOM**2
        image = 0.3 * self.exposure_s * image * norm + 2e-4
        electrons = image * 20_000
        electrons = electrons + numpy.sqrt(electrons + 12**2) * self._noise.standard_normal(image.shape)
        full = self.bitresolution - 1
        return numpy.clip(numpy.rint(electrons / 20_000 * full), 0, full).astype(self.dtype)


def bench(unit: str) -> Bench:
    slm = SimulatedSLM(SIZE, pitch_um=(PITCH_UM,) * 2, wav_um=WAVELENGTH_NM / 1e3, source={"amplitude_sim": laser(), "phase_sim": numpy.zeros(SIZE[::-1])})
    camera = RelayCamera(slm, unit)

    def switch(request: phasefront_capture.Request) -> None:
        camera.z_mm, camera.wavelength_nm = request.z_mm, request.wavelength_nm

    return Bench(slm, camera, switch)


if __name__ == "__main__":
    phasefront_capture.serve(bench(sys.argv[1]))
