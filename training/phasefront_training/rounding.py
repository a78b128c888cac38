"""Rounds the weights of an int8 network in order, so that errors do not add up.

If each weight is rounded to its nearest step, the errors add up in a sum of 216 products. This module rounds the
weights of a filter one after another. The weights that are not rounded yet compensate each error, as far as their
inputs correlate: optimal brain compression (Frantar and Alistarh 2022), in the order of their GPTQ. The correlations
are measured on the outputs of the rounded layers before.
"""

import torch
from torch.nn import functional as F

SCENES = 2  # whose pixels give the correlations of inputs
RIDGE = 1e-3  # fraction of the inputs' mean power


@torch.no_grad()
def round_in_order(quantized, examples):
    """Fixes the weight scales of a Quantized network and rounds its weights. Biases compensate the remaining error.

    examples: a list of network inputs (C, H, W).
    """
    walks = [quantized.walk(x[None]) for x in examples[:SCENES]]
    steps = [next(walk) for walk in walks]
    for i, conv in enumerate(quantized.chain.convs):
        name = steps[0][2]
        scale = quantized.scale(i, name)
        weights = torch.cat([conv.weight.flatten(1), conv.bias[:, None]], 1).double()
        rounded = in_order(weights, scale.double(), _products([h for _, h, _ in steps]))
        conv.weight.copy_(rounded[:, :-1].reshape(conv.weight.shape))
        conv.bias.copy_(rounded[:, -1])
        quantized.scales[i] = scale
        if i < len(quantized.chain.convs) - 1:
            steps = [walk.send(F.conv2d(h, *quantized.layer(i, name), padding=1)) for walk, (_, h, _) in zip(walks, steps)]


def in_order(weights, scale, products):
    """Rounds the first K of the weights (O, K + 1) to steps of scale (O,), one after another.

    products: (K + 1, K + 1), the mean products of the inputs of the weights.
    """
    weights = weights.clone()
    # Row k of the upper factor holds the corrections of the later weights for an error of weight k.
    factor = torch.linalg.cholesky(torch.linalg.inv(products), upper=True)
    for k in range(weights.shape[1] - 1):
        exact = weights[:, k].clone()
        weights[:, k] = (exact / scale).round().clamp(-127, 127) * scale
        error = (exact - weights[:, k]) / factor[k, k]
        weights[:, k + 1 :] -= error[:, None] * factor[k, k + 1 :]
    return weights


def _products(inputs):
    """Returns the mean products, in float64, of 3x3 windows of the inputs (N, C, H, W), extended by 1, with
    themselves."""
    products, pixels = 0, 0
    for x in inputs:
        windows = F.unfold(x, 3, padding=1)[0]
        windows = torch.cat([windows, torch.ones_like(windows[:1])])
        products = products + (windows @ windows.T).double()
        pixels += windows.shape[1]
    products /= pixels
    return products + RIDGE * products.diagonal().mean() * torch.eye(len(products), dtype=products.dtype)
