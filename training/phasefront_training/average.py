"""The running mean of the weights in training.

At a high learning rate the weights fluctuate around the values that they converge to when the rate falls. Their mean
over the last thousands of steps is close to these values, so a training without a fixed end can be evaluated and used
at any time.
"""

from contextlib import contextmanager

import torch


class Average:
    """The mean of the weights of `networks`, {name: module}, over about the last `horizon` steps."""

    def __init__(self, networks, horizon):
        self.networks, self.horizon = networks, horizon
        self.taken = 0
        self.means = {name: _copied(network) for name, network in networks.items()}

    @torch.no_grad()
    def add(self):
        """Adds the weights after a step. Over the first `horizon` steps the result is a plain mean."""
        self.taken += 1
        share = 1 / min(self.taken + 1, self.horizon)
        for name, network in self.networks.items():
            means = self.means[name]
            for key, value in network.state_dict().items():
                means[key].lerp_(value, share)

    @contextmanager
    def in_place(self):
        """Gives the networks the mean weights for the duration of the block."""
        own = {name: _copied(network) for name, network in self.networks.items()}
        self._set(self.means)
        try:
            yield
        finally:
            self._set(own)

    def _set(self, weights):
        for name, network in self.networks.items():
            network.load_state_dict(weights[name])

    def state_dict(self):
        """Returns the trained weights, to resume from. The means are the networks of the checkpoint."""
        return {"taken": self.taken, "trained": {name: _copied(network) for name, network in self.networks.items()}}

    def load_state_dict(self, state):
        """Resumes from networks that hold the means."""
        self.taken = state["taken"]
        self.means = {name: _copied(network) for name, network in self.networks.items()}
        self._set(state["trained"])


def _copied(network):
    return {key: value.detach().clone() for key, value in network.state_dict().items()}
