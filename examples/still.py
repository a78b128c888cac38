"""Makes a hologram of a picture and its depth map:

    pip install phasefront pillow
    python examples/still.py samples/scene_rgb.jpg samples/scene_depth.png hologram.png
    phasefront refocus hologram.png --z-mm 2 -o near.png
"""

import sys

import numpy
from PIL import Image

import phasefront


def main(rgb_file: str, depth_file: str, hologram_file: str) -> None:
    # A picture and the depth of each of its points: 0 is nearest, 65535 farthest.
    rgb = numpy.asarray(Image.open(rgb_file).convert("RGB"))
    depth = numpy.asarray(Image.open(depth_file)).astype(numpy.uint16)
    height, width = rgb.shape[:2]

    # The display is the target: here the paper's, with 8 µm pixels and three lasers, and as many pixels as the picture.
    # A session plans its work once and then makes holograms of any number of frames.
    display = phasefront.Display(width=width, height=height)
    with phasefront.Session(phasefront.session_options(target=display)) as session:
        frame = phasefront.Frame(rgb, depth, depth_format=phasefront.DepthFormat.NORMALIZED_U16)
        hologram = session.process(frame)

        # `levels` has the modulator's input, (3, height, width): red, green and blue.
        print(f"{width}×{height} pixels, levels of {hologram.levels.shape}")
        hologram.save(hologram_file)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("three files are needed: still.py RGB DEPTH HOLOGRAM.png")
    main(*sys.argv[1:])
