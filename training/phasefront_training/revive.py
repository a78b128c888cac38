"""Dead units begin again.

A unit whose ReLU fires nowhere gives no gradient, so it stays dead; in deep chains many die early, for what a residual
branch adds is never negative. Of the 24 units of every second layer of a network of 15 layers, half were left in the
middle and none at the end. Revived, a unit of a branch's first layer fires as strongly as its neighbours, and nothing
reads it yet; what one of its second layer adds is a tenth of that.
"""

import torch
from torch.nn import functional as F

BRANCH = 0.1
SILENT = 1e-3  # the share of pixels under which a unit counts as dead


def revive(network, examples):
    """Gives fresh weights to the dead units of a Chain, layer by layer; returns how many there were.

    examples: network inputs (C, H, W), a few.
    """
    examples = list(examples)
    last, revived = network.architecture.layers - 1, 0
    with torch.no_grad():
        states = [([], x[None]) for x in examples]
        for i, conv in enumerate(network.convs[:-1]):
            for inputs, h in states:
                inputs.append(h + inputs[i - 2] if network.architecture.has_skip(i) else h)
            seen = torch.cat([inputs[i].flatten(2) for inputs, _ in states], -1)
            outputs = _outputs(conv, states, i)
            dead = (outputs > 0).float().mean(-1) < SILENT
            if dead.any():
                usual = seen.std(-1).mean() if dead.all() else outputs[~dead].clamp(min=0).std(-1).mean()
                strength = usual if i % 2 == 1 else BRANCH * usual
                conv.weight[dead] = torch.randn_like(conv.weight[dead])
                conv.bias[dead] = 0
                fresh = _outputs(conv, states, i)[dead]
                scale = strength / fresh.std(-1)
                conv.weight[dead] *= scale[:, None, None, None]
                conv.bias[dead] = -fresh.mean(-1) * scale
                if i % 2 == 1:
                    network.convs[i + 1].weight[:, : len(dead)][:, dead] = 0
                revived += int(dead.sum())
            states = [(inputs, F.relu(conv(inputs[i]))) for inputs, _ in states]
    return revived


def _outputs(conv, states, i):
    """What a layer gives before its ReLU, (units, pixels)."""
    return torch.cat([conv(inputs[i])[0].flatten(1) for inputs, _ in states], -1)
