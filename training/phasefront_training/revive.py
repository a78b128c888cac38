"""Dead units begin again.

A unit whose ReLU fires nowhere gives no gradient, so it stays dead; in deep chains many die early, for what a residual
branch adds is never negative. Of the 24 units of every second layer of a network of 15 layers, half were left in the
middle and none at the end. Revived, a unit of a branch's first layer fires as strongly as its neighbours, and nothing
reads it yet; what one of its second layer adds is a tenth of that.
"""

import torch

BRANCH = 0.1
SILENT = 1e-3  # the share of pixels under which a unit counts as dead


def revive(network, examples):
    """Gives fresh weights to the dead units of a Chain, layer by layer; returns how many there were.

    examples: network inputs (N, C, H, W), a few.
    """
    revived = 0

    def revive_layer(i, conv, seen, output):
        """A forward hook of layer i: `output` (N, units, H, W) before the ReLU, with its dead units fresh."""
        nonlocal revived
        dead = _of_units(output > 0).float().mean(-1) < SILENT
        if not dead.any():
            return output
        live = _of_units(seen) if dead.all() else _of_units(output)[~dead].clamp(min=0)
        strength = live.std(-1).mean() * (1 if i % 2 == 1 else BRANCH)
        conv.weight[dead] = torch.randn_like(conv.weight[dead])
        conv.bias[dead] = 0
        fresh = _of_units(conv.forward(seen))[dead]
        scale = strength / fresh.std(-1)
        conv.weight[dead] *= scale[:, None, None, None]
        conv.bias[dead] = -fresh.mean(-1) * scale
        if i % 2 == 1:
            network.convs[i + 1].weight[:, : len(dead)][:, dead] = 0
        revived += int(dead.sum())
        return conv.forward(seen)

    hooks = [
        conv.register_forward_hook(lambda conv, given, output, i=i: revive_layer(i, conv, given[0], output))
        for i, conv in enumerate(network.convs[:-1])
    ]
    with torch.no_grad():
        network(examples)
    for hook in hooks:
        hook.remove()
    return revived


def _of_units(values):
    """(N, units, H, W) as (units, pixels)."""
    return values.transpose(0, 1).flatten(1)
