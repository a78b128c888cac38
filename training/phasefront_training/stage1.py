"""Stage 1: supervised training of the hologram network on midpoint holograms.

The loss is field + amplitude + 2·focal stack + total variation (losses.py). The focal stack uses all 20 planes on a
GPU, or a few random planes in each step, which has the same mean. Units that no longer fire get fresh weights
(revive.py) every hundred steps of the first part.
"""

import sys

import numpy as np
import torch

from .data import Sampler
from .evaluate import SENSOR, evaluate, torch_predictor
from .loop import Task
from .losses import field_terms, fill_invalid, focal_stack_terms
from .networks import head_field
from .pool import Pool
from .revive import revive

FOCAL_WEIGHT = 2.0
VARIATION_WEIGHT = 1.0
PLANES_ON_CPU = 1
PLANES_ON_GPU = 20
LIGHT_REACH_PX = 16
REVIVAL_STEPS = 100
REVIVALS_END = 0.6  # fraction of the training; revived units need time to learn
REVIVAL_SCENES = 4  # whose crops determine which units fire


def margin(architecture):
    """Returns the pixels at a cut side that the loss leaves out: the network's reach, but at most the light's."""
    return min(architecture.reach_px, LIGHT_REACH_PX)


class Stage1(Task):
    """The task that trains `network` (a Chain or a Quantized network) on scenes."""

    kind = "stage1"

    def __init__(self, network, scenes, validation, workers, batch=1, crop=192, planes=None, sensor_depth=0.0, bf16=True, seed=0, dimmed=0.0):
        self.network = network.to(workers.device, memory_format=torch.channels_last)
        self.networks = {"hologram": network}
        self.display = scenes.display
        self.validation = validation
        self.device = workers.device
        self.bf16 = bf16
        self.sensor_depth = sensor_depth
        self.seed, self.rank = seed, workers.rank
        self.planes = planes if planes is not None else (PLANES_ON_GPU if workers.device.type == "cuda" else PLANES_ON_CPU)
        self.scenes, self.looked = scenes, 0
        cut, kind = margin(network.architecture), network.architecture.input
        self.sampler = Sampler(scenes, batch, crop, cut, sensor_depth, seed, workers.rank, kind, dimmed)
        self.revival = Sampler(scenes, REVIVAL_SCENES, crop, cut, sensor_depth, seed, 0, kind, dimmed)

    def module(self):
        return self.network

    def before(self, step):
        """Looks for new scenes of a pool once the number of samples since the last look reaches that of the scenes."""
        if isinstance(self.scenes, Pool) and (step - self.looked) * self.sampler.batch >= len(self.scenes):
            self.looked = step
            if more := self.scenes.look():
                print(f"{more} scenes more, {len(self.scenes)} in all", file=sys.stderr, flush=True)

    def sample(self, step):
        return self.sampler.draw(step)

    def revive(self, step, progress):
        if step % REVIVAL_STEPS or progress >= REVIVALS_END:
            return 0
        with torch.random.fork_rng():
            torch.manual_seed(int(np.random.default_rng([self.seed, step]).integers(2**62)))
            return revive(self.network, self.examples(step).to(self.device))

    def examples(self, step):
        """Returns inputs that determine which units fire."""
        return self.revival.draw(step).input

    def loss(self, module, batch, step):
        x = batch.input.contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16):
            output = module(x)
        field = head_field(self.network.architecture, output, x)
        field = fill_invalid(field, batch.target, batch.valid)
        share = batch.valid.mean()
        terms = dict(zip(("field", "amplitude"), field_terms(field, batch.target)))
        if self.planes:
            rng = np.random.default_rng([self.seed, self.rank, step, 1])
            terms |= zip(("focal", "variation"), focal_stack_terms(field, batch.target, batch.depth, self.display, self.planes, rng))
        terms = {name: value / share for name, value in terms.items()}
        weights = {"focal": FOCAL_WEIGHT, "variation": VARIATION_WEIGHT}
        return sum(weights.get(name, 1.0) * value for name, value in terms.items()), terms

    def extra(self):
        return {"data": self.scenes.facts}

    def validate(self):
        predict = torch_predictor(self.network, self.bf16)
        line = {"validation_psnr": evaluate(predict, self.validation, full=False)["amplitude_psnr"]}
        if self.sensor_depth:
            line["validation_sensor_depth_psnr"] = evaluate(predict, self.validation, SENSOR, full=False)["amplitude_psnr"]
        return line
