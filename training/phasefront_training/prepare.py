"""Converts a trained Chain to a Quantized network with a small rounding error, without training.

A pre-filter first gets its field in two parts (`in_two_parts`). Channels are scaled against each other (`equalise`),
and features against the network's input, which the last layer reads with them (`balance`). Neither changes the output,
because a ReLU scales with its input. Then ranges are chosen (`calibrate`), and a sum uses the same steps as the next
sum if that reduces the error (`share`): values to which a branch adds nothing are then not rounded again.
"""

import copy
from dataclasses import replace

import torch

from .networks import REMAINDER_GAIN, Chain
from .quantize import Quantized, activations, calibrate

LEVEL = 0.999  # quantile of a channel's values that counts as its maximum
EVERY = 7  # stride of the pixels for this quantile
EVENNESS = 0.5  # 1 gives all channels of a tensor the same size, but loses more in the weights than it gains
MOST_SCALED = 8.0
BALANCES = [2.0**k for k in range(-6, 5)]  # powers of two, which do not round float32 weights
SCENES = 4  # for comparing scales and ranges


def prepare(chain, examples):
    """Returns the Quantized network of a Chain and scales the Chain's channels. examples: a list of inputs (C, H,
    W)."""
    equalise(chain, examples)
    balance(chain, examples)
    return Quantized(chain, share(chain, calibrate(chain, examples), examples))


def in_two_parts(prefilter):
    """Returns the same pre-filter for a split field. A field rounded to u8 is too coarse for dark pixels, where the
    modulator's light cancels."""
    old = prefilter.architecture
    if old.input != "blurred-field":
        return prefilter
    network = Chain(replace(old, input="split-blurred-field"))
    with torch.no_grad():
        for conv, known in zip(network.convs, prefilter.convs):
            conv.bias.copy_(known.bias)
            of_remainders = known.weight[:, -6:] / REMAINDER_GAIN
            conv.weight.copy_(torch.cat([known.weight, of_remainders], 1)[:, : conv.in_channels])
    return network


def scale_channels(chain, writers, readers, factors):
    """Multiplies the output channels of the writers by factors (filters,) and divides the weights of the readers by
    them."""
    with torch.no_grad():
        for i in writers:
            chain.convs[i].weight *= factors[:, None, None, None]
            chain.convs[i].bias *= factors
        for i in readers:
            chain.convs[i].weight[:, : len(factors)] /= factors[:, None, None]


def scale_features(chain, factor):
    """Multiplies the features that a Chain's last layer reads and divides its weights, so that the output stays the
    same."""
    a = chain.architecture
    last = a.layers - 1
    # If the last layer has a skip, its features are sums of the outputs of every second layer.
    writers, readers = (range(0, last, 2), range(1, last + 1, 2)) if a.has_skip(last) else ([last - 1], [last])
    scale_channels(chain, writers, readers, torch.full((a.filters,), factor))


def equalise(chain, examples):
    """Scales the channels of each tensor to more similar sizes: the sums with common factors, and those in branches."""
    a = chain.architecture
    last = a.layers - 1
    found = _levels(chain, examples)
    sums = [level / level.max() for name, level in found.items() if name.startswith("add")]
    if sums:
        # With an even number of layers the last layer also reads the sums.
        readers = [*range(1, last, 2), *([last] if a.has_skip(last) else [])]
        writers = [i for i in range(0, last, 2) if i == 0 or a.has_skip(i + 1)]
        scale_channels(chain, writers, readers, _factors(torch.stack(sums).amax(0)))
    for i in range(1, last - 1, 2):
        scale_channels(chain, [i], [i + 1], _factors(found[f"relu_{i}"]))


def _levels(chain, examples):
    """Returns {tensor: (channels,)}, a bound of nearly all values of each channel."""
    found = {}
    with torch.no_grad():
        for x in examples[:SCENES]:
            for name, values in activations(chain, x[None]):
                if name not in ("input", "concat"):
                    level = values[0].flatten(1)[:, ::EVERY].quantile(LEVEL, dim=1)
                    found[name] = torch.maximum(found.get(name, level), level)
    return found


def _factors(levels):
    """Returns the factors for channels of these levels: 1 for nearly empty channels."""
    share = levels / levels.max()
    return torch.where(share > 1e-3, share.clamp(min=1e-3) ** -EVENNESS, 1.0).clamp(max=MOST_SCALED)


def balance(chain, examples):
    """Scales the features against the network's input by the power of two with the least error over inputs (C, H,
    W)."""
    exact = _outputs(chain, examples)

    def error(factor):
        scaled = copy.deepcopy(chain)
        scale_features(scaled, factor)
        return _loss(exact, Quantized(scaled, calibrate(scaled, examples[:SCENES])), examples)

    scale_features(chain, min(BALANCES, key=error))


def share(chain, ranges, examples):
    """Returns the ranges after replacing the range of each sum, from last to first, by the next sum's if that reduces
    the error."""
    sums = [name for name in ranges if name.startswith("add")]
    exact = _outputs(chain, examples)
    least = _loss(exact, Quantized(chain, ranges), examples)
    for name, after in reversed(list(zip(sums, sums[1:]))):
        shared = ranges | {name: ranges[after]}
        loss = _loss(exact, Quantized(chain, shared), examples)
        if loss < least:
            ranges, least = shared, loss
    return ranges


def _outputs(network, examples):
    with torch.no_grad():
        return [network(x[None]) for x in examples[:SCENES]]


def _loss(exact, quantized, examples):
    """Returns the mean square error of the outputs of a Quantized network."""
    return sum(float((a - b).square().mean()) for a, b in zip(_outputs(quantized, examples), exact))
