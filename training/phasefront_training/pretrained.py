"""The networks of Phasefront as torch modules."""

from pathlib import Path

from .export import ExportError, read_onnx

MODELS = Path(__file__).parent / "models"


def from_pretrained(name, models=MODELS):
    """Returns (Chain, Display): a network of Phasefront by its name, such as rgbd-15, in float32, and the display that it was
    trained for.

    `models` is the folder of the .onnx files, by default that of this package. `data.network_input` makes the input of a
    scene, and `Chain.field` gives the field. Raises ExportError for another name.
    """
    files = {file.stem: file for file in sorted(Path(models).glob("**/*.onnx")) if not file.stem.endswith("-int8")}
    if not files:
        raise ExportError(f"{models}: no networks here; say where the folder models of Phasefront lies")
    if name not in files:
        known = [stem for stem in files if not stem.endswith("-prefilter")]
        raise ExportError(f"no network of Phasefront is called {name}; there are {', '.join(known)}")
    return read_onnx(files[name])
