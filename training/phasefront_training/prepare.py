"""From a trained Chain to a Quantized one, without training: what is done so that rounding costs little.

A pre-filter first takes its field in two parts (`in_two_parts`). Channels are scaled against each other (`equalise`), and
features against the network's input beside which the last layer reads them (`balance`); none of this changes what the
network gives, for a ReLU scales with what it reads. Then ranges are chosen (`calibrate`), and sums take the same steps as
the sums after them where that loses less (`share`): what a branch adds nothing to then passes on without being rounded
anew.
"""

import copy
from dataclasses import replace

import torch

from .networks import REMAINDER_GAIN, Chain
from .quantize import Quantized, activations, calibrate

LEVEL = 0.999  # of a channel's values lie under what counts as its greatest
EVERY = 7  # pixel counts for that
EVENNESS = 0.5  # 1 makes all channels of a tensor one size, which costs the weights more than the tensor gains
MOST_SCALED = 8.0
BALANCES = [2.0**k for k in range(-6, 5)]  # powers of two, which no float32 weight is rounded by
SCENES = 4  # that scales and ranges are compared on


def prepare(chain, examples):
    """The Quantized network of a Chain, whose channels it scales in place. examples: a list of inputs (C, H, W)."""
    equalise(chain, examples)
    balance(chain, examples)
    return Quantized(chain, share(chain, calibrate(chain, examples), examples))


def in_two_parts(prefilter):
    """The same pre-filter for a split field: dark pixels, at which the modulator's light cancels, cannot bear a field rounded to u8."""
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
    """Multiplies the channels that layers give by factors (filters,), and divides what reads them by the same."""
    with torch.no_grad():
        for i in writers:
            chain.convs[i].weight *= factors[:, None, None, None]
            chain.convs[i].bias *= factors
        for i in readers:
            chain.convs[i].weight[:, : len(factors)] /= factors[:, None, None]


def scale_features(chain, factor):
    """Multiplies the features that a Chain's last layer reads, and divides what reads them: its output stays the same."""
    a = chain.architecture
    last = a.layers - 1
    # Features that the last layer takes as a sum with a skip are sums of what every second layer gives.
    writers, readers = (range(0, last, 2), range(1, last + 1, 2)) if a.has_skip(last) else ([last - 1], [last])
    scale_channels(chain, writers, readers, torch.full((a.filters,), factor))


def equalise(chain, examples):
    """Scales channels of each tensor nearer to one size: those of the sums, all alike, and those within branches."""
    a = chain.architecture
    last = a.layers - 1
    found = _levels(chain, examples)
    sums = [level / level.max() for name, level in found.items() if name.startswith("add")]
    if sums:
        # With an even number of layers the last one reads the sums too.
        readers = [*range(1, last, 2), *([last] if a.has_skip(last) else [])]
        writers = [i for i in range(0, last, 2) if i == 0 or a.has_skip(i + 1)]
        scale_channels(chain, writers, readers, _factors(torch.stack(sums).amax(0)))
    for i in range(1, last - 1, 2):
        scale_channels(chain, [i], [i + 1], _factors(found[f"relu_{i}"]))


def _levels(chain, examples):
    """{tensor: (channels,)}: what nearly all of each channel's values lie under."""
    found = {}
    with torch.no_grad():
        for x in examples[:SCENES]:
            for name, values in activations(chain, x[None]):
                if name not in ("input", "concat"):
                    level = values[0].flatten(1)[:, ::EVERY].quantile(LEVEL, dim=1)
                    found[name] = torch.maximum(found.get(name, level), level)
    return found


def _factors(levels):
    """What channels of these levels are multiplied by; those where hardly anything is are left."""
    share = levels / levels.max()
    return torch.where(share > 1e-3, share.clamp(min=1e-3) ** -EVENNESS, 1.0).clamp(max=MOST_SCALED)


def balance(chain, examples):
    """Scales the features against the network's input by the power of two that loses least over a list of inputs (C, H, W)."""
    exact = _outputs(chain, examples)

    def error(factor):
        scaled = copy.deepcopy(chain)
        scale_features(scaled, factor)
        return _loss(exact, Quantized(scaled, calibrate(scaled, examples[:SCENES])), examples)

    scale_features(chain, min(BALANCES, key=error))


def share(chain, ranges, examples):
    """The ranges, each sum's, from the last to the first, that of the sum after it where this loses less."""
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
    """The mean square by which a Quantized's outputs differ from the exact ones."""
    return sum(float((a - b).square().mean()) for a, b in zip(_outputs(quantized, examples), exact))
