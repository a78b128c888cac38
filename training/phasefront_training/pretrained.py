"""The bundled networks as torch modules."""

from pathlib import Path

from .export import ExportError, read_onnx

MODELS = Path(__file__).parent / "models"


def from_pretrained(name, models=MODELS):
    """Returns (Chain, Display): a bundled network by its name, such as rgbd-15, in float32, and the display that it was
    trained for.

    `models` is the folder of the .onnx files, by default that of this package. `data.network_input` makes the input of a
    scene, and `Chain.field` gives the field. Raises ExportError for another name.
    """
    file = Path(models) / f"{name}.onnx"
    if not file.is_file():
        known = sorted(p.stem for p in Path(models).glob("*.onnx") if not p.stem.endswith(("-int8", "-prefilter")))
        if not known:
            raise ExportError(f"{models}: no networks here; say where the folder models of Phasefront lies")
        raise ExportError(f"no bundled network is called {name}; there are {', '.join(known)}")
    return read_onnx(file)
