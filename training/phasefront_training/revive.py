"""Gives dead units fresh weights.

A unit whose ReLU never fires has no gradient, so it stays dead. In deep chains many units die early, because the output
of a residual branch is never negative. In a network of 15 layers with 24 units each, half of the units of every second
layer survived in the middle and none at the end. A revived unit in the first layer of a branch fires as strongly as its
neighbours, and the next layer reads it with weight 0. One in the second layer adds a tenth of that.
"""

import torch

BRANCH = 0.1
SILENT = 1e-3  # fraction of pixels below which a unit counts as dead


def revive(network, examples):
    """Gives fresh weights to the dead units of a Chain, layer by layer. Returns their number.

    examples: network inputs (N, C, H, W), a few.
    """
    revived = 0

    def revive_layer(i, conv, seen, output):
        """Revives the dead units of layer i in a forward hook. Returns the new output (N, units, H, W) before the
        ReLU."""
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
    """Converts (N, units, H, W) to (units, pixels)."""
    return values.transpose(0, 1).flatten(1)
