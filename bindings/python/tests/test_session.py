"""Tests sessions from Python: threads, live streams, misuse and memory."""

import gc
import os
import signal
import subprocess
import sys
import threading

import numpy
import pytest
import skips
from conftest import still

import phasefront
from phasefront import (
    ColourFormat,
    DisplayError,
    DropReason,
    Dropped,
    Encoding,
    Failed,
    FileError,
    Frame,
    FrameError,
    LogLevel,
    Method,
    Network,
    NetworkError,
    PhasefrontError,
    Processed,
    Quality,
    RunningMode,
    Session,
    SessionError,
    SettingError,
    Target,
    TimestampError,
    session_options,
)


class OnlyDlpack:
    """A tensor that has DLPack and nothing else that NumPy knows."""

    def __init__(self, array):
        self._array = array

    def __dlpack__(self, **arguments):
        return self._array.__dlpack__(**arguments)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class NoArray:
    """A tensor that refuses to become an array, as those with gradients and on GPUs do."""

    def __array__(self, *arguments, **named):
        raise RuntimeError("use detach()")


class Events:
    """Collects a live stream's events."""

    def __init__(self):
        self.all, self.threads = [], set()
        self._changed = threading.Condition()

    def __call__(self, event):
        with self._changed:
            self.all.append(event)
            self.threads.add(threading.get_ident())
            self._changed.notify_all()

    def wait(self, count):
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.all) >= count, 60)


def test_levels_are_read_in_place_and_outlive_the_session(options):
    with Session(options) as session:
        hologram = session.process(still())
        levels = hologram.levels
    assert levels.shape == (3, 48, 64) and not levels.flags.owndata and not levels.flags.writeable
    before = levels.copy()
    del hologram
    gc.collect()
    numpy.testing.assert_array_equal(levels, before)
    assert before.std() > 10


def test_views_with_strides_are_taken_as_they_are(options):
    y, x = numpy.mgrid[0:96, 0:128]
    large = numpy.stack([x, y, x ^ y, x | y], axis=2).astype(numpy.uint8)
    depth = numpy.linspace(0.3, 2, 48 * 64, dtype=numpy.float32).reshape(48, 64)
    with Session(options) as session:
        for colour, metres in [
            (large[10:58, 20:84], depth[::2, ::2]),
            (large[::2, ::2, :3], depth[1:25, 3:35]),
            (large[::-2, ::2], depth[::-1]),
            (large[:48, :64].transpose(1, 0, 2).copy().transpose(1, 0, 2), depth.T.copy().T),
            (numpy.asfortranarray(large[:48, :64]), numpy.asfortranarray(depth)),
            (numpy.broadcast_to(large[5, 7], (48, 64, 4)), numpy.broadcast_to(depth[:1], depth.shape)),
        ]:
            views = session.process(Frame(colour, metres)).levels.copy()
            copies = session.process(Frame(colour.copy(), metres.copy())).levels
            numpy.testing.assert_array_equal(views, copies)


def test_a_preview_shows_the_picture_and_a_tap_gives_z(options):
    with Session(options) as session:
        hologram = session.process(still())
    image = hologram.preview(0.0, width=32, height=24)
    assert image.shape == (24, 32, 3) and image.std() > 10
    # Into every second row of an array of the caller.
    rows = numpy.full((48, 32, 4), 7, numpy.uint8)
    assert hologram.preview(0.0, width=32, height=24, layout=phasefront.Layout.BGRA, out=rows[::2]).base is rows
    numpy.testing.assert_array_equal(rows[::2, :, 2::-1], image)
    assert (rows[::2, :, 3] == 255).all() and (rows[1::2] == 7).all()
    for wrong in (rows, rows[::2, :, :3], rows[::2].astype(float), rows[::-2], hologram.levels):
        with pytest.raises(SettingError, match="out must be"):
            hologram.preview(0.0, width=32, height=24, layout=phasefront.Layout.BGRA, out=wrong)
    assert hologram.z_at(0.5, 0.5) > hologram.z_at(0.02, 0.02)
    with pytest.raises(SettingError, match="0×24"):
        hologram.preview(0.0, width=0, height=24)
    with pytest.raises(SettingError, match="67108864×1 is too large"):
        hologram.preview(0.0, width=67108864, height=1)
    # Beside arrays of the shape (H, W), two bare numbers would be swapped.
    with pytest.raises(TypeError):
        hologram.preview(0.0, 32, 24)


def seen_by_equation(hologram, display, z_mm):
    """Computes Eq. 2 and Eq. 8 in NumPy: the levels' light through a round aperture, propagated to z, without the
    carrier."""
    height, width = hologram.levels.shape[1:]
    light = hologram.info.scale * numpy.exp(2j * numpy.pi * hologram.levels / 2**display.bits)
    fy, fx = numpy.meshgrid(numpy.fft.fftfreq(4 * height), numpy.fft.fftfreq(4 * width), indexing="ij")
    spectrum = numpy.fft.fft2(light, (4 * height, 4 * width)) * (numpy.hypot(fx, fy) <= 0.5)
    for plane, nm in zip(spectrum, (display.red_nm, display.green_nm, display.blue_nm), strict=True):
        wave = 1e9 / nm
        mu2 = (fx**2 + fy**2) / (display.pitch_um * 1e-6) ** 2
        plane *= numpy.exp(2j * numpy.pi * (z_mm - display.offset_mm) * 1e-3 * (numpy.sqrt(wave**2 - mu2) - wave))
    return numpy.fft.ifft2(spectrum)[:, :height, :width]


@pytest.mark.parametrize("offset_mm", [0, 2.5])
def test_a_whole_view_is_what_the_equations_say(offset_mm):
    display = phasefront.Display(width=120, height=90, offset_mm=offset_mm)
    with Session(session_options(target=display)) as session:
        hologram = session.process(still())
    for z_mm in (0.0, 1.5):
        field, wanted = hologram.field(z_mm), seen_by_equation(hologram, display, z_mm)
        assert field.dtype == numpy.complex64 and field.shape == (3, 90, 120) and not field.flags.writeable
        # They pad by different amounts, which changes the light at the border.
        inner = (slice(None), slice(12, -12), slice(12, -12))
        error = numpy.linalg.norm((field - wanted)[inner]) / numpy.linalg.norm(wanted[inner])
        assert error < 0.02
        numpy.testing.assert_allclose(hologram.refocus(z_mm), abs(field), rtol=1e-5)
    del hologram
    gc.collect()
    assert numpy.isfinite(field).all()


def test_a_view_from_too_far_away_is_refused(options):
    with Session(options) as session:
        hologram = session.process(still())
    with pytest.raises(SettingError, match="a shorter distance or a smaller frame"):
        hologram.refocus(1e5)
    with pytest.raises(SettingError, match="must be finite"):
        hologram.field(float("nan"))


def test_output_is_what_the_modulator_takes(options):
    with Session(options) as session:
        hologram = session.process(still())
    numpy.testing.assert_array_equal(hologram.output(), hologram.levels.transpose(1, 2, 0))
    blue = hologram.output(phasefront.Placement(layout=phasefront.Layout.GREY, flip_x=True), 2)
    numpy.testing.assert_array_equal(blue[..., 0], hologram.levels[2, :, ::-1])
    words = hologram.output(phasefront.Placement(layout=phasefront.Layout.GREY16), 1)
    assert words.dtype == numpy.uint16
    numpy.testing.assert_array_equal(words[..., 0], hologram.levels[1].astype(numpy.uint16) << 8)
    again = numpy.zeros((48, 64, 3), numpy.uint8)
    assert hologram.output(out=again) is again
    numpy.testing.assert_array_equal(again, hologram.output())
    with pytest.raises(SettingError, match="no image 1"):
        hologram.output(index=1)


def test_a_live_stream_answers_every_frame_on_its_own_thread(options):
    events = Events()
    with Session(options, RunningMode.LIVE, events) as session:
        for i in range(50):
            session.submit(still(timestamp_ns=1000 + i))
        events.wait(50)  # closing would drop waiting frames, on a busy machine all of them
    made = [e.hologram.info.timestamp_ns for e in events.all if isinstance(e, Processed)]
    dropped = [e.timestamp_ns for e in events.all if isinstance(e, Dropped)]
    assert sorted(made + dropped) == list(range(1000, 1050))
    assert made and made == sorted(made)
    assert len(events.threads) == 1 and threading.get_ident() not in events.threads
    assert session.statistics().submitted == 50


def test_a_bad_frame_in_a_stream_harms_nothing(options):
    events = Events()
    with Session(options, RunningMode.LIVE, events) as session:
        nothing = Frame(numpy.zeros((48, 64, 3), numpy.uint8), numpy.zeros((24, 32), numpy.float32), timestamp_ns=5)
        session.submit(nothing)
        events.wait(1)
        with pytest.raises(TimestampError, match="5 ns"):
            session.submit(still(timestamp_ns=5))
        session.submit(still(timestamp_ns=6))
        events.wait(2)
    kinds = [type(e) for e in events.all]
    assert kinds == [Failed, Processed]


def test_what_a_listener_raises_is_counted_and_the_stream_goes_on(options):
    def listener(event):
        events(event)
        raise raised

    for raised in (ValueError("no thanks"), FrameError("no thanks"), SystemExit(3), KeyboardInterrupt()):
        events = Events()
        with Session(options, RunningMode.LIVE, listener) as session:
            for i in range(3):
                session.submit(still(timestamp_ns=i + 1))
                events.wait(i + 1)
        assert session.statistics().listener_failures == 3
        assert [type(event) for event in events.all] == [Processed] * 3


NO_KERNELS = """
import phasefront
for method in (phasefront.Network.from_file("MODEL"), phasefront.Method.sweep()):
    try:
        phasefront.Session(phasefront.session_options(method))
    except phasefront.SettingError as error:
        print(error)
"""


def test_an_instruction_set_that_the_processor_lacks_is_a_setting_error():
    model = os.path.join(os.path.dirname(__file__), "../../../models/rgbd-8-int8.onnx")
    code = NO_KERNELS.replace("MODEL", model)
    environment = os.environ | {"PHASEFRONT_KERNELS": "nonsense"}
    run = subprocess.run([sys.executable, "-P", "-c", code], env=environment, capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")
    assert [line.split(";")[0] for line in run.stdout.splitlines()] == ["PHASEFRONT_KERNELS: no kernels 'nonsense'"] * 2


LEFT_OPEN = """
import phasefront
options = phasefront.session_options(target=phasefront.Display(width=48, height=36))
session = phasefront.Session(options, phasefront.RunningMode.LIVE, print)
"""


def test_a_live_stream_that_is_left_open_ends_with_python():
    """The session's thread calls Python when it ends, which aborts a process without an interpreter."""
    run = subprocess.run([sys.executable, "-P", "-c", LEFT_OPEN], capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stderr) == (0, "")


def test_a_listener_may_call_its_session(options):
    done = threading.Event()
    closed = []

    def listener(event):
        if isinstance(event, Processed):
            closed.append(session.statistics().processed)
            session.close()
            done.set()

    session = Session(options, RunningMode.LIVE, listener)
    session.submit(still(timestamp_ns=1))
    assert done.wait(60)
    with pytest.raises(SessionError, match="closed"):
        session.submit(still(timestamp_ns=2))
    session.close()


def test_threads_share_a_session(options):
    with Session(options) as session:
        want = session.process(still()).levels.tobytes()
        got = []
        work = lambda: got.extend(session.process(still()).levels.tobytes() for _ in range(10))  # noqa: E731
        threads = [threading.Thread(target=work) for _ in range(4)]
        [t.start() for t in threads]
        [t.join() for t in threads]
    assert got == [want] * 40


def test_a_closed_session_says_so(options):
    session = Session(options)
    session.process(still())
    session.close()
    session.close()
    for call in [lambda: session.process(still()), session.warm_up, session.reset, session.pause, session.resume]:
        with pytest.raises(SessionError, match="closed; make a new one"):
            call()
    assert session.statistics().processed == 1


def test_a_paused_session_refuses_until_it_is_resumed(options):
    with Session(options) as session:
        session.pause()
        with pytest.raises(SessionError, match="paused"):
            session.process(still())
        session.resume()
        session.process(still())


def test_a_reset_lets_time_begin_anew(options):
    with Session(options, RunningMode.VIDEO) as session:
        session.process(still(timestamp_ns=100))
        with pytest.raises(TimestampError):
            session.process(still(timestamp_ns=99))
        session.reset()
        session.process(still(timestamp_ns=1))


def test_modes_are_not_mixed(options):
    with Session(options) as session, pytest.raises(SessionError, match="not live"):
        session.submit(still())
    with Session(options, RunningMode.LIVE, lambda _: None) as session:
        with pytest.raises(SessionError, match="submitted"):
            session.process(still())
    with pytest.raises(SessionError, match="listener"):
        Session(options, RunningMode.LIVE)
    with pytest.raises(SessionError, match="listener"):
        Session(options, RunningMode.IMAGE, lambda _: None)


@pytest.mark.parametrize(
    ("colour", "depth", "words"),
    [
        (numpy.zeros((0, 64, 3), "u1"), numpy.ones((4, 4), "f4"), "64×0"),
        (numpy.zeros((48, 64, 3), "u1"), numpy.ones((0, 0), "f4"), "depth"),
        (numpy.zeros((48, 64, 2), "u1"), numpy.ones((4, 4), "f4"), "(H, W, 3)"),
        (numpy.zeros(48, "u1"), numpy.ones((4, 4), "f4"), "(48,)"),
        (numpy.zeros((48, 64, 3), "f4"), numpy.ones((4, 4), "f4"), "(255 * colour).round().astype(numpy.uint8)"),
        (numpy.zeros((48, 64, 3), "u2"), numpy.ones((4, 4), "f4"), "(colour >> 8).astype(numpy.uint8)"),
        (numpy.zeros((48, 64), "f8"), numpy.ones((4, 4), "f4"), "float64; uint8"),
        (numpy.zeros((48, 64, 3), "u1"), numpy.ones((4, 4), "i4"), "int32; metres are float32"),
        (numpy.zeros((48, 64, 3), "u1"), numpy.ones((4, 4), ">f4"), "float32"),
        (numpy.zeros((48, 64, 3), "u1"), [["near"]], "depth holds"),
        (numpy.zeros((48, 64, 3), "u1"), numpy.ones((4, 40), "f4"), "aspect"),
        ((numpy.zeros((48, 64), "u1"),), numpy.ones((4, 4), "f4"), "NV12"),
    ],
)
def test_unusable_frames_are_named(options, colour, depth, words):
    with Session(options) as session:
        with pytest.raises(FrameError) as error:
            session.process(Frame(colour, depth))
        assert words in str(error.value)
        session.process(still())


def test_grey_and_float64_are_taken(options):
    y, x = numpy.mgrid[0:48, 0:64]
    grey = (3 * x + y).astype(numpy.uint8)
    metres = numpy.where(x < 20, 0.5, 1.0 + x / 64)
    with Session(options) as session:
        expected = session.process(Frame(numpy.stack(3 * [grey], axis=2), metres.astype(numpy.float32))).levels
        for colour, depth in [(grey, metres), (grey[:, :], numpy.asfortranarray(metres))]:
            numpy.testing.assert_array_equal(session.process(Frame(colour, depth)).levels, expected)
        # A value that overflows 32 bits is no reading.
        metres[0, 0], infinite = 1e300, metres.astype(numpy.float32, copy=True)
        infinite[0, 0] = numpy.inf
        far, none = (session.process(Frame(grey, depth)).levels.tobytes() for depth in (metres, infinite))
        assert far == none


def test_arrays_of_two_gibibytes_are_refused():
    """The library reads no memory beyond a view of a small array."""
    small = numpy.zeros((48, 64, 3), "u1")
    side = 2**31 // 64 + 1
    wide = numpy.lib.stride_tricks.as_strided(numpy.ones(1, "f4"), (16, side), (4 * side, 4))
    tall = numpy.lib.stride_tricks.as_strided(numpy.zeros(4, "u1"), (side, 64, 4), (2**8, 4, 1))
    for colour, depth in [(small, wide), (tall, numpy.ones((4, 4), "f4"))]:
        with pytest.raises(FrameError, match="2147483647 bytes are the most"):
            Frame(colour, depth)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_in_a_fork_what_is_the_parents_is_refused_and_what_is_new_works(options):
    if not hasattr(os, "fork"):
        skips.or_fail("fork", f"{sys.platform} forks no processes")
        return
    live = Session(options, RunningMode.LIVE, lambda _: None)
    with live, Session(options) as session:
        hologram = session.process(still())
        hologram.preview(0.0, width=8, height=8)
        child = os.fork()
        if child == 0:
            signal.alarm(60)  # a test that hangs must fail
            result = 1
            try:
                calls = [lambda: session.process(still()), session.warm_up, lambda: live.submit(still())]
                for call in [*calls, lambda: hologram.preview(0.0, width=8, height=8)]:
                    with pytest.raises(SessionError, match="forked"):
                        call()
                session.close()
                live.close()
                with Session(options) as own:
                    assert own.process(still()).preview(0.0, width=8, height=8).shape == (8, 8, 3)
                result = 0
            finally:
                os._exit(result)
        assert os.waitpid(child, 0)[1] == 0
        session.process(still())


def test_closing_while_a_frame_is_processed_leaves_none_pending(options):
    for _ in range(10):
        session = Session(options)

        def work():
            with pytest.raises(SessionError, match="closed"):
                while True:
                    session.process(still())

        threads = [threading.Thread(target=work) for _ in range(2)]
        [t.start() for t in threads]
        session.close()
        [t.join() for t in threads]
        statistics = session.statistics()
        known = statistics.processed + statistics.refused + statistics.dropped.closed
        assert statistics.pending == 0 and statistics.submitted == known


def test_listeners_may_close_each_others_session(options):
    sessions, done = [], [threading.Event(), threading.Event()]
    both = threading.Barrier(2)

    def listener(i):
        def listen(event):
            if isinstance(event, Processed):
                both.wait(60)
                sessions[1 - i].close()
                done[i].set()

        return listen

    sessions += [Session(options, RunningMode.LIVE, listener(i)) for i in range(2)]
    [session.submit(still(timestamp_ns=1)) for session in sessions]
    assert all(event.wait(60) for event in done)
    [session.close() for session in sessions]
    assert [session.statistics().pending for session in sessions] == [0, 0]


def test_planes_of_another_number_are_refused(options):
    luma, chroma = numpy.zeros((48, 64), "u1"), numpy.full((24, 32, 2), 128, "u1")
    depth = numpy.ones((24, 32), "f4")
    with pytest.raises(FrameError, match="1 colour planes are given; NV12 has 2"):
        Frame([luma], depth, colour_format=ColourFormat.NV12)
    with Session(options) as session:
        session.process(Frame([luma, chroma], depth, colour_format=ColourFormat.NV12))


def test_networks_that_are_none_are_named(tmp_path):
    with pytest.raises(FileError, match="nowhere.onnx"):
        Network.from_file(str(tmp_path / "nowhere.onnx"))
    (tmp_path / "text.onnx").write_text("not a network")
    with pytest.raises(NetworkError):
        Network.from_file(str(tmp_path / "text.onnx"))
    with pytest.raises(NetworkError):
        Network.from_bytes(b"")
    with pytest.raises(NetworkError, match="rgbd-8, rgbd-15"):
        Network.built_in("rgbd-9")
    assert Network.built_in("rgbd-15").info().layers == 15
    info = Network.built_in().info()
    assert (info.layers, info.pitch_um) == (8, 8.0)


def test_the_choice_with_the_network_that_is_built_in_is_the_default():
    for offset_mm in (0, 3, 12):
        display = phasefront.Display(width=64, height=48, offset_mm=offset_mm)
        options = session_options(target=display)
        assert options.quality_levels[0].method == Method.auto()
        assert isinstance(options.encoding, Encoding.anti_alias)
        with Session(options) as session:
            assert session.process(still()).levels.shape == (3, 48, 64)
            assert "8 layers" in session.statistics().backend_why and "sweep" in session.statistics().backend_why


def test_the_pair_that_is_built_in_can_be_taken():
    pair = phasefront.built_in_pair()
    display = phasefront.Display(width=64, height=48)
    options = session_options(pair.hologram, display, encoding=Encoding.deep(prefilter=pair.prefilter))
    with Session(options) as session:
        assert session.process(still()).levels.shape == (3, 48, 64)


def test_steps_and_dark_can_be_set(display):
    def levels(**changes):
        with Session(session_options(target=display, **changes)) as session:
            return session.process(still()).levels

    defaults = levels()
    assert (levels(dark_threshold=0.4, local_steps=1) == defaults).all()
    assert (levels(local_steps=0) != defaults).any()
    assert (levels(midpoint_steps=1) != defaults).any()
    with pytest.raises(PhasefrontError, match="at most 8"):
        levels(local_steps=9)
    with pytest.raises(PhasefrontError, match="from 0 to 1"):
        levels(dark_threshold=2.0)


def test_without_a_network_the_sweep_is_the_default():
    options = session_options(target=phasefront.Display(width=64, height=48, pitch_um=3.74))
    with Session(options) as session:
        assert session.process(still()).levels.shape == (3, 48, 64)
        assert session.statistics().backend_why.startswith("the plane sweep")


def test_targets_that_cannot_be_are_named(display, tmp_path):
    with pytest.raises(DisplayError, match="pitch_um"):
        session_options(target=phasefront.Display(pitch_um=-1.0))
    with pytest.raises(SettingError, match="3 levels"):
        Target.with_look_up_table(display, b"abc")
    with pytest.raises(FileError, match="nowhere.pfc"):
        Target.from_file(str(tmp_path / "nowhere.pfc"))
    with pytest.raises(SettingError, match="calibration"):
        Target.from_bytes(b"not a calibration")


def test_a_target_is_taken_as_its_display_is(display):
    options = session_options(target=Target.with_look_up_table(display, bytes(range(256))))
    assert options.target.display() == display
    # This table has equal steps.
    with Session(options) as by_table, Session(session_options(target=display)) as linear:
        numpy.testing.assert_array_equal(by_table.process(still()).levels, linear.process(still()).levels)


def test_settings_that_cannot_be_meant_are_named(network, display):
    for changes, words in [
        ({"quality_levels": []}, "no quality levels"),
        ({"threads": 0}, "0 threads"),
        ({"threads": 70_000}, "1 to 256"),
        ({"most_pixels": 100}, "most_pixels"),
        ({"target_rate_hz": float("nan")}, "target rate"),
        ({"quality": Quality.fixed(quality_level=3)}, "no quality level 3"),
    ]:
        with pytest.raises(SettingError, match=words):
            Session(session_options(network, display, **changes))
    with pytest.raises(NetworkError, match="pitch"):
        Session(session_options(network, phasefront.Display(width=64, height=48, pitch_um=3.74)))
    options = session_options(network, display)
    options.target = Target.of_display(phasefront.Display(width=32, height=24))
    with pytest.raises(SettingError, match="the modulator's 32×24"):
        Session(options)


def test_messages_reach_the_log(options):
    messages = []
    phasefront.send_log(LogLevel.INFO, lambda level, message: messages.append((level, message)))
    Session(options).close()
    phasefront.send_log(LogLevel.INFO, None)
    Session(options).close()
    assert [level for level, _ in messages] == [LogLevel.INFO] and "IMAGE" in messages[0][1].upper()


def test_stages_begin_and_end(options):
    stages = []
    with Session(options) as session:
        phasefront.send_stages(lambda stage, begins: stages.append((stage.name.lower(), begins)))
        session.process(still())
        phasefront.send_stages(None)
        session.process(still())
    inside = ["colour", "depth", "method", "propagate", "encode"]
    within = [(stage, begins) for stage in inside for begins in (True, False)]
    assert stages == [("frame", True), *within, ("frame", False)]


def test_a_log_handler_that_raises_is_told_of_the_next_message(options):
    messages = []

    def handler(level, message):
        messages.append(message)
        raise raised

    for raised in (ValueError("no thanks"), SessionError("no thanks")):
        phasefront.send_log(LogLevel.INFO, handler)
        for _ in range(2):
            Session(options).close()
    phasefront.send_log(LogLevel.INFO, None)
    assert len(messages) == 4


def test_a_log_handler_may_use_the_library_as_it_ends(options):
    class Handler:
        def __call__(self, level, message):
            messages.append(message)

        def __del__(self):
            Session(options).close()

    messages = []
    phasefront.send_log(LogLevel.INFO, Handler())
    gc.collect()

    def replace():
        phasefront.send_log(LogLevel.INFO, lambda level, message: messages.append(message))
        gc.collect()

    # A second thread, so that a deadlock makes the test fail instead of hang.
    thread = threading.Thread(target=replace, daemon=True)
    thread.start()
    thread.join(60)
    assert not thread.is_alive()
    phasefront.send_log(LogLevel.INFO, None)
    assert len(messages) == 1


def resident_mb():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * 4096 / 1e6


def test_memory_of_ten_thousand_frames_is_flat(network, display):
    with Session(session_options(network, display, threads=1)) as session:
        frame = still()
        for i in range(10_000):
            levels = session.process(frame).levels
            if i == 1000:
                gc.collect()
                before = resident_mb()
        gc.collect()
        # The results of each frame take 15 KB. All of them would take 138 MB.
        assert resident_mb() - before < 16
        assert levels.shape == (3, 48, 64)


def test_dropped_by_reset_is_told(options):
    events = Events()
    with Session(options, RunningMode.LIVE, events) as session:
        session.pause()
        assert session.submit(still(timestamp_ns=1)) == DropReason.PAUSED
        events.wait(1)
    assert events.all == [Dropped(1, DropReason.PAUSED)]


def test_tensors_go_in_and_out_in_place(options):
    y, x = numpy.mgrid[0:48, 0:64]
    colour = numpy.stack([x * 4, y * 5, 255 - x * 3], axis=2).astype(numpy.uint8)
    metres = numpy.linspace(0.3, 0.6, 24 * 32, dtype=numpy.float32).reshape(24, 32)
    with Session(options) as session:
        expected = session.process(Frame(colour, metres))
        given = Frame(OnlyDlpack(colour), OnlyDlpack(metres))
        assert given._colour[0].address == colour.ctypes.data and given._depth.address == metres.ctypes.data
        hologram = session.process(given)
        numpy.testing.assert_array_equal(hologram.levels, expected.levels)
        seen = hologram.preview(0.0, width=64, height=48)
        into = numpy.zeros((48, 64, 3), numpy.uint8)
        assert hologram.preview(0.0, width=64, height=48, out=into) is into
        numpy.testing.assert_array_equal(seen, into)
        numpy.testing.assert_array_equal(numpy.from_dlpack(hologram.field()), hologram.field())
        with pytest.raises(FrameError, match="colour is no array: use detach"):
            Frame(NoArray(), metres)
        with pytest.raises(SettingError, match="out is no array: use detach"):
            hologram.preview(0.0, width=64, height=48, out=NoArray())
        with pytest.raises(FrameError, match="the field is no array: use detach"):
            phasefront.encode(NoArray())
