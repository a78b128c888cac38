"""Tests that a frame allocates nothing of an image's size. `bindings/python/test` loads `tests/counting.c`, which counts what the
process allocates: arrays and the library's memory.
"""

import ctypes
import itertools
import threading

import numpy
import pytest

import phasefront

WIDTH, HEIGHT = 640, 480
#: The bytes of the smallest image, the levels of one colour.
PLANE = WIDTH * HEIGHT


@pytest.fixture(scope="module")
def allocated():
    counter = getattr(ctypes.CDLL(None), "allocated_bytes", None)
    assert counter is not None, "nothing counts: run bindings/python/test, which loads tests/counting.c"
    counter.restype = ctypes.c_uint64
    before = counter()
    numpy.empty(PLANE, numpy.uint8)
    assert counter() - before >= PLANE, "allocations are counted"
    return counter


@pytest.fixture
def count(allocated):
    def count(what, call):
        """Prints the bytes that a call allocates on all threads, and checks them. The first calls may grow memory that
        later ones use again."""
        counts = []
        for _ in range(8):
            before = allocated()
            call()
            counts.append(allocated() - before)
        least = min(counts[3:])
        print(f"{what}: {least} bytes")
        assert least < PLANE, f"{what} allocates {least} bytes"

    return count


def test_a_frame_allocates_no_image(count):
    colour = (numpy.arange(3 * PLANE) * 37 % 251).astype(numpy.uint8).reshape(HEIGHT, WIDTH, 3)
    # A sensor's size. Depth of the colour's size is examined for whether it was enlarged, which takes memory for some lines.
    depth = (numpy.arange(PLANE // 4) // 700 % 256).astype(numpy.uint8).reshape(HEIGHT // 2, WIDTH // 2)
    modulator = phasefront.Modulator.from_toml(f"width = {WIDTH}\nheight = {HEIGHT}")
    options = phasefront.session_options(phasefront.Method.sweep(), modulator.target)
    with phasefront.Session(options) as session:
        count("process, levels", lambda: session.process(phasefront.Frame(colour, depth)).levels[2, 0, 0])
        hologram = session.process(phasefront.Frame(colour, depth))
        image = numpy.empty((HEIGHT, WIDTH, 3), numpy.uint8)
        count("output", lambda: hologram.output(out=image))
        count("preview", lambda: hologram.preview(0.0, width=WIDTH, height=HEIGHT, out=image))
        count("pack", lambda: modulator.pack(hologram, out=[image]))

    made, times = threading.Semaphore(0), itertools.count(33_000_000, 33_000_000)

    def listen(event):
        if isinstance(event, phasefront.Processed):
            made.release()

    with phasefront.Session(options, phasefront.RunningMode.LIVE, listen) as live:

        def submit():
            live.submit(phasefront.Frame(colour, depth, timestamp_ns=next(times)))
            made.acquire()

        count("submit, until it is a hologram", submit)
