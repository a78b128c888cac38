"""The displayed images of encoded holograms: deep double phase compared with AA-DPM, BL-DPM and plain double phase
(Fig. 5)."""

import torch

from .data import network_input
from .encode import anti_alias, band_limit, double_phase, reconstruct, scale_of, wraps
from .evaluate import compare, means_and_worst, scene_as_seen
from .optics import propagate
from .plot import pictures

DEEP = "deep double phase"
STRONG_BLUR = (1.5, 7)  # σ in pixels and taps that leave hardly any artefacts, and below the bound of BL-DPM
STRONG_BAND_LIMIT = 0.1


@torch.no_grad()
def encodings(model, colour, depth, seed, others=True):
    """Yields (method, phase map, reconstructed midpoint hologram), both (1, 3, H, W), of a scene from `scene_as_seen`:
    by the DeepDoublePhase `model` and, with `others`, by the other encodings of its hologram network, weak and
    strong."""
    x = network_input(colour, depth, model.hologram.architecture.input, seed)[None]
    midpoint = model.hologram.field(x.to(next(model.parameters()).device))
    there = propagate(midpoint, model.offset_m, model.display)
    fields = {DEEP: model.filtered(midpoint)}
    if others:
        fields |= {
            "anti-aliased double phase": anti_alias(there),
            "anti-aliased, strong": anti_alias(there, *STRONG_BLUR),
            "band-limited double phase": band_limit(there),
            "band-limited, strong": band_limit(there, STRONG_BAND_LIMIT),
            "double phase": there,
        }
    for method, field in fields.items():
        # Removing the mean phase does not change amplitudes, so they are comparable.
        centred = field if method == DEEP else field * torch.exp(-1j * field.angle().mean((-1, -2), keepdim=True))
        scale = scale_of(centred)
        phase = double_phase(centred, scale)
        yield method, phase, reconstruct(phase, scale, model.offset_m, model.display)


def encoding_figures(model, scenes, depth="clean", full=True, others=True):
    """Returns {method: mean figures} of `encodings`. `wraps` is the fraction of phases outside (−π, π], `brightness`
    the ratio of the mean amplitude to the true one, and `worst_scene` the scene with the least amplitude PSNR."""
    rows = {}
    for i in range(len(scenes)):
        *seen, truth = scene_as_seen(scenes, i, depth)
        for method, phase, shown in encodings(model, *seen, others):
            row = compare(shown[0], truth, model.display, full)
            row |= {"wraps": wraps(phase), "brightness": float(shown.abs().mean() / truth.abs().mean())}
            rows.setdefault(method, []).append(row)
    return {method: means_and_worst(each, scenes) for method, each in rows.items()}


def table(results):
    """Returns the result of `encoding_figures` as a Markdown table."""
    columns = list(next(iter(results.values())))
    lines = ["| encoding | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for method, figures in results.items():
        lines.append(f"| {method} | " + " | ".join(str(v) if isinstance(v, int) else f"{v:.4g}" for v in figures.values()) + " |")
    return "\n".join(lines)


def draw_worst(model, scenes, results, output, depth="clean"):
    """Draws the true amplitude and the displayed image of each encoding for the scene that is worst for the deep double
    phase method in `results`, a result of `encoding_figures`."""
    i = scenes.numbers.index(results[DEEP]["worst_scene"])
    *seen, truth = scene_as_seen(scenes, i, depth)
    views = {"the true hologram": truth.abs()}
    views |= {method: shown[0].abs().cpu() for method, _, shown in encodings(model, *seen)}
    pictures(views, output)
