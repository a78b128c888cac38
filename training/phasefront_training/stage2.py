"""Stage 2, the deep double phase method: the hologram network and the pre-filter are trained together through the
encoding.

The pre-filter reads a field after the blur of AA-DPM and initially leaves it unchanged, so training starts from the
quality of that method. (The start of the paper, in which the pre-filter alone first learns to reproduce true holograms
at the modulator's plane, is available with a number of steps.) Both networks are then trained through encoding,
aperture and back propagation by the focal-stack loss against the true midpoint hologram, plus 0.07 times the phase
regulariser. The loss deliberately leaves out the field itself.
"""

import numpy as np
import torch

from .data import Sampler
from .encode import phase_regulariser
from .evaluate_encoding import DEEP, encoding_figures
from .loop import Task
from .losses import fill_invalid, focal_stack_terms
from .networks import Architecture, Chain, head_field
from .optics import propagate
from .stage1 import PLANES_ON_CPU, PLANES_ON_GPU, margin

STACK_WEIGHT = 20.0
PHASE_WEIGHT = 0.07


def prefilter_network(layers=8, filters=8):
    """Returns a pre-filter that initially leaves a blurred field unchanged. The paper uses 8 layers of 8 filters."""
    network = Chain(Architecture(layers, filters, "blurred-field"))
    torch.nn.init.zeros_(network.convs[-1].weight)
    return network


class _OnHolograms(Task):
    """The common base of both parts. The margin of its samples exceeds the reach of light from beyond the cut sides."""

    def __init__(self, model, scenes, validation, workers, batch=1, crop=384, sensor_depth=0.0, seed=0):
        self.model = model.to(workers.device, memory_format=torch.channels_last)
        self.display, self.validation, self.device = scenes.display, validation, workers.device
        self.networks = {"hologram": model.hologram, "prefilter": model.prefilter}
        self.seed, self.rank = seed, workers.rank
        cut = margin(model.hologram.architecture) + self.display.reach_px(model.offset_m)
        self.facts = scenes.facts
        self.sampler = Sampler(scenes, batch, crop, cut, sensor_depth, seed, workers.rank, model.hologram.architecture.input)

    def sample(self, step):
        return self.sampler.draw(step)

    def extra(self):
        return {"data": self.facts, "offset_m": self.model.offset_m}


class Identity(_OnHolograms):
    """The task that trains the pre-filter to reproduce its input."""

    kind = "identity"

    def module(self):
        return self.model.prefilter

    def loss(self, module, batch, step):
        there = propagate(batch.target, self.model.offset_m, self.display)
        x = self.model.seen_by_prefilter(batch.target).contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.model.bf16):
            output = module(x)
        error = (head_field(self.model.prefilter.architecture, output, x) - there).abs().mean()
        return error, {}

    def validate(self):
        return {}


class Stage2(_OnHolograms):
    """The task that trains both networks by the displayed images of the encoded hologram."""

    kind = "stage2"

    def __init__(self, *args, planes=None, **options):
        super().__init__(*args, **options)
        self.planes = planes or (PLANES_ON_GPU if self.device.type == "cuda" else PLANES_ON_CPU)

    def module(self):
        return self.model

    def loss(self, module, batch, step):
        before, after = module(batch.input.contiguous(memory_format=torch.channels_last))
        after = fill_invalid(after, batch.target, batch.valid)
        rng = np.random.default_rng([self.seed, self.rank, step, 1])
        focal, variation = focal_stack_terms(after, batch.target, batch.depth, self.display, self.planes, rng)
        share = batch.valid.mean()
        terms = {"focal": focal / share, "variation": variation / share, "phase": phase_regulariser(before)}
        return STACK_WEIGHT * (terms["focal"] + terms["variation"]) + PHASE_WEIGHT * terms["phase"], terms

    def validate(self):
        figures = encoding_figures(self.model, self.validation, full=False, others=False)[DEEP]
        return {"validation_psnr": figures["amplitude_psnr"], "validation_wraps": figures["wraps"]}
