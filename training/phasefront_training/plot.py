"""Plots: the curves of trainings (the loss and the validation figures over minutes) and views of a scene."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  the backend comes first

from .loop import read_curve  # noqa: E402

FIGURES = {"validation_psnr": "-", "validation_sensor_depth_psnr": "--"}


def plot(folders, output):
    """Plots `curve.jsonl` of each folder in one image (.png or .svg)."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for k, folder in enumerate(folders):
        curve = read_curve(Path(folder) / "curve.jsonl")
        if not curve:
            raise ValueError(f"{folder}: the curve is empty")
        name, colour = Path(folder).name, f"C{k}"
        left.plot([line["elapsed_s"] / 60 for line in curve], [line["loss"] for line in curve], color=colour, label=name)
        for key, style in FIGURES.items():
            points = [(line["elapsed_s"] / 60, line[key]) for line in curve if key in line]
            if points:
                label = f"{name}, simulated sensor depth" if "sensor" in key else name
                right.plot(*zip(*points), style, color=colour, label=label)
    left.set(xlabel="minutes", ylabel="loss", yscale="log")
    right.set(xlabel="minutes", ylabel="amplitude PSNR (dB), validation")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(output, dpi=120)
    pyplot.close(figure)


def pictures(views, output):
    """Draws {title: amplitude (3, H, W)} in one image, four in a row. Amplitude 1 is white."""
    columns = min(len(views), 4)
    rows = -(-len(views) // columns)
    height, width = next(iter(views.values())).shape[-2:]
    figure, axes = pyplot.subplots(rows, columns, figsize=(3 * columns, (3 * height / width + 0.3) * rows), layout="constrained", squeeze=False)
    for place in axes.flat:
        place.axis("off")
    for place, (title, view) in zip(axes.flat, views.items()):
        place.imshow(view.clamp(0, 1).permute(1, 2, 0).numpy())
        place.set_title(title, fontsize=9)
    figure.savefig(output, dpi=120)
    pyplot.close(figure)
