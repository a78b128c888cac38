"""The card of a network: its architecture, training, quality and the commands that reproduce it, as Markdown."""

import json
import math
import shlex
from dataclasses import replace
from pathlib import Path

from . import evaluate, evaluate_encoding
from .files import replacing
from .networks import multiplies_per_pixel
from .optics import Display

DATASET_DISPLAY = Display.from_manifest({"pitch_um": 8.0, "wavelengths_nm": [638.0, 520.0, 450.0], "volume_depth_mm": 6.0})  # of `phasefront-lab dataset`
SAMPLING = ("minutes", "steps", "batch", "crop", "planes", "sensor_depth", "dimmed", "average", "rate", "seed", "scenes", "f32")


def sets(last):
    """Returns the description of each data set that the network was trained on."""
    return last.extra["data"].get("sets") or [last.extra["data"]]


def names(name, last):
    """Returns the folder name of each data set: DATA, or DATA1 and DATA2. A pool has one folder."""
    if last.extra["data"].get("pool"):
        return [name]
    count = len(sets(last))
    return [name] if count == 1 else [f"{name}{k + 1}" for k in range(count)]


def scenes_of(last):
    """Returns the flag that names the training scenes, with its values."""
    return ["--pool", "POOL"] if last.extra["data"].get("pool") else ["--data", *names("DATA", last)]


def command(last, init):
    """Returns the command that reproduces the checkpoint `last`."""
    architecture, _ = last.networks["hologram"]
    parts = ["python", "-m", "phasefront_training", last.kind, *scenes_of(last), "-o", "OUT"]
    if last.kind == "stage1":
        parts += ["--layers", architecture.layers, "--filters", architecture.filters, "--input", architecture.input, "--head", architecture.head]
        parts += ["--halved"] if architecture.halved else []
    if architecture.seeded:
        parts += ["--seeds", *names("SEEDS", last)]
    if last.kind == "stage2":
        parts += ["--offset-mm", f"{last.extra['offset_m'] * 1e3:g}", "--identity-steps", last.options["identity_steps"]]
        prefilter, _ = last.networks["prefilter"]
        parts += ["--prefilter-layers", prefilter.layers, "--prefilter-filters", prefilter.filters]
    if init:
        parts += ["--init", Path(init).name]
    for name in SAMPLING:
        flag, value = f"--{name.replace('_', '-')}", last.options.get(name)
        if value is True:
            parts.append(flag)
        elif value not in (None, False):
            parts += [flag, value]
    return shlex.join(map(str, parts))


def like(known):
    """Returns words for the kind of the scenes, or an empty string for objects."""
    return {"photographs": " like photographs", "varied": " of every kind"}.get(known.get("like"), "")


def counted(count, noun):
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def display_of(known, last):
    """Returns the display of the scenes. Old checkpoints do not record its volume."""
    mm = known.get("volume_depth_mm")
    return last.display if mm is None else replace(last.display, volume_depth_m=mm * 1e-3)


def depth_of(known, last):
    """Returns words for the depth of the scenes, if it differs from the volume of the network's display."""
    m = display_of(known, last).volume_depth_m
    return "" if math.isclose(m, last.display.volume_depth_m) else f", {m * 1e3:g} mm deep"


def describe(name, last, figures):
    """Returns the text of the card. figures: a list of results of `evaluate --json` or `evaluate-encoding --json`."""
    lines = [f"# {name}", ""]
    for part, (a, _) in last.networks.items():
        lines.append(
            f"- {part}: {a.layers} layers of {a.filters} filters 3x3{' at half the resolution' if a.halved else ''}, input `{a.input}`, head `{a.head}`; "
            f"{multiplies_per_pixel(a):,} multiply-accumulates for each pixel."
        )
    d, data = last.display, last.extra["data"]
    wavelengths = ", ".join(f"{w * 1e9:g}" for w in d.wavelengths_m)
    lines.append(f"- Display: pitch {d.pitch_m * 1e6:g} µm, {wavelengths} nm, volume {d.volume_depth_m * 1e3:g} mm.")
    if "offset_m" in last.extra:
        lines.append(f"- Modulator offset: {last.extra['offset_m'] * 1e3:g} mm.")
    lines.append(
        f"- Training ({last.kind}): "
        f"{last.step:,} steps of {counted(last.options['batch'], 'crop')} of {last.options['crop']}² pixels in {last.elapsed_s / 60:.0f} minutes"
        f" on {last.options['device']} with {counted(last.options['threads'], 'thread')}; {last.options['sensor_depth']:.0%} of the samples had simulated sensor depth."
    )
    trained_on = "; ".join(
        f"{each['scenes']} scenes{like(each)} of {each['size']}² pixels, {each['planes']} planes, seed {each['seed']}{depth_of(each, last)}" for each in sets(last)
    )
    lines.append(f"- Training data: {trained_on}.")
    lines += ["", "## Quality", ""]
    for each in figures:
        measured = each["data"]
        depth = f", {measured['depth']} depth" if "depth" in measured else ""
        known = measured | measured["display"]
        lines += [f"{counted(measured['scenes'], measured['split'] + ' scene')}{like(measured)}{depth_of(known, last)}{depth}:", ""]
        methods = {Path(method).name: found for method, found in each["results"].items()}
        if "offset_mm" in each:
            lines.append(evaluate_encoding.table(methods))
        else:
            lines.append(evaluate.table(methods))
        lines.append("")
    lines += ["## Reproduce", "", *scenes_again(last), f"    {command(last, last.options.get('init'))}", ""]
    return "\n".join(lines)


def sensors_of(facts):
    """Returns the flag that gives a data set its sensors, if it has any."""
    return f" --sensor {','.join(facts['sensors'])}" if facts.get("sensors") else ""


def seeds_again(scenes, folder, facts):
    """Returns the line with the command that makes seeds in `folder`. scenes: the flag of the training scenes."""
    refined = f" --refined {facts['refined']}" if facts["refined"] else ""
    return f"    python -m phasefront_training seeds {scenes} -o {folder} --variants {facts['variants']} -- --planes {facts['seed_planes']}{refined}"


def scenes_again(last):
    """Returns lines with the commands that make the training scenes of `last`."""
    data = last.extra["data"]
    seeded = any(a.seeded for a, _ in last.networks.values())
    if data.get("pool"):
        first = sets(last)[0]
        shares = " ".join(f"{each['like']}={each['shards']}" for each in sets(last))
        flags = f"--scenes {data['scenes']} --shares {shares} -- --size {first['size']} --planes {first['planes']}{sensors_of(data)}"
        return [f"    python -m phasefront_training pool -o POOL {flags}", *([seeds_again("--pool POOL", "SEEDS", first)] if seeded else [])]
    lines = []
    for each, folder, seeds in zip(sets(last), names("DATA", last), names("SEEDS", last)):
        flags = f"--seed {each['seed']} --size {each['size']} --planes {each['planes']} --scenes …"
        flags += f" --scenes-like {each['like']}" if like(each) else ""
        flags += "" if replace(display_of(each, last), corrected=False) == DATASET_DISPLAY else " --display …"
        flags += sensors_of(each)
        lines.append(f"    python -m phasefront_training data -o {folder} -- {flags}")
        if seeded:
            lines.append(seeds_again(f"--data {folder}", seeds, each))
    return lines


def write(path, last, figure_files):
    """Writes the card `path` (NAME.md) for a checkpoint and its files of figures."""
    figures = [json.loads(Path(file).read_text()) for file in figure_files]
    text = describe(Path(path).stem, last, figures)
    with replacing(path) as temporary:
        temporary.write_text(text)
