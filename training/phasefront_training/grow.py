"""Makes a deeper network, or a network with more input channels, from a trained network. It starts with nearly the same
output.

A chain with an even number of layers has a first layer, residual pairs and the last layer. A chain with an odd number
has one more layer without a skip before the last. New residual pairs start with a tenth of the weights of a fresh pair:
near the identity, but with units that fire, because a branch that starts at zero dies behind its ReLU in the first
steps. From even to odd, the new single layer is a copying kernel. From odd to even, the single layer becomes half of a
pair, whose skip adds a term that the old network did not have. The other half copies with a gain of four, so that this
term has little weight, and the last layer is fitted again to the old output by least squares over examples.

For new input channels (hidden layers of a layered depth image, the place in the frame) the weights start at zero.
"""

import copy
from dataclasses import replace

import torch
from torch.nn import functional as F

from .networks import Chain

BRANCH = 0.1  # factor of the weights of a new residual branch
GAIN = 4.0  # of the copy, so that it outweighs the term of the skip
RIDGE = 1e-6  # fraction of the mean diagonal, in the fit of the last layer


def grow(network, layers, examples=()):
    """Returns a Chain of `layers` layers with nearly the output of `network`: the new branches are small.

    examples: network inputs (C, H, W), required from an odd to an even number of layers. Raises ValueError if the
    network cannot grow to this number.
    """
    old = network.architecture
    if layers < old.layers:
        raise ValueError(f"a network of {old.layers} layers does not grow to {layers}")
    if (layers - old.layers) % 2 == 0:
        return _insert_pairs(network, layers)
    if old.layers % 2 == 0:
        return _append_copy(_insert_pairs(network, layers - 1))
    return _insert_pairs(_refit(network, _append_copy(network, GAIN), examples), layers)


def widen(network, kind):
    """Returns a Chain for inputs of `kind` with the output of `network` for the first of their channels.

    Raises ValueError if inputs of `kind` do not begin with the channels of the network's input.
    """
    old = network.architecture
    new = replace(old, input=kind)
    images = "rgbd", "rgbdxy", "ldi"
    continues = old.input == "rgbd" or old.input.startswith("ldi") and kind.startswith("ldi")
    if not (continues and kind.startswith(images) and new.input_channels >= old.input_channels):
        raise ValueError(f"inputs '{kind}' do not begin with those of the network, '{old.input}'")
    wide = Chain(new)
    with torch.no_grad():
        for conv, known in zip(wide.convs, network.convs):
            conv.weight.zero_()
            conv.weight[:, : known.in_channels] = known.weight
            conv.bias.copy_(known.bias)
    return wide


def of_depths(network, stretch):
    """Returns a Chain whose output for depths stretched about the middle by this factor equals that of `network` for
    the original depths."""
    a = network.architecture
    places = [k for k in range(a.input_channels) if k % 4 == 3 and k < 4 * a.ldi_layers]
    other = copy.deepcopy(network)
    with torch.no_grad():
        for conv in (other.convs[0], other.convs[-1]):
            given = conv.in_channels - (a.filters if conv is other.convs[-1] else 0)
            behind = conv.in_channels - given
            for pixel in range(given // a.input_channels):
                conv.weight[:, [behind + pixel * a.input_channels + k for k in places]] /= stretch
    return other


def _chain(old, layers):
    return Chain(replace(old, layers=layers))


def _insert_pairs(network, layers):
    old = network.architecture
    grown = _chain(old, layers)
    tail = 1 if old.layers % 2 == 0 else 2  # the number of layers after the last residual pair
    with torch.no_grad():
        for i, conv in enumerate(network.convs):
            j = i if i < old.layers - tail else i + layers - old.layers
            grown.convs[j].load_state_dict(conv.state_dict())
        for j in range(old.layers - tail + 1, layers - tail, 2):
            grown.convs[j].weight *= BRANCH
    return grown


def _append_copy(network, gain=1.0):
    """Adds a layer before the last, whose kernel copies with a gain. Features are not negative, so its ReLU has no
    effect."""
    old = network.architecture
    grown = _chain(old, old.layers + 1)
    with torch.no_grad():
        for i, conv in enumerate(network.convs[:-1]):
            grown.convs[i].load_state_dict(conv.state_dict())
        torch.nn.init.dirac_(grown.convs[-2].weight)
        grown.convs[-2].weight *= gain
        grown.convs[-2].bias.zero_()
        grown.convs[-1].load_state_dict(network.convs[-1].state_dict())
    return grown


def _refit(network, grown, examples):
    """Fits the last layer of `grown` to the output of the last layer of `network`, before any tanh."""
    seen = []
    hooks = [
        grown.convs[-1].register_forward_pre_hook(lambda _, given: seen.append(given[0])),
        network.convs[-1].register_forward_hook(lambda _, __, output: seen.append(output)),
    ]
    gram, moment = 0, 0
    with torch.no_grad():
        for x in examples:
            seen.clear()
            grown(x[None])
            network(x[None])
            windows = F.unfold(seen[0], 3, padding=1)[0].double()
            windows = torch.cat([windows, torch.ones_like(windows[:1])])
            gram = gram + windows @ windows.T
            moment = moment + windows @ seen[1][0].flatten(1).T.double()
        if not isinstance(gram, torch.Tensor):
            raise ValueError(f"from {network.architecture.layers} layers to an even number, growing needs examples")
        gram += RIDGE * gram.diagonal().mean() * torch.eye(len(gram), dtype=gram.dtype)
        fitted = torch.linalg.solve(gram, moment).T.float()
        grown.convs[-1].weight.copy_(fitted[:, :-1].reshape_as(grown.convs[-1].weight))
        grown.convs[-1].bias.copy_(fitted[:, -1])
    for hook in hooks:
        hook.remove()
    return grown
