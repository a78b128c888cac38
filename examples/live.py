"""Makes holograms of a camera's frames while it runs. A moving picture simulates the camera:

    pip install phasefront pillow
    python examples/live.py samples/scene_rgb.jpg samples/scene_depth.png last.png
"""

import queue
import sys
import time

import numpy
from PIL import Image

import phasefront
from phasefront import DepthFormat, Frame, Processed, RunningMode, Session

SIZE = WIDTH, HEIGHT = 640, 360
RATE_HZ = 15


def main(rgb_file: str, depth_file: str, last_file: str) -> None:
    rgb = numpy.asarray(Image.open(rgb_file).convert("RGB").resize(SIZE))
    depth = numpy.asarray(Image.open(depth_file).resize(SIZE, Image.Resampling.NEAREST)).astype(numpy.uint16)

    # The session makes holograms on its own thread and reports the outcome of each frame to its listener. The listener
    # only forwards events, because no frame is processed while it is busy.
    events: queue.SimpleQueue[phasefront.Event] = queue.SimpleQueue()
    display = phasefront.Display(width=WIDTH, height=HEIGHT)
    options = phasefront.session_options(target=display, target_rate_hz=float(RATE_HZ))
    with Session(options, RunningMode.LIVE, events.put) as session:
        session.warm_up()
        for i in range(2 * RATE_HZ):
            # The camera's next picture: all rows move to the left.
            moved = numpy.roll(rgb, -4 * i, axis=1), numpy.roll(depth, -4 * i, axis=1)
            # The session copies the frame and returns at once. If it falls behind, it drops the older of two frames.
            session.submit(Frame(*moved, depth_format=DepthFormat.NORMALIZED_U16, timestamp_ns=i * 10**9 // RATE_HZ))
            time.sleep(1 / RATE_HZ)
            while not events.empty():
                match events.get():
                    case Processed(hologram):
                        # An app sends `hologram.levels` to its modulator here.
                        print(f"{hologram.info.timestamp_ns // 10**6} ms: a hologram")
                        hologram.save(last_file)
                    case other:
                        print(other)
        print(session.statistics())


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("three files are needed: live.py RGB DEPTH LAST.png")
    main(*sys.argv[1:])
