"""Tests batches of frames, and focal stacks."""

import numpy
import pytest

import phasefront
from phasefront import FrameError, RunningMode, Session, SettingError, TimestampError


@pytest.fixture
def frames():
    """Returns three colour images and their depth."""
    n, y, x = numpy.mgrid[:3, :48, :64]
    colour = numpy.stack([x * 4, y * 5, 255 - x * 3 - 20 * n], axis=3).astype(numpy.uint8)
    return colour, (0.5 + 0.01 * x[:, ::2, ::2] + 0.1 * n[:, ::2, ::2]).astype(numpy.float32)


def test_a_batch_has_the_levels_of_its_frames(options, frames):
    colour, depth = frames
    with Session(options) as session:
        single = [session.process(phasefront.Frame(c, d)).levels.copy() for c, d in zip(colour, depth)]
        levels = session.process_batch(colour, depth)
        numpy.testing.assert_array_equal(levels, single)
        out = numpy.empty_like(levels)
        assert session.process_batch(colour, depth, out=out) is out and (out == levels).all()
        bgra = numpy.concatenate([colour[..., ::-1], numpy.full_like(colour[..., :1], 255)], axis=3)
        same = session.process_batch(bgra, depth, colour_format=phasefront.ColourFormat.BGRA)
        numpy.testing.assert_array_equal(same, levels)
    with Session(options, RunningMode.VIDEO) as video:
        assert video.process_batch(colour, depth, timestamps_ns=[1, 2, 3]).shape == (3, 3, 48, 64)
        with pytest.raises(TimestampError):
            video.process_batch(colour, depth)


def test_wrong_batches_are_refused(options, frames):
    colour, depth = frames
    with Session(options) as session:
        for wrong in [(colour[0, :, :, 0], depth), (colour, depth[:2]), (colour[:0], depth[:0])]:
            with pytest.raises(FrameError, match="frames: "):
                session.process_batch(*wrong)
        with pytest.raises(SettingError, match="frame 0 of 3"):
            session.process_batch(colour, depth, out=numpy.empty((3, 3, 48, 63), numpy.uint8))


def test_a_focal_stack_has_the_views_of_its_foci(options, frames):
    colour, depth = frames
    with Session(options) as session:
        hologram = session.process(phasefront.Frame(colour[0], depth[0]))
    foci = numpy.linspace(-2, 2, 3)
    stack = hologram.refocus(foci)
    assert stack.shape == (3, 3, 48, 64)
    for view, z in zip(stack, foci):
        numpy.testing.assert_array_equal(view, hologram.refocus(float(z)))
    assert phasefront.compare(stack[0], stack[2]).psnr_overall < 60
    with pytest.raises(SettingError):
        hologram.refocus([0.0, 1e9])
