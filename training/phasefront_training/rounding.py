"""Weights of an int8 network rounded in order, so that errors do not add up.

Rounding each weight to its nearest step leaves errors that add up in a sum of 216 products. Here a filter's weights are
rounded one after another, and those not yet rounded make good, as far as their inputs go together, what that changed:
optimal brain compression (Frantar and Alistarh 2022), in the order of their GPTQ. What goes together is seen on inputs
that the rounded layers before give.
"""

import torch
from torch.nn import functional as F

SCENES = 2  # whose pixels show which inputs go together
RIDGE = 1e-3  # of the inputs' mean power


@torch.no_grad()
def round_in_order(quantized, examples):
    """Settles the scales of a Quantized network's weights, and its weights on their steps; biases make good the rest.

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
    """Weights (O, K + 1) of which the first K are rounded to steps of scale (O,), one after another.

    products: (K + 1, K + 1), the mean products of what they multiply.
    """
    weights = weights.clone()
    # Row k of the upper factor says what an error of weight k asks of those behind it.
    factor = torch.linalg.cholesky(torch.linalg.inv(products), upper=True)
    for k in range(weights.shape[1] - 1):
        exact = weights[:, k].clone()
        weights[:, k] = (exact / scale).round().clamp(-127, 127) * scale
        error = (exact - weights[:, k]) / factor[k, k]
        weights[:, k + 1 :] -= error[:, None] * factor[k, k + 1 :]
    return weights


def _products(inputs):
    """Mean products of 3x3 windows of the inputs (N, C, H, W), and 1 behind, with themselves, in float64."""
    products, pixels = 0, 0
    for x in inputs:
        windows = F.unfold(x, 3, padding=1)[0]
        windows = torch.cat([windows, torch.ones_like(windows[:1])])
        products = products + (windows @ windows.T).double()
        pixels += windows.shape[1]
    products /= pixels
    return products + RIDGE * products.diagonal().mean() * torch.eye(len(products), dtype=products.dtype)
