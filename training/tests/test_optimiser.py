import pytest
import torch

from phasefront_training.networks import Architecture, Chain
from phasefront_training.optimiser import MOMENTUM, MUON_RATE, Muon, MuonAndAdam


@pytest.mark.parametrize("memory", [torch.contiguous_format, torch.channels_last])
def test_hidden_layers_step_along_orthogonal_matrices_and_everything_steps(memory):
    torch.manual_seed(0)
    network = Chain(Architecture(5, 8)).to(memory_format=memory)
    before = [p.detach().clone() for p in network.parameters()]
    optimiser = MuonAndAdam(network, 1e-2)
    network(torch.rand(1, 4, 16, 16).contiguous(memory_format=memory)).square().mean().backward()
    optimiser.step()
    for p, old in zip(network.parameters(), before):
        assert not torch.equal(p, old)
    for conv, old in zip(network.convs[1:-1], before[2:-2:2]):
        step = (conv.weight - old).flatten(1)
        values = torch.linalg.svdvals(step) / (1e-2 * MUON_RATE * 0.2 * 72**0.5)
        # Five rounds of Newton-Schulz bring singular values close to 1: at worst 0.5 to 1.5, according to Muon's
        # authors.
        assert values.max() < 1.6 and values.median() > 0.5


def test_both_memory_formats_take_the_same_steps():
    results = []
    for memory in (torch.contiguous_format, torch.channels_last):
        torch.manual_seed(0)
        network = Chain(Architecture(5, 8)).to(memory_format=memory)
        optimiser = MuonAndAdam(network, 1e-2)
        for _ in range(3):
            network.zero_grad()
            network(torch.linspace(-1, 1, 4 * 256).view(1, 4, 16, 16)).square().mean().backward()
            optimiser.step()
        results.append([p.detach().clone() for p in network.parameters()])
    for a, b in zip(*results):
        assert torch.allclose(a, b, atol=2e-3)


def test_the_state_of_another_optimiser_is_refused():
    network = Chain(Architecture(4))
    other = torch.optim.Adam(network.parameters()).state_dict()
    with pytest.raises(ValueError, match="--init"):
        MuonAndAdam(network, 1e-2).load_state_dict(other)


def test_the_matrices_of_a_chain_taken_together_step_as_torch_takes_each():
    torch.manual_seed(0)
    ours = [torch.nn.Parameter(torch.randn(8, 8, 3, 3)) for _ in range(3)]
    theirs = [torch.nn.Parameter(p.detach().reshape(8, 72).clone()) for p in ours]
    muon = Muon(ours)
    torchs = torch.optim.Muon(theirs, lr=1e-2, weight_decay=0.0, momentum=MOMENTUM, adjust_lr_fn="match_rms_adamw")
    before = ours[0].detach().clone()
    for _ in range(3):
        for mine, its in zip(ours, theirs):
            mine.grad = torch.randn(8, 8, 3, 3)
            its.grad = mine.grad.reshape(8, 72)
        muon.step(1e-2)
        torchs.step()
    for mine, its in zip(ours, theirs):
        assert torch.allclose(mine.reshape(8, 72), its, atol=5e-4)
    assert (ours[0] - before).abs().mean() > 2e-3
