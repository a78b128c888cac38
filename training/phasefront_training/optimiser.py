"""The optimiser: Muon for the weights of hidden layers, Adam for those of the first and last layer and for biases.

Muon treats the gradient of a layer as a matrix, filters by weights of a filter, and steps along the nearest orthogonal
matrix, so that all directions of a layer learn at the same rate. The hidden layers of a chain have matrices of the same
shape, so one batch holds all of them. torch.optim.Muon processes them one by one, which takes four times as long.
"""

import math

import torch

from .networks import Chain

MOMENTUM = 0.95
MUON_RATE = 2.5  # times the rate of Adam
MATCH_ADAM = 0.2  # times the root of the matrix's longer side, for steps as large as those of Adam
BETAS = (0.9, 0.99)
ROUNDS = ((3.4445, -4.7750, 2.0315),) * 5  # Newton-Schulz coefficients of the authors of Muon
LEAST_NORM = 1e-7


class MuonAndAdam:
    """Muon and Adam, with the part of the interface of a torch optimiser that the loop needs."""

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
        """Loads a state. Raises ValueError for the state of another optimiser."""
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
        # Views of the weights, so that a step changes the layers.
        self.matrices = [_as_matrix(weight.detach(), weight) for weight in weights]
        self.momentum = torch.zeros(len(weights), *self.matrices[0].shape, device=weights[0].device)

    def step(self, rate):
        # A frozen network has no gradient and does not change.
        if any(weight.grad is None for weight in self.weights):
            return
        gradients = torch.stack([_as_matrix(weight.grad, weight) for weight in self.weights])
        self.momentum.lerp_(gradients, 1 - MOMENTUM)
        updates = orthogonal(gradients.lerp(self.momentum, MOMENTUM))
        rate *= MATCH_ADAM * math.sqrt(max(updates.shape[1:]))
        for matrix, update in zip(self.matrices, updates.float()):
            matrix.sub_(update, alpha=rate)


def orthogonal(matrices):
    """Returns nearly orthogonal matrices (N, A, B) close to the given ones, by Newton-Schulz in bf16."""
    tall = matrices.shape[1] > matrices.shape[2]
    x = (matrices.mT if tall else matrices).bfloat16()
    x = x / x.flatten(1).norm(dim=1).clamp(min=LEAST_NORM)[:, None, None]
    for a, b, c in ROUNDS:
        gram = x @ x.mT
        x = torch.baddbmm(x, torch.baddbmm(gram, gram, gram, beta=b, alpha=c), x, beta=a)
    return x.mT if tall else x


def _as_matrix(values, weight):
    """Reshapes values (O, I, 3, 3) to (O, 9·I), in the memory order of `weight`, so that the result for weights is a
    view."""
    if weight.is_contiguous(memory_format=torch.channels_last):
        values = values.permute(0, 2, 3, 1)
    return values.reshape(len(values), -1)
