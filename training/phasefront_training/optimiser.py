"""What takes the steps: Muon for the hidden layers' weights, Adam for the first and last layer's and for biases.

Muon takes a layer's gradient as a matrix, filters by weights of a filter, and steps along the orthogonal matrix next to
it, so that all directions of a layer learn alike. The hidden layers of a chain have matrices of one shape and are taken
together: torch.optim.Muon takes them one by one, which costs four times as much.
"""

import math

import torch

from .networks import Chain

MOMENTUM = 0.95
MUON_RATE = 2.5  # times Adam's
MATCH_ADAM = 0.2  # of the root of the matrix's longer side: steps as large as Adam's
BETAS = (0.9, 0.99)
ROUNDS = ((3.4445, -4.7750, 2.0315),) * 5  # Newton-Schulz, as Muon's makers have it
LEAST_NORM = 1e-7


class MuonAndAdam:
    """Both, with as much of a torch optimiser's face as the loop needs."""

    def __init__(self, module, learning_rate):
        chains = [chain for chain in module.modules() if isinstance(chain, Chain)]
        self.chains = [Muon([conv.weight for conv in chain.convs[1:-1]]) for chain in chains]
        hidden = {id(weight) for chain in self.chains for weight in chain.weights}
        rest = [p for p in module.parameters() if id(p) not in hidden]
        self.adam = torch.optim.Adam(rest, betas=BETAS, fused=True)
        self.set_rate(learning_rate)

    def set_rate(self, rate):
        self.rate = rate
        for group in self.adam.param_groups:
            group["lr"] = rate

    def step(self):
        for chain in self.chains:
            chain.step(self.rate * MUON_RATE)
        self.adam.step()

    def state_dict(self):
        return {"muon": [chain.momentum for chain in self.chains], "adam": self.adam.state_dict()}

    def load_state_dict(self, state):
        """Raises ValueError for the state of another optimiser."""
        known = state.keys() == {"muon", "adam"} and isinstance(state["muon"], list) and len(state["muon"]) == len(self.chains)
        if not known:
            raise ValueError("the training to resume took other steps; begin a new one with its network: --init")
        for chain, momentum in zip(self.chains, state["muon"]):
            chain.momentum.copy_(momentum)
        self.adam.load_state_dict(state["adam"])


class Muon:
    """Muon for weights (O, I, 3, 3) of one shape."""

    def __init__(self, weights):
        self.weights = weights
        # Views of the weights, so that a step on them is one on the layers.
        self.matrices = [_as_matrix(weight.detach(), weight) for weight in weights]
        self.momentum = torch.zeros(len(weights), *self.matrices[0].shape, device=weights[0].device)

    def step(self, rate):
        # A network that is only passed through has no gradient, and stays.
        if any(weight.grad is None for weight in self.weights):
            return
        gradients = torch.stack([_as_matrix(weight.grad, weight) for weight in self.weights])
        self.momentum.lerp_(gradients, 1 - MOMENTUM)
        updates = orthogonal(gradients.lerp(self.momentum, MOMENTUM))
        rate *= MATCH_ADAM * math.sqrt(max(updates.shape[1:]))
        for matrix, update in zip(self.matrices, updates.float()):
            matrix.sub_(update, alpha=rate)


def orthogonal(matrices):
    """Matrices (N, A, B), nearly orthogonal ones next to the given ones, by Newton-Schulz in bf16."""
    tall = matrices.shape[1] > matrices.shape[2]
    x = (matrices.mT if tall else matrices).bfloat16()
    x = x / x.flatten(1).norm(dim=1).clamp(min=LEAST_NORM)[:, None, None]
    for a, b, c in ROUNDS:
        gram = x @ x.mT
        x = torch.baddbmm(x, torch.baddbmm(gram, gram, gram, beta=b, alpha=c), x, beta=a)
    return x.mT if tall else x


def _as_matrix(values, weight):
    """values (O, I, 3, 3) as (O, 9·I), in the order in which `weight` lies in memory, so that of weights it is a view."""
    if weight.is_contiguous(memory_format=torch.channels_last):
        values = values.permute(0, 2, 3, 1)
    return values.reshape(len(values), -1)
