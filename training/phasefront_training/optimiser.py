"""What takes the steps: Muon for the hidden layers' weights, Adam for the first and last layer's and for biases.

Muon takes a layer's gradient as a matrix, filters by weights of a filter, and steps along the orthogonal matrix next to
it, so that all directions of a layer learn alike.
"""

import torch

from .networks import Chain

MOMENTUM = 0.95
MUON_RATE = 2.5  # times Adam's
BETAS = (0.9, 0.99)


class MuonAndAdam:
    """Both, with as much of a torch optimiser's face as the loop needs."""

    def __init__(self, module, learning_rate):
        chains = (chain for chain in module.modules() if isinstance(chain, Chain))
        self.hidden = [conv.weight for chain in chains for conv in chain.convs[1:-1]]
        # Muon takes matrices: views of the weights, so that a step on them is one on the layer.
        self.matrices = [torch.nn.Parameter(_as_matrix(weight.detach(), weight)) for weight in self.hidden]
        hidden = set(map(id, self.hidden))
        rest = [p for p in module.parameters() if id(p) not in hidden]
        self.parts = {
            "muon": torch.optim.Muon(self.matrices, weight_decay=0.0, momentum=MOMENTUM, adjust_lr_fn="match_rms_adamw"),
            "adam": torch.optim.Adam(rest, betas=BETAS, fused=True),
        }
        self.set_rate(learning_rate)

    def set_rate(self, rate):
        for name, part in self.parts.items():
            for group in part.param_groups:
                group["lr"] = rate * MUON_RATE if name == "muon" else rate

    def step(self):
        for matrix, weight in zip(self.matrices, self.hidden):
            # A network that is only passed through has no gradient, and stays.
            matrix.grad = None if weight.grad is None else _as_matrix(weight.grad, weight)
        for part in self.parts.values():
            part.step()

    def state_dict(self):
        return {name: part.state_dict() for name, part in self.parts.items()}

    def load_state_dict(self, state):
        """Raises ValueError for the state of another optimiser."""
        if state.keys() != self.parts.keys():
            raise ValueError("the training to resume took other steps; begin a new one with its network: --init")
        for name, part in self.parts.items():
            part.load_state_dict(state[name])


def _as_matrix(values, weight):
    """values (O, I, 3, 3) as (O, 9·I), in the order in which `weight` lies in memory, so that of weights it is a view."""
    if weight.is_contiguous(memory_format=torch.channels_last):
        values = values.permute(0, 2, 3, 1)
    return values.reshape(len(values), -1)
