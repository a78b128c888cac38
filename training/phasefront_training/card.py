"""The card of a network: what it is, how it came about and what it was measured to do, as Markdown beside its .onnx."""

import json
import shlex
from pathlib import Path

from . import evaluate, evaluate_encoding
from .files import replacing
from .networks import multiplies_per_pixel

SAMPLING = ("minutes", "steps", "batch", "crop", "planes", "degraded", "rate", "seed", "scenes", "f32")


def command(last, init):
    """The command that makes a checkpoint like `last` again."""
    architecture, _ = last.networks["hologram"]
    parts = ["python", "-m", "phasefront_training", last.kind, "--data", "DATA", "-o", "OUT"]
    if last.kind == "stage1":
        parts += ["--layers", architecture.layers, "--filters", architecture.filters, "--input", architecture.input, "--head", architecture.head]
    if architecture.input == "seeded":
        parts += ["--seeds", "SEEDS"]
    if last.kind == "stage2":
        parts += ["--offset-mm", f"{last.extra['offset_m'] * 1e3:g}", "--identity-steps", last.options["identity_steps"]]
        prefilter, _ = last.networks["prefilter"]
        parts += ["--prefilter-layers", prefilter.layers, "--prefilter-filters", prefilter.filters]
    if init:
        parts += ["--init", Path(init).name]
    for name in SAMPLING:
        value = last.options.get(name)
        if value is True:
            parts.append(f"--{name}")
        elif value not in (None, False):
            parts += [f"--{name}", value]
    return shlex.join(map(str, parts))


def describe(name, last, figures):
    """The card's text. figures: what `evaluate --json` or `evaluate-encoding --json` wrote, a list of them."""
    lines = [f"# {name}", ""]
    for part, (a, _) in last.networks.items():
        lines.append(
            f"- {part}: {a.layers} layers of {a.filters} filters 3x3, input `{a.input}`, head `{a.head}`; "
            f"{multiplies_per_pixel(a):,} multiply-accumulates a pixel."
        )
    d, data = last.display, last.extra["data"]
    wavelengths = ", ".join(f"{w * 1e9:g}" for w in d.wavelengths_m)
    lines.append(f"- Display: pitch {d.pitch_m * 1e6:g} µm, {wavelengths} nm, volume {d.volume_depth_m * 1e3:g} mm.")
    if "offset_m" in last.extra:
        lines.append(f"- Offset of the modulator: {last.extra['offset_m'] * 1e3:g} mm.")
    lines.append(
        f"- Trained ({last.kind}) on {data['scenes']} scenes of {data['size']}² pixels, {data['planes']} planes, seed {data['seed']}: "
        f"{last.step:,} steps of {last.options['batch']} crops of {last.options['crop']}² pixels in {last.elapsed_s / 60:.0f} minutes"
        f" on {last.options['device']} with {last.options['threads']} threads; {last.options['degraded']:.0%} of the samples with degraded depth."
    )
    lines += ["", "## Figures", ""]
    for each in figures:
        measured = each["data"]
        depth = f", {measured['depth']} depth" if "depth" in measured else ""
        lines += [f"On {measured['scenes']} scenes of the {measured['split']} split{depth}:", ""]
        methods = {Path(method).name: found for method, found in each["results"].items()}
        if "offset_mm" in each:
            lines.append(evaluate_encoding.table(methods))
        else:
            lines.append(evaluate.table(methods))
        lines.append("")
    seed = f"--seed {data['seed']} --size {data['size']} --planes {data['planes']}"
    seeds = ""
    if any(a.input == "seeded" for a, _ in last.networks.values()):
        seeds = f" and its seeds: `python -m phasefront_training seeds --data DATA -o SEEDS -- --planes {data['seed_planes']} --refined {data['refined']}`,"
    lines += [
        "## To make it again", "",
        f"The data set: `python -m phasefront_training data -o DATA -- {seed} --scenes …`,{seeds} then", "",
        f"    {command(last, last.options.get('init'))}", "",
    ]
    return "\n".join(lines)


def write(path, last, figure_files):
    """Writes the card of `path` (NAME.md) from a checkpoint and files of figures."""
    figures = [json.loads(Path(file).read_text()) for file in figure_files]
    text = describe(Path(path).stem, last, figures)
    with replacing(path) as temporary:
        temporary.write_text(text)
