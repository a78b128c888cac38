"""Tests what Python does with objects besides calling them: copying, pickling, showing, and passing what is plainly meant."""

import copy
import multiprocessing
import pickle
import threading

import numpy
import pytest
from conftest import still

import phasefront
from phasefront import (
    Brightness,
    DepthRange,
    Display,
    DisplayError,
    Encoding,
    Frame,
    FrameError,
    Layout,
    Method,
    Modulator,
    Network,
    PhasefrontError,
    Quality,
    RunningMode,
    Session,
    SettingError,
    Target,
    encode,
    session_options,
)


@pytest.fixture(scope="module")
def session(network):
    with Session(session_options(network, Display(width=64, height=48))) as session:
        yield session


def natives(session, network):
    """One object of each class whose memory is the library's."""
    hologram = session.process(still())
    target = Target.of_display(Display(width=64, height=48))
    yield from (session, session._raw, network, target, still(), still()._colour[0])
    yield from (Modulator.named("ti-plm-p47"), Modulator.named("ti-plm-p47")._raw, hologram._raw, hologram._raw.refocus(0.0))
    yield session_options(network, target)  # a record that holds one


def test_what_holds_memory_of_the_library_refuses_to_be_copied(session, network):
    copies = [copy.copy, copy.deepcopy, pickle.dumps, *(lambda thing, n=n: pickle.dumps(thing, n) for n in range(pickle.HIGHEST_PROTOCOL + 1))]
    for thing in natives(session, network):
        for make in copies[1 if isinstance(thing, phasefront.SessionOptions) else 0 :]:
            with pytest.raises(SettingError, match="cannot be copied or pickled") as refused:
                make(thing)
            assert "\n" not in str(refused.value)


def test_every_generated_object_refuses_to_be_copied():
    from phasefront.ffi import phasefront_ffi as generated

    objects = [thing for thing in vars(generated).values() if isinstance(thing, type) and hasattr(thing, "_uniffi_clone_handle")]
    assert len(objects) >= 7
    for kind in objects:
        with pytest.raises(SettingError, match=kind.__name__):
            copy.copy(kind.__new__(kind))


def in_another_process(hologram):
    return pickle.dumps((hologram, hologram.refocus(1.0), Display(width=3), Method.sweep(), FrameError("one line")))


def test_holograms_pickle_as_levels_with_metadata(session, tmp_path):
    hologram = session.process(still(7))
    table = Target.with_look_up_table(Display(width=64, height=48), bytes(range(255, -1, -1)))
    with Session(session_options("sweep", table)) as other:
        calibrated = other.process(still())
    modulator = encode(numpy.full((3, 48, 64), 0.5 + 0.2j), Display(width=64, height=48, offset_mm=2.0))
    for one in (hologram, calibrated, modulator):
        for made in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert (made.levels == one.levels).all() and made.info == one.info
            assert (made.refocus(1.5) == one.refocus(1.5)).all()
            assert (made.preview() == one.preview()).all()
            one.save(tmp_path / "one.png")
            made.save(tmp_path / "made.png")
            assert (tmp_path / "one.png").read_bytes() == (tmp_path / "made.png").read_bytes()
            assert made.z_at(0.5, 0.5) == 0
    ten = encode(numpy.full((3, 48, 64), 0.5 + 0.2j), Display(width=64, height=48, bits=10))
    with pytest.raises(SettingError, match="8 bits"):
        pickle.dumps(ten)


def test_holograms_go_to_other_processes_and_back(session):
    hologram = session.process(still(7))
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        made, seen, display, method, error = pickle.loads(pool.apply(in_another_process, (hologram,)))
        assert (made.levels == hologram.levels).all() and (seen == hologram.refocus(1.0)).all()
        assert display == Display(width=3) and isinstance(method, Method.sweep)
        assert type(error) is FrameError and str(error) == "one line"


REFUSED = {
    "a display as the method": lambda: session_options(Display()),
    "an unknown method": lambda: session_options("swept"),
    "a number as the method": lambda: session_options(3),
    "an unknown modulator": lambda: session_options(target="no-such"),
    "a number as the target": lambda: session_options(target=5),
    "an array as the target": lambda: session_options(target=numpy.zeros((3, 4))),
    "a text as brightness": lambda: session_options(brightness="bright"),
    "an array as brightness": lambda: session_options(brightness=numpy.zeros(3)),
    "three depths": lambda: session_options(depth_range=(0.3, 1, 4)),
    "a text in a range": lambda: session_options(depth_range=("near", 4)),
    "a fraction of a pixel": lambda: Display(width=1.5),
    "a text as a width": lambda: Display(width="1920"),
    "a negative width": lambda: Display(width=-1),
    "a width beyond 32 bits": lambda: Display(width=2**40),
    "a text as a pitch": lambda: Display(pitch_um="8 µm"),
    "two wavelengths": lambda: Display(wavelengths_nm=[638, 520]),
    "wavelengths twice": lambda: Display(wavelengths_nm=[638, 520, 450], red_nm=640.0),
    "one wavelength": lambda: Display(wavelengths_nm=520),
    "an unknown name of a display": lambda: Display.named("no-such"),
    "negative threads": lambda: session_options(threads=-1),
    "a text as threads": lambda: session_options(threads="all"),
    "a text as quality levels": lambda: session_options(quality_levels=5),
    "a text in quality levels": lambda: session_options(quality_levels=["best"]),
    "a switch as a number of steps": lambda: session_options(midpoint_steps=1.5),
    "an unknown backend": lambda: session_options(backend="tpu"),
    "no constructor": lambda: Network(),
    "no constructor of a target": lambda: Target(),
    "a number as a file": lambda: Network.from_file(3),
    "a number as a text": lambda: phasefront.display_from_toml(3),
    "a text as options": lambda: Session("sweep"),
    "an unknown mode": lambda: Session(session_options("sweep", Display(width=64, height=48)), "film"),
    "a listener that is no function": lambda: Session(session_options("sweep", Display(width=64, height=48)), "live", 5),
    "a field set since": lambda: Session(set_since("threads", "all")),
    "a negative field set since": lambda: Session(set_since("midpoint_steps", -2)),
    "a modulator of a text": lambda: Modulator("ti-plm-p47"),
    "a text as a scale": lambda: encode(numpy.zeros((3, 4, 4), complex), scale="1"),
    "an unknown encoding": lambda: encode(numpy.zeros((3, 4, 4), complex), encoding="triple"),
    "a text as a time": lambda: Frame(numpy.zeros((4, 4, 3), numpy.uint8), timestamp_ns="now"),
    "an unknown format": lambda: Frame(numpy.zeros((4, 4, 3), numpy.uint8), colour_format="cmyk"),
}


def set_since(name, value):
    options = session_options("sweep", Display(width=64, height=48))
    setattr(options, name, value)
    return options


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_meant_is_refused_in_one_line(name):
    with pytest.raises(PhasefrontError) as refused:
        made = REFUSED[name]()
        Session(made) if isinstance(made, phasefront.SessionOptions) else Target.of_display(made)
    message = str(refused.value)
    assert "\n" not in message and len(message) > 10, message


def test_what_cannot_be_meant_of_a_hologram_is_refused_in_one_line(session):
    hologram = session.process(still())
    calls = [
        lambda: session.process(numpy.zeros((48, 64, 3))),
        lambda: session.process(None),
        lambda: session.set_quality("best"),
        lambda: session.set_thermal("hot"),
        lambda: hologram.preview(0, width=1e9, height=1e9),
        lambda: hologram.preview(0, width=10**9, height=10**9),
        lambda: hologram.preview(0, width=0, height=3),
        lambda: hologram.preview("near"),
        lambda: hologram.preview(layout="cmyk"),
        lambda: hologram.refocus("near"),
        lambda: hologram.refocus([[1.0]]),
        lambda: hologram.field(None),
        lambda: hologram.z_at("left", 0),
        lambda: hologram.output("rgb"),
        lambda: hologram.output(index=-1),
        lambda: hologram.save(3),
    ]
    for i, call in enumerate(calls):
        with pytest.raises(PhasefrontError) as refused:
            call()
        assert "\n" not in str(refused.value), i


def test_negative_numbers_are_named():
    with pytest.raises(SettingError, match="width is -1"):
        Display(width=-1)
    with pytest.raises(SettingError, match=r"session_options|method is Display"):
        session_options(Display())
    with pytest.raises(FrameError, match=r"array of float64, \(48, 64, 3\)"):
        with Session(session_options("sweep", Display(width=64, height=48))) as session:
            session.process(numpy.zeros((48, 64, 3)))


def test_what_is_plainly_meant_is_taken(network, tmp_path):
    options = session_options("sweep", "ti-plm-p47", brightness=1.2, depth_range=(0.3, 4), quality=0, encoding="band-limit", backend="cpu")
    assert isinstance(options.quality_levels[0].method, Method.sweep)
    assert options.brightness == Brightness.fixed(scale=1.2)
    assert options.depth_range == DepthRange.fixed(near_m=0.3, far_m=4.0)
    assert options.quality == Quality.fixed(quality_level=0) and options.encoding == Encoding.band_limit(k=1.0)
    assert options.target.display() == Modulator.named("ti-plm-p47").target.display() == Display.named("ti-plm-p47")
    for target in (Modulator.named("ti-plm-p47"), "ti-plm-p47"):
        assert session_options(target=target).quality_levels[0].width == options.target.display().width
    assert session_options(numpy.str_("auto")).quality_levels[0].method == Method.auto()
    assert isinstance(session_options("network").quality_levels[0].method, Method.trained)
    assert session_options(brightness=numpy.float32(0.5)).brightness == Brightness.fixed(scale=0.5)
    assert Display(width=numpy.int64(64)).width == 64 and Display(pitch_um=8).pitch_um == 8.0
    assert Display(wavelengths_nm=(640, 532, 450)) == Display(red_nm=640.0, green_nm=532.0, blue_nm=450.0)
    assert Display(wavelengths_nm=[532]).laser_nm == 532 and Display(wavelengths_nm=[532]).wavelengths_nm == [532]
    assert Display().wavelengths_nm == [638, 520, 450]
    with Session(session_options(network, Display(width=64, height=48)), "video") as session:
        session.process(still(1))
        session.set_thermal("serious")
        session.set_quality("adaptive")
    with pytest.raises(DisplayError):
        session_options(target="no-such-modulator")
    with pytest.raises(phasefront.FileError, match="no-such"):
        Network.from_file(tmp_path / "no-such.onnx")


def test_the_default_is_the_automatic_choice():
    options = session_options(target=Display(width=64, height=48))
    assert [level.method for level in options.quality_levels] == [Method.auto()]
    assert options.quality_levels[0].method.network is None
    with Session(options) as session, Session(session_options("sweep", Display(width=64, height=48))) as sweep:
        assert (session.process(still()).levels == sweep.process(still()).levels).all()
        statistics = sweep.statistics()
        assert statistics.backend and "sweep" in statistics.backend_why
        assert "sweep" in session.statistics().backend_why


def test_objects_show_what_they_are(session, network):
    hologram = session.process(still(7))
    assert repr(hologram).startswith("Hologram(64×48, 3 colours, scale=") and repr(hologram).endswith("timestamp_ns=7)")
    assert repr(still(3)) == "Frame(64×48 RGB, depth 32×24 METRES_F32, timestamp_ns=3)"
    assert repr(Target.of_display(Display(width=64))).startswith("Target(Display(width=64, ")
    assert repr(Modulator.named("ti-plm-p47")).startswith("Modulator(Display(width=")
    assert repr(session).startswith("Session(mode=RunningMode.IMAGE, backend=")
    assert repr(network) == "Network(layers=8, filters=24, precision='int8')"


def test_holograms_are_arrays_and_pictures(session):
    hologram = session.process(still())
    levels = numpy.asarray(hologram)
    assert levels.ctypes.data == hologram.levels.ctypes.data and levels.shape == (3, 48, 64)
    assert numpy.array(hologram).flags.writeable
    assert numpy.asarray(hologram, numpy.float32).dtype == numpy.float32
    assert (hologram.preview() == hologram.preview(0.0, width=64, height=48)).all()
    assert (hologram.preview(layout="rgba") == hologram.preview(layout=Layout.RGBA)).all()
    png = hologram._repr_png_()
    assert png.startswith(b"\x89PNG") and int.from_bytes(png[16:20], "big") == 64


class Tensor:
    """An array with the methods of a tensor."""

    def __init__(self, array):
        self.array = array

    def __array__(self, *arguments, **named):
        return self.array


def test_tensors_with_channels_first_are_told_how_to_permute():
    for shape in [(3, 48, 64), (4, 48, 64), (1, 3, 48, 64)]:
        for dtype in (numpy.uint8, numpy.float32):
            with pytest.raises(FrameError, match=r"permute\(1, 2, 0\)"):
                Frame(Tensor(numpy.zeros(shape, dtype)))
    for shape in [(1, 48, 64), (1, 1, 48, 64)]:
        with pytest.raises(FrameError, match=r"depth\.reshape\(depth\.shape\[-2:\]\)"):
            Frame(numpy.zeros((48, 64, 3), numpy.uint8), Tensor(numpy.ones(shape, numpy.float32)))


@pytest.mark.parametrize("raised", [SystemExit, KeyboardInterrupt, ValueError])
def test_all_that_a_listener_raises_is_counted(raised, capfd):
    done = threading.Event()

    def listener(event):
        done.set()
        raise raised

    options = session_options("sweep", Display(width=64, height=48))
    session = Session(options, RunningMode.LIVE, listener)
    session.submit(still(1))
    assert done.wait(60)
    session.close()
    assert session.statistics().listener_failures == 1
    assert "Exception ignored" not in capfd.readouterr().err
