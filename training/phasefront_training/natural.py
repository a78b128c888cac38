"""Natural focus: a network learns to display what incoherent light shows, out of focus as well as in focus.

There is no target wave. The network makes a field from RGB-D, the default encoder turns it into phasors, and the loss is
the root mean square difference between the amplitudes that these display at some depths of focus and the incoherent
focal stack of the whole layered scene (stacks.py). Pixels in focus weigh nine times as much as others. The network
learns through the encoder because, trained on fields alone, it uses amplitudes that double phase clips.
"""

from dataclasses import dataclass

import numpy as np
import torch

from .data import Sampler
from .encode import default_phasors, full_light, views
from .evaluate import SENSOR, scene_as_seen, torch_predictor
from .metrics import ssim
from .networks import head_field
from .stage1 import LIGHT_REACH_PX, Stage1

PLANES = 3  # depths of focus of each sample
IN_FOCUS_WEIGHT = 9.0
IN_FOCUS_PX = 1.5  # blur at which the weight of focus has fallen to a third
IN_FOCUS, OUT_OF_FOCUS = 2.0, 6.0  # bounds in pixels of the blur of figures
BRIGHTER_ELSEWHERE = 0.3  # largest logarithm of a frame's full light over that of the crop


@dataclass(frozen=True)
class Batch:
    """The samples of one step.

    input: the network's input (N, 4, H, W). stack: amplitudes (N, P, 3, H, W). depth: clean normalized depth of the
    front layer (N, H, W). valid: (N, 1, H, W), 1 where the crop does not cut the network's view. depths: of focus,
    normalized (N, P).
    """

    input: torch.Tensor
    stack: torch.Tensor
    depth: torch.Tensor
    valid: torch.Tensor
    depths: torch.Tensor


class StackSampler(Sampler):
    """Draws batches with `planes` depths of focus of each scene's stack."""

    batch_of = Batch

    def __init__(self, *args, planes=PLANES, **options):
        super().__init__(*args, **options)
        self.planes = planes

    def target(self, i, window, gains, rng):
        chosen = torch.from_numpy(rng.choice(len(self.scenes.stack_depths[i]), self.planes, replace=False))
        stack = self.scenes.stack[i][(chosen, *window)].float() / 255
        return stack * gains, (self.scenes.stack_depths[i][chosen],)

    @staticmethod
    def finished(target):
        return target


def blur_px(depth, depths, display):
    """Returns the radius in pixels (N, P, 3, H, W) of the blur that the whole aperture gives pixels of `depth` (N, H,
    W) at depths of focus (N, P)."""
    per_metre = torch.tensor(display.wavelengths_m) / (2 * display.pitch_m**2)
    away_m = (display.z_m(depth)[:, None] - display.z_m(depths)[..., None, None]).abs()
    return away_m[:, :, None] * per_metre.to(depth)[:, None, None]


class Natural(Stage1):
    """The task that trains a network for natural focus."""

    kind = "natural"

    def __init__(self, network, scenes, validation, workers, batch=1, crop=192, planes=None, sensor_depth=0.0, bf16=True, seed=0, dimmed=0.0):
        super().__init__(network, scenes, validation, workers, batch, crop, 0, sensor_depth, bf16, seed, dimmed)
        self.sampler = StackSampler(scenes, batch, crop, LIGHT_REACH_PX, sensor_depth, seed, workers.rank, dimmed=dimmed, planes=planes or PLANES)

    def loss(self, module, batch, step):
        x = batch.input.contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16):
            output = module(x)
        field = head_field(self.network.architecture, output, x)
        part = np.random.default_rng([self.seed, self.rank, step, 2]).random(len(field))
        brighter = torch.from_numpy(np.exp(BRIGHTER_ELSEWHERE * part**2)).to(field.real)
        scale = full_light(field) * brighter[:, None, None, None]
        seen = views(default_phasors(field, scale), scale, batch.depths, self.display)
        blur = blur_px(batch.depth, batch.depths, self.display)
        focus = torch.exp(-((blur / IN_FOCUS_PX) ** 2))
        counts = batch.valid[:, None].expand_as(blur)
        weight = counts * (1 + (IN_FOCUS_WEIGHT - 1) * focus)
        square = (seen - batch.stack).square()

        def error(weight):
            return ((weight * square).sum((1, 2, 3, 4)) / weight.sum((1, 2, 3, 4)).clamp(min=1) + 1e-6).sqrt().mean()

        with torch.no_grad():
            terms = {"in_focus": error(counts * (blur < IN_FOCUS)), "out_of_focus": error(counts * (blur > OUT_OF_FOCUS))}
        return error(weight), terms

    def validate(self):
        predict = torch_predictor(self.network, self.bf16)
        line = {f"validation_{name}": value for name, value in figures(predict, self.validation).items()}
        if self.sensor_depth:
            line |= {f"validation_sensor_{name}": value for name, value in figures(predict, self.validation, SENSOR).items()}
        return line


@torch.no_grad()
def figures(predict, scenes, seen_depth="clean"):
    """Returns the means over scenes of amplitude PSNR (all pixels, in focus, out of focus) and SSIM against the stack,
    after one common scale, of what the default encoder displays of `predict`'s fields. seen_depth: the kind of depth that
    `predict` reads, "clean" or SENSOR."""
    rows = []
    for i in range(len(scenes)):
        _, depth, _ = scenes.scene(i)
        field = predict(*scene_as_seen(scenes, i, seen_depth)[:3])[None]
        scale = full_light(field)
        depths = scenes.stack_depths[i][None]
        seen = views(default_phasors(field, scale), scale, depths, scenes.display)[0]
        a, b = seen, scenes.stack[i].float() / 255
        a = a * (a * b).sum() / (a * a).sum()
        square, blur = (a - b).square(), blur_px(depth, depths, scenes.display)[0]
        level = [-10 * torch.log10(square[where].mean()) for where in (blur >= 0, blur < IN_FOCUS, blur > OUT_OF_FOCUS)]
        rows.append([float(value) for value in level] + [ssim(a, b)])
    means = np.nanmean(rows, 0)
    return dict(zip(("psnr", "in_focus_psnr", "out_of_focus_psnr", "ssim"), (float(value) for value in means)))
