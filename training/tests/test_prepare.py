import copy

import pytest
import torch

from phasefront_training.encode import DeepDoublePhase
from phasefront_training.networks import Architecture, Chain
from phasefront_training.optics import Display
from phasefront_training.prepare import balance, equalise, in_two_parts, prepare, scale_features, share
from phasefront_training.quantize import Quantized, calibrate
from phasefront_training.rounding import in_order, round_in_order
from phasefront_training.stage2 import prefilter_network

CASES = [Architecture(layers, 8, input) for layers in (3, 4, 7, 8) for input in ("rgbd", "seeded")]


def network(architecture, seed=0):
    """Returns a Chain whose channels have very different sizes."""
    torch.manual_seed(seed)
    chain = Chain(architecture)
    with torch.no_grad():
        for conv in chain.convs[:-1]:
            factors = 10 ** (torch.rand(len(conv.weight)) - 0.5)
            conv.weight *= factors[:, None, None, None]
            conv.bias.uniform_(0, 0.1)
    return chain


def inputs(architecture, count=3):
    torch.manual_seed(1)
    noise = torch.rand(count, architecture.input_channels, 40, 40)
    return torch.nn.functional.avg_pool2d(noise, 5, 1, 2) - 0.5


def loss(chain, quantized, seen):
    with torch.no_grad():
        return float((quantized(seen) - chain(seen)).square().mean())


@pytest.mark.parametrize("architecture", CASES, ids=str)
def test_scaled_features_change_nothing(architecture):
    chain = network(architecture)
    x = torch.rand(2, architecture.input_channels, 17, 13) - 0.5
    with torch.no_grad():
        before = chain(x)
        scale_features(chain, 0.25)
        assert torch.equal(chain(x), before)


@pytest.mark.parametrize("layers", [8, 7])
def test_features_are_balanced_against_the_input(layers):
    chain = network(Architecture(layers, 8))
    with torch.no_grad():
        chain.convs[-1].weight[:, 8:] = 0
        chain.convs[-1].weight[:3, 8:11, 1, 1] = -torch.eye(3)  # trained networks subtract part of the image
        chain.convs[-1].weight[:, :8] *= 0.1
    seen = torch.rand(3, 4, 32, 32) - 0.5

    def error():
        with torch.no_grad():
            return float((Quantized(chain, calibrate(chain, seen))(seen) - chain(seen)).square().mean())

    before = error()
    balance(chain, seen)
    assert error() < 0.5 * before


@pytest.mark.parametrize("architecture", CASES, ids=str)
def test_equalised_channels_change_nothing_but_their_size(architecture):
    chain, seen = network(architecture), inputs(architecture)
    equal = copy.deepcopy(chain)
    equalise(equal, seen)
    with torch.no_grad():
        assert torch.allclose(equal(seen), chain(seen), rtol=1e-4, atol=1e-5)
    if architecture.layers < 4:
        return

    def spread(chain):
        with torch.no_grad():
            features = torch.relu(chain.convs[1](torch.relu(chain.convs[0](seen))))
        return float(features.transpose(0, 1).flatten(1).quantile(0.999, dim=1).log().std())

    assert spread(equal) < 0.8 * spread(chain)


def test_sums_share_steps_where_that_loses_less():
    architecture = Architecture(9, 8)
    chain, seen = network(architecture), inputs(architecture)
    ranges = calibrate(chain, seen)
    ranges["add_5"] = (0.0, 40 * ranges["add_7"][1])  # far too coarse
    shared = share(chain, ranges, seen)
    assert shared["add_5"] == shared["add_7"] == ranges["add_7"]
    assert shared["add_3"] in (ranges["add_3"], ranges["add_7"])
    assert loss(chain, Quantized(chain, shared), seen) < loss(chain, Quantized(chain, ranges), seen)
    assert share(chain, shared, seen) == shared


@pytest.mark.parametrize("architecture", CASES, ids=str)
def test_rounding_in_order_loses_less_than_rounding_each(architecture):
    chain, seen = network(architecture), inputs(architecture)
    quantized = prepare(copy.deepcopy(chain), seen)
    quantized.activation = lambda name, x: x  # of weights alone
    settled = copy.deepcopy(quantized)
    round_in_order(settled, seen)
    assert loss(chain, settled, seen) < 0.8 * loss(chain, quantized, seen)
    for i, conv in enumerate(settled.chain.convs):
        steps = conv.weight / settled.scales[i][:, None, None, None]
        assert (steps - steps.round()).abs().max() < 1e-3 and steps.abs().max() < 127.5


def test_in_order_an_error_is_made_good_by_what_goes_together():
    # Of two weights of the same input, the second compensates the rounding error of the first.
    products = torch.ones(3, 3, dtype=torch.float64) + 1e-9 * torch.eye(3, dtype=torch.float64)
    rounded = in_order(torch.tensor([[1.4, 1.4, 0.0]], dtype=torch.float64), torch.ones(1, dtype=torch.float64), products)
    assert rounded[0, 0] == 1 and rounded[0, 1] == 2
    assert abs(float(rounded.sum()) - 2.8) < 1e-3


def test_a_field_in_two_parts_is_the_same_field_and_rounds_less():
    chain = prefilter_network(4)
    with torch.no_grad():
        chain.convs[-1].weight[:3, 8:11, 1, 1] = 0.5 * torch.eye(3)  # pre-filters undo part of the blur
    field = torch.polar(torch.rand(2, 3, 40, 40) ** 4, 0.3 * torch.randn(2, 3, 40, 40))

    def filtered(prefilter):
        with torch.no_grad():
            return DeepDoublePhase(Chain(Architecture(3, 8)), prefilter, 0.0, Display()).filtered(field)

    def lost(prefilter):
        model = DeepDoublePhase(Chain(Architecture(3, 8)), prefilter, 0.0, Display())
        seen = list(model.seen_by_prefilter(field))
        quantized = prepare(copy.deepcopy(prefilter), seen)
        round_in_order(quantized, seen)
        return float((filtered(quantized) - exact).abs().square().mean())

    exact, split = filtered(chain), in_two_parts(chain)
    assert split.architecture.input == "split-blurred-field" and in_two_parts(split) is split
    assert torch.allclose(filtered(split), exact, atol=1e-5)
    assert 0 < lost(split) < 0.1 * lost(chain)
