"""A deeper network from a trained one: residual pairs that begin as the identity, put in before the last layers."""

import torch

from .networks import Architecture, Chain

WAKE = 1e-6  # bias of a new pair's second layer: nothing to the output, but behind a ReLU a gradient needs more than 0


def grow(network, layers):
    """A Chain of `layers` layers that gives what `network` gives (to about 1e-5).

    Pairs add two layers, so both counts are even or both odd; raises ValueError otherwise.
    """
    old = network.architecture
    if layers < old.layers or (layers - old.layers) % 2:
        raise ValueError(
            f"{old.layers} layers grow by pairs, to {old.layers + 2}, {old.layers + 4} and so on, not to {layers}"
        )
    grown = Chain(Architecture(layers, old.filters, old.input, old.head))
    tail = 1 if old.layers % 2 == 0 else 2  # the layers behind the last residual pair
    with torch.no_grad():
        for i, conv in enumerate(network.convs):
            j = i if i < old.layers - tail else i + layers - old.layers
            grown.convs[j].load_state_dict(conv.state_dict())
        for j in range(old.layers - tail + 1, layers - tail, 2):
            grown.convs[j].weight.zero_()
            grown.convs[j].bias.fill_(WAKE)
    return grown
