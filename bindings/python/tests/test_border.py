"""Measures the cost of a call to the library: a camera frame in, three planes of 1080p out. `tests/border` runs it for
many frames."""

import os
import statistics
import time

import numpy

from phasefront import ColourFormat, Frame, Session, session_options


def test_cost(network, capsys):
    luma = (numpy.arange(1920 * 1440) * 7 // 5).astype(numpy.uint8)
    metres = numpy.linspace(0.5, 0.7, 256 * 192, dtype=numpy.float32).reshape(192, 256)
    planes = [luma.reshape(1440, 1920), luma[: 1920 * 720].reshape(720, 960, 2)]
    added, inside = [], []
    with Session(session_options(network)) as session:
        for _ in range(int(os.environ.get("PHASEFRONT_BORDER", 1)) + 5):
            start = time.perf_counter()
            hologram = session.process(Frame(planes, metres, colour_format=ColourFormat.NV12))
            levels = hologram.levels
            everything = (time.perf_counter() - start) * 1e3
            assert levels.shape == (3, 1080, 1920)
            inside.append(hologram.info.times.total_ms)
            added.append(everything - inside[-1])
    border, stages = statistics.median(added[5:]), statistics.median(inside[5:])
    with capsys.disabled():
        print(f"\nPython: {border:.3f} ms beside the {stages:.1f} ms of the stages: {100 * border / stages:.2f} %")
