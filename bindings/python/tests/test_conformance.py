"""Runs the conformance suite from Python: the levels must match the suite, and match Rust bit for bit."""

import os
import pathlib

import numpy
from conftest import SUITE

from phasefront import (
    Brightness,
    ColourFormat,
    ColourScale,
    ConfidenceFormat,
    DepthFormat,
    DepthNetwork,
    DepthRange,
    Encoding,
    Focus,
    Frame,
    Method,
    Network,
    Orientation,
    RgbEncoding,
    Rotation,
    RunningMode,
    Session,
    Target,
    YuvMatrix,
    display_from_toml,
    session_options,
)

COLOUR = {"rgba": ColourFormat.RGBA, "bgra": ColourFormat.BGRA, "rgb": ColourFormat.RGB, "nv12": ColourFormat.NV12}
COLOUR |= {"yuv420": ColourFormat.YUV420}
BYTES = {"rgba": [4], "bgra": [4], "rgb": [3], "nv12": [1, 2], "yuv420": [1, 1, 1]}
DEPTH = {
    "metres-f32": (DepthFormat.METRES_F32, "<f4"),
    "metres-f16": (DepthFormat.METRES_F16, "<f2"),
    "disparity-f32": (DepthFormat.DISPARITY_F32, "<f4"),
    "disparity-f16": (DepthFormat.DISPARITY_F16, "<f2"),
    "millimetres-u16": (DepthFormat.MILLIMETRES_U16, "<u2"),
    "android-depth16": (DepthFormat.ANDROID_DEPTH16, "<u2"),
    "normalized-u8": (DepthFormat.NORMALIZED_U8, "u1"),
    "normalized-u16": (DepthFormat.NORMALIZED_U16, "<u2"),
    "relative-f32": (DepthFormat.RELATIVE_F32, "<f4"),
    "relative-f16": (DepthFormat.RELATIVE_F16, "<f2"),
}
TURN = {0: Rotation.UPRIGHT, 90: Rotation.CLOCKWISE90, 180: Rotation.HALF, 270: Rotation.CLOCKWISE270}
RGB = {name.lower().replace("_", "-"): value for name, value in RgbEncoding.__members__.items()}
ENCODING = {
    "double-phase": Encoding.double_phase(),
    "anti-alias": Encoding.anti_alias(sigma=0.7, width=3),
    "band-limit": Encoding.band_limit(k=1.0),
}


def view(memory, plane, width, height, dtype, values=1):
    """Returns a plane of the suite as an array in place, with its gaps."""
    dtype = numpy.dtype(dtype)
    shape, strides = (height, width), (plane["row_stride"], plane["pixel_stride"])
    if values > 1:
        shape, strides = (*shape, values), (*strides, dtype.itemsize)
    return numpy.ndarray(shape, dtype, memory, plane["offset"], strides)


def frame_of(case, memory):
    colour, depth, confidence = case["colour"], case["depth"], case["confidence"]
    planes = []
    for i, (plane, values) in enumerate(zip(colour["planes"], BYTES[colour["format"]], strict=True)):
        width, height = (colour["width"], colour["height"])
        if i > 0:
            width, height = (width + 1) // 2, (height + 1) // 2
        planes.append(view(memory, plane, width, height, "u1", values))
    extra = {}
    if depth is not None:
        extra["depth_format"], dtype = DEPTH[depth["format"]]
        extra["depth"] = view(memory, depth["plane"], depth["width"], depth["height"], dtype)
    if confidence is not None:
        formats = {"low-medium-high": ConfidenceFormat.LOW_MEDIUM_HIGH, "u8": ConfidenceFormat.U8}
        extra["confidence"] = view(memory, confidence["plane"], confidence["width"], confidence["height"], "u1")
        extra["confidence_format"] = formats[confidence["format"]]
    return Frame(
        planes if len(planes) > 1 else planes[0],
        timestamp_ns=case["timestamp_ns"],
        colour_format=COLOUR[colour["format"]],
        matrix={"bt601": YuvMatrix.BT601, "bt709": YuvMatrix.BT709}[colour["matrix"]],
        video_range=colour["video_range"],
        encoding=RGB[colour["encoding"]],
        orientation=Orientation(rotation=TURN[case["rotation"]], mirrored=case["mirrored"]),
        **extra,
    )


def model(file):
    return Network.from_file(str(SUITE / "../../models" / file))


def target_of(case):
    if case["calibration"] is not None:
        return Target.from_file(str(SUITE / case["calibration"]))
    display = display_from_toml(case["display"])
    return display if case["lut"] is None else Target.with_look_up_table(display, bytes(case["lut"]))


def made_of(case, memory, network):
    """Returns the levels of a case's frames and their displayed images."""
    encoding = case["encoding"]
    changes = {"encoding": ENCODING[encoding] if encoding in ENCODING else Encoding.deep(prefilter=model(encoding))}
    if case["brightness"] is not None:
        changes["brightness"] = Brightness.fixed(scale=case["brightness"])
    if case["range"] is not None:
        changes["depth_range"] = DepthRange.fixed(near_m=case["range"][0], far_m=case["range"][1])
    if case["focus_steps"] is not None:
        changes["focus"] = Focus.natural(steps=case["focus_steps"])
    if case["depth_network"] is not None:
        onnx = (SUITE / case["depth_network"]).read_bytes()
        changes["depth_network"] = DepthNetwork.from_bytes(onnx, ColourScale.UNIT)
    methods = {"default": None, "network": network, "sweep": Method.sweep(), "auto": Method.auto(network=network)}
    method = methods[case["method"]] if case["method"] in methods else model(case["method"])
    options = session_options(method, target_of(case), **changes)
    mode = {"image": RunningMode.IMAGE, "video": RunningMode.VIDEO}[case["mode"]]
    with Session(options, mode) as session:
        made = [session.process(frame_of(frame, memory)) for frame in case["frames"]]
    seen = b"".join(h.refocus(1.5).tobytes() + h.field(-1.0).tobytes() for h in made)
    return b"".join(h.levels.tobytes() for h in made), seen


def test_frames_become_the_levels_that_are_expected(suite, network):
    cases, memory = suite
    got, seen = zip(*(made_of(case, memory, network) for case in cases), strict=True)
    folder = os.environ.get("PHASEFRONT_CONFORMANCE")
    if folder:
        assert b"".join(got) == (pathlib.Path(folder) / "levels.bin").read_bytes(), "not the bits that Rust has"
        assert b"".join(seen) == (pathlib.Path(folder) / "seen.bin").read_bytes(), "not what Rust sees"
    expected = (SUITE / "levels.bin").read_bytes()
    for case, levels in zip(cases, got, strict=True):
        expected, here = expected[len(levels) :], numpy.frombuffer(expected[: len(levels)], numpy.uint8)
        differ = numpy.count_nonzero(numpy.frombuffer(levels, numpy.uint8) != here)
        assert differ * 200 <= len(levels), f"{case['name']}: {differ} of {len(levels)} levels differ"
    assert expected == b""
