import torch
from torch.nn import functional as F

from phasefront_training.data import Manifest, Scenes
from phasefront_training.loop import Budget, Workers, fit, read_curve
from phasefront_training.networks import Architecture, Chain
from phasefront_training.revive import revive
from phasefront_training.stage1 import REVIVAL_STEPS, Stage1


def firing(network, x):
    """Returns the fraction of pixels where each unit of each hidden layer fires."""
    seen = []
    hooks = [conv.register_forward_hook(lambda _, __, output: seen.append(output)) for conv in network.convs[:-1]]
    network(x)
    for hook in hooks:
        hook.remove()
    return [(F.relu(output) > 0).float().mean((0, 2, 3)) for output in seen]


def test_dead_units_fire_again_and_change_little():
    torch.manual_seed(0)
    network = Chain(Architecture(7, 8))
    x = torch.rand(3, 4, 24, 24) - 0.5
    with torch.no_grad():
        network.convs[-1].weight *= 10
        network.convs[1].bias[:3] = -100
        network.convs[2].bias[:] = -100  # a whole layer
        network.convs[3].bias[2] = -100
    before, dead = network(x), [share == 0 for share in firing(network, x)]
    counts = [int(d.sum()) for d in dead]
    assert counts[1] >= 3 and counts[2] == 8 and counts[3] >= 1
    assert revive(network, x) >= sum(counts)
    assert all((share[d] > 0.1).all() for share, d in zip(firing(network, x), dead))
    change = (network(x) - before).square().mean() / before.var()
    assert 0 < change < 0.1, change
    assert revive(network, x) == 0


def test_what_lives_stays_as_it_is():
    torch.manual_seed(0)
    network = Chain(Architecture(5, 8))
    x = torch.rand(2, 4, 24, 24) - 0.5
    assert all((share > 0).all() for share in firing(network, x))
    before = [p.clone() for p in network.parameters()]
    assert revive(network, x) == 0
    assert all(torch.equal(a, b) for a, b in zip(before, network.parameters()))


def test_a_training_revives_in_its_first_part(data_folder, tmp_path):
    torch.manual_seed(0)
    network = Chain(Architecture(5, 8))
    with torch.no_grad():
        network.convs[1].bias[:3] = -100
    scenes = Scenes(Manifest.read(data_folder), "train")
    here = Workers(0, 1, torch.device("cpu"))
    task = Stage1(network, scenes, scenes, here, crop=32, planes=0, bf16=False)
    assert task.revive(1, 0.0) == task.revive(REVIVAL_STEPS, 0.9) == 0
    fit(task, Budget(steps=2), 1e-3, tmp_path, here)
    assert read_curve(tmp_path / "curve.jsonl")[0]["revived"] >= 3
    assert (network.convs[1].bias > -10).all()
