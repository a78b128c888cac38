import pytest
import torch

from phasefront_training.grow import grow, of_depths, widen
from phasefront_training.networks import Architecture, Chain, multiplies_per_pixel, shuffle, unshuffle


def test_sizes_are_the_papers():
    counts = [multiplies_per_pixel(Architecture(layers)) for layers in (30, 15, 8)]
    assert counts == [147528, 69768, 33480]
    assert sum(p.numel() for p in Chain(Architecture(30)).parameters()) == 148230
    prefilter = Architecture(8, 8, "field")
    assert multiplies_per_pixel(prefilter) == 9 * (6 * 8 + 6 * 64 + 14 * 6)


@pytest.mark.parametrize(("layers", "to"), [(4, 8), (5, 9), (8, 15), (8, 30), (15, 31)])
def test_growing_stays_near_the_old_network_and_all_units_live(layers, to):
    torch.manual_seed(0)
    small = Chain(Architecture(layers))
    for conv in small.convs:
        torch.nn.init.normal_(conv.bias, std=0.1)
    x = torch.rand(1, 4, 20, 24) - 0.5
    big = grow(small, to)
    assert (big(x) - small(x)).square().mean() < 0.02 * small(x).var()
    big(x).square().mean().backward()
    assert all(conv.weight.grad.abs().amax((1, 2, 3)).gt(0).float().mean() > 0.8 for conv in big.convs)


def test_growing_from_odd_to_even_is_near_the_old_network():
    small = Chain(Architecture(5))
    with torch.no_grad():
        small.convs[-1].weight *= 10
    examples = [torch.rand(4, 40, 40) - 0.5 for _ in range(3)]
    big = grow(small, 10, examples)
    x = torch.rand(1, 4, 32, 32) - 0.5
    error = (big(x) - small(x)).square().mean() / small(x).var()
    assert error < 0.03
    with pytest.raises(ValueError, match="examples"):
        grow(small, 10)


def test_networks_do_not_shrink():
    with pytest.raises(ValueError, match="8 layers does not grow to 4"):
        grow(Chain(Architecture(8)), 4)


@pytest.mark.parametrize(("of", "to"), [("rgbd", "rgbdxy"), ("rgbd", "ldi3"), ("ldi2", "ldi5")])
def test_a_network_that_is_told_more_begins_with_what_it_knew(of, to):
    knew = Chain(Architecture(5, input=of))
    told = widen(knew, to)
    x = torch.rand(1, told.architecture.input_channels, 16, 20) - 0.5
    assert torch.allclose(told(x), knew(x[:, : knew.architecture.input_channels]), atol=1e-6)
    told(x).square().mean().backward()
    new = told.convs[0].weight.grad[:, knew.architecture.input_channels :]
    assert new.abs().amax((1, 2, 3)).gt(0).float().mean() > 0.5


@pytest.mark.parametrize(("of", "to"), [("ldi2", "rgbd"), ("rgbdxy", "ldi2"), ("field", "rgbd"), ("rgbd", "seeded"), ("ldi3", "ldi2")])
def test_a_network_is_told_nothing_less_and_nothing_else(of, to):
    with pytest.raises(ValueError, match="do not begin with"):
        widen(Chain(Architecture(5, input=of)), to)


@pytest.mark.parametrize("architecture", [Architecture(5, 4), Architecture(5, 4, halved=True), Architecture(4, 4, "ldi3"), Architecture(4, 4, "seeded")], ids=str)
def test_a_network_for_stretched_depths_gives_the_same(architecture):
    torch.manual_seed(2)
    network = Chain(architecture)
    x = torch.rand(1, architecture.input_channels, 12, 16) - 0.5
    stretched = x.clone()
    stretched[:, 3 : 4 * architecture.ldi_layers : 4] *= 0.5
    assert torch.allclose(of_depths(network, 0.5)(stretched), network(x), atol=1e-6)
    assert not torch.allclose(network(stretched), network(x), atol=1e-3)


def test_heads_mean_what_the_contract_says():
    x = torch.rand(1, 4, 16, 16) - 0.5
    residual = Chain(Architecture(4))
    out = residual(x)
    field = residual.field(x)
    assert torch.allclose(field.real, x[:, :3] + 0.5 + out[:, :3]) and torch.equal(field.imag, out[:, 3:])
    paper = Chain(Architecture(4, head="amplitude-phase"))
    out, field = paper(x), paper.field(x)
    assert torch.allclose(field.abs(), (out[:, :3] + 1) * 0.5**0.5, atol=1e-6)
    assert torch.allclose(field.angle(), torch.pi * out[:, 3:], atol=1e-5)
    prefilter = Chain(Architecture(4, 8, "field"))
    h = torch.randn(1, 6, 16, 16)
    assert torch.allclose(prefilter.field(h).imag, h[:, 3:] + prefilter(h)[:, 3:])


@pytest.mark.parametrize("wrong", [{"layers": 2}, {"layers": 8, "head": "x"}, {"layers": 8, "input": "ldi"}, {"layers": 8, "input": "rgb"}])
def test_wrong_architectures_are_refused(wrong):
    with pytest.raises(ValueError):
        Architecture(**wrong)


@pytest.mark.parametrize("name", ["ldi0", "ldi1", "ldi10", "ldi12", "ldi23", "ldi²", "ldi"])
def test_inputs_that_the_core_refuses_are_refused(name):
    with pytest.raises(ValueError, match="ldi2 to ldi9"):
        Architecture(8, input=name)


@pytest.mark.parametrize("count", range(2, 10))
def test_layered_inputs_that_the_core_takes_are_taken(count):
    assert Architecture(8, input=f"ldi{count}").input_channels == 4 * count


@pytest.mark.parametrize("size", [(16, 20), (17, 23)])
def test_a_halved_network_is_a_network_on_squares_of_pixels(size):
    halved = Chain(Architecture(5, 8, halved=True))
    x = torch.rand(1, 4, *size) - 0.5
    assert torch.equal(shuffle(unshuffle(x[..., :16, :20])), x[..., :16, :20])
    out = halved(x)
    assert out.shape == (1, 6, *size)
    assert multiplies_per_pixel(halved.architecture) == 9 * (16 * 8 + 3 * 64 + 24 * 24) / 4
    # The reach is exactly twice the number of layers.
    near, far = x.clone(), x.clone()
    near[..., 10:] += 1
    far[..., 12:] += 1
    assert (halved(near) != out)[..., :2].any()
    assert not (halved(far) != out)[..., :2].any()
