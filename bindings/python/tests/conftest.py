import json
import pathlib
import sys

import numpy
import pytest

import phasefront

TESTS = pathlib.Path(__file__).parents[3] / "tests"
SUITE = TESTS / "conformance"
sys.path.append(str(TESTS))  # skips.py


@pytest.fixture(scope="session")
def network():
    return phasefront.Network.built_in()


@pytest.fixture
def display():
    return phasefront.Display(width=64, height=48)


@pytest.fixture
def options(network, display):
    return phasefront.session_options(network, display)


@pytest.fixture(scope="session")
def suite():
    return json.loads((SUITE / "cases.json").read_text())["cases"], (SUITE / "frames.bin").read_bytes()


def still(timestamp_ns=0, metres=0.5):
    """Returns a small frame that is not uniform."""
    y, x = numpy.mgrid[0:48, 0:64]
    colour = numpy.stack([x * 4, y * 5, 255 - x * 3], axis=2).astype(numpy.uint8)
    depth = numpy.full((24, 32), metres, numpy.float32)
    depth[6:18, 8:24] = metres / 2
    return phasefront.Frame(colour, depth, timestamp_ns=timestamp_ns)
