"""The running mean of a training's weights.

Weights at a high rate jump about the place that they would come to rest at as the rate falls; their mean over the last
thousands of steps lies near it. So a training whose end is open can be judged, and used, at any time.
"""

from contextlib import contextmanager

import torch


class Average:
    """The mean over about the last `horizon` steps of the weights of `networks`, {name: module}."""

    def __init__(self, networks, horizon):
        self.networks, self.horizon = networks, horizon
        self.taken = 0
        self.means = {name: _copied(network) for name, network in networks.items()}

    @torch.no_grad()
    def add(self):
        """Takes in the weights after a step; the first ones are a plain mean."""
        self.taken += 1
        share = 1 / min(self.taken + 1, self.horizon)
        for name, network in self.networks.items():
            means = self.means[name]
            for key, value in network.state_dict().items():
                means[key].lerp_(value, share)

    @contextmanager
    def in_place(self):
        """The networks have the means as their weights for the time of the block."""
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
        """What is needed to go on: the weights that are trained, beside the means, which the checkpoint's networks are."""
        return {"taken": self.taken, "trained": {name: _copied(network) for name, network in self.networks.items()}}

    def load_state_dict(self, state):
        """Goes on from networks that hold the means."""
        self.taken = state["taken"]
        self.means = {name: _copied(network) for name, network in self.networks.items()}
        self._set(state["trained"])


def _copied(network):
    return {key: value.detach().clone() for key, value in network.state_dict().items()}
