"""The training loop of all stages: schedule, budget, log, checkpoints, stopping, several processes.

A stage implements a `Task`. Gradients are clipped to norm 1. The learning rate warms up over 50 steps and then follows
a cosine down to 2 % of its value. The budget is a number of steps, or minutes of wall clock, resumptions included. With
steps, a stopped and resumed training repeats the uninterrupted one exactly.
"""

import json
import math
import os
import signal
import sys
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import distributed

from .average import Average
from .checkpoint import Checkpoint
from .files import replacing
from .optimiser import MuonAndAdam

WARM_UP = 50
LOGS = 200  # lines of the curve over the whole budget
VALIDATIONS = 25  # how many of these lines have a validation
CHECKPOINT_S = 60.0


class LossNotFinite(Exception):
    """The loss became NaN or infinite. The last checkpoint holds the last finite weights."""


class Task:
    """The training task of a stage. `networks` is {name: Chain}."""

    kind = ""
    networks = {}
    display = None

    def module(self):
        """Returns the trained nn.Module."""
        raise NotImplementedError

    def sample(self, step):
        """Returns the batch of a step, on the CPU or the device. A loader thread calls it when a GPU trains."""
        raise NotImplementedError

    def before(self, step):
        """Prepares a step before its batch is drawn."""

    def revive(self, step, progress):
        """Gives fresh weights to units that never fire, if it is time to. Returns the number of these units."""
        return 0

    def loss(self, module, batch, step):
        """Returns (loss, {name: tensor of a term}) for a batch. `module` is `module()`, possibly wrapped."""
        raise NotImplementedError

    def validate(self):
        """Returns {name: figure} on scenes that are not in the training data."""
        raise NotImplementedError

    def extra(self):
        """Returns further values for the checkpoint."""
        return {}


@dataclass
class Budget:
    """The budget of a training: either steps or minutes."""

    steps: int | None = None
    minutes: float | None = None

    def __post_init__(self):
        if (self.steps is None) == (self.minutes is None):
            raise ValueError("a budget is either steps or minutes")
        if (self.minutes if self.steps is None else self.steps) <= 0:
            raise ValueError("a budget is more than nothing")

    def progress(self, step, elapsed_s):
        return step / self.steps if self.steps else elapsed_s / (60 * self.minutes)


@dataclass
class Workers:
    """The rank of this process among those of torchrun. Without torchrun there is one process."""

    rank: int
    count: int
    device: torch.device

    @classmethod
    def start(cls, device):
        count = int(os.environ.get("WORLD_SIZE", "1"))
        rank = int(os.environ.get("RANK", "0"))
        device = torch.device(device)
        if device.type == "cuda":
            device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
            torch.cuda.set_device(device)
        if count > 1 and not distributed.is_initialized():
            distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
        return cls(rank, count, device)

    def agree(self, *values):
        """Returns the sums of the values over all processes."""
        if self.count == 1:
            return values
        together = torch.tensor(values, dtype=torch.float64, device=self.device)
        distributed.all_reduce(together)
        return together.tolist()

    def share(self, module):
        """Copies the weights of the first process to all processes."""
        if self.count > 1:
            for parameter in module.parameters():
                distributed.broadcast(parameter.data, 0)


class Prefetch:
    """The batches of the next steps, drawn ahead by threads so that a GPU does not wait for them."""

    def __init__(self, sample, first, workers):
        self.sample, self.next = sample, first
        self.pool = ThreadPoolExecutor(workers) if workers else None
        self.queue = deque()
        self.ahead = 2 * workers

    def take(self):
        if self.pool is None:
            batch = self.sample(self.next)
            self.next += 1
            return batch
        while len(self.queue) <= self.ahead:
            self.queue.append(self.pool.submit(self.sample, self.next))
            self.next += 1
        return self.queue.popleft().result()

    def close(self):
        if self.pool:
            self.pool.shutdown(cancel_futures=True)


def rate(base, step, progress):
    """Returns the learning rate of a step."""
    cosine = 0.5 * (1 + math.cos(math.pi * min(progress, 1)))
    return base * min(1, (step + 1) / WARM_UP) * (0.98 * cosine + 0.02)


def to_device(batch, device):
    """Moves a dataclass of tensors to a device."""
    if device.type == "cpu":
        return batch
    return type(batch)(**{k: v.to(device, non_blocking=True) for k, v in batch.__dict__.items()})


def fit(task, budget, learning_rate, output, workers, resume=None, options=None, stop_at=None, loaders=0, average=0):
    """Trains until the budget is spent or a signal asks to stop. Returns the last checkpoint.

    output: folder for `checkpoint.pt` and `curve.jsonl`. resume: a Checkpoint to resume from. stop_at: step to stop
    (and save) after, even if the budget is not spent. loaders: threads that draw batches ahead. average: number of
    steps of the running mean of the weights, which is kept and validated; 0 for the weights themselves.
    """
    output = Path(output)
    module = task.module()
    optimiser = MuonAndAdam(module, learning_rate)
    step, before = 0, 0.0
    mean = Average(task.networks, average) if average else None
    if resume is not None:
        optimiser.load_state_dict(resume.optimiser)
        step, before = resume.step, resume.elapsed_s
        if resume.average:
            (mean or Average(task.networks, 1)).load_state_dict(resume.average)
    trained = module
    if workers.count > 1:
        ids = [workers.device.index] if workers.device.type == "cuda" else None
        trained = torch.nn.parallel.DistributedDataParallel(module, device_ids=ids)
    curve = Curve(output / "curve.jsonl", step) if workers.rank == 0 else None
    begin = time.monotonic()

    def elapsed():
        return before + time.monotonic() - begin

    def in_place():
        return mean.in_place() if mean else nullcontext()

    def save():
        trained = _on_cpu(mean.state_dict()) if mean else None
        with in_place():
            networks = {n: (net.architecture, _on_cpu(net.state_dict())) for n, net in task.networks.items()}
        checkpoint = Checkpoint(
            kind=task.kind,
            networks=networks,
            display=task.display,
            step=step,
            elapsed_s=elapsed(),
            optimiser=_on_cpu(optimiser.state_dict()),
            average=trained,
            options=options or {},
            extra=task.extra(),
        )
        if workers.rank == 0:
            checkpoint.save(output / "checkpoint.pt")
        return checkpoint

    checkpoint, saved = save(), time.monotonic()
    last_log = int(LOGS * budget.progress(step, before))
    last_validation = int(VALIDATIONS * budget.progress(step, before))
    batches = Prefetch(task.sample, step, loaders)
    sums, summed, revived = {}, 0, 0
    try:
        with _Signals() as signals:
            while True:
                own = budget.progress(step, elapsed()) if workers.rank == 0 else 0.0
                progress, asked = workers.agree(own, float(signals.asked))
                if progress >= 1 or asked or step == stop_at:
                    break
                now = rate(learning_rate, step, progress)
                optimiser.set_rate(now)
                task.before(step)
                batch = to_device(batches.take(), workers.device)
                if begun_again := task.revive(step, progress):
                    workers.share(module)
                    revived += begun_again
                loss, terms = task.loss(trained, batch, step)
                module.zero_grad(set_to_none=True)
                loss.backward()
                norm = torch.nn.utils.clip_grad_norm_(module.parameters(), 1.0)
                (bad,) = workers.agree(float(not (torch.isfinite(loss) and torch.isfinite(norm))))
                if bad:
                    raise LossNotFinite(
                        f"the loss is not finite at step {step}; the weights of step {checkpoint.step} are kept in {output / 'checkpoint.pt'}"
                    )
                optimiser.step()
                step += 1
                if mean:
                    mean.add()
                for name, value in (("loss", loss), *terms.items()):
                    sums[name] = sums.get(name, 0) + value.detach()
                summed += 1
                if workers.rank == 0:
                    progress = budget.progress(step, elapsed())
                    if int(LOGS * progress) > last_log:
                        last_log = int(LOGS * progress)
                        line = {"step": step, "elapsed_s": round(elapsed(), 1), "lr": now}
                        line |= {name: float(f"{float(value) / summed:.6g}") for name, value in sums.items()}
                        line |= {"revived": revived} if revived else {}
                        sums, summed, revived = {}, 0, 0
                        if int(VALIDATIONS * progress) > last_validation:
                            last_validation = int(VALIDATIONS * progress)
                            with in_place():
                                line |= task.validate()
                        curve.add(line)
                    if time.monotonic() - saved > CHECKPOINT_S and _finite(module):
                        checkpoint, saved = save(), time.monotonic()
    finally:
        batches.close()
    return save()


def _finite(module):
    return all(bool(torch.isfinite(p).all()) for p in module.parameters())


def _on_cpu(value):
    if isinstance(value, torch.Tensor):
        return value.detach().to("cpu", copy=True)
    if isinstance(value, dict):
        return {k: _on_cpu(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_on_cpu(v) for v in value]
    return value


class Curve:
    """The log of a training, one JSON object per line. A resumed training drops lines after the checkpoint's step."""

    def __init__(self, path, step):
        self.path = Path(path)
        kept = [line for line in read_curve(self.path) if line["step"] <= step] if step and self.path.exists() else []
        with replacing(self.path) as temporary:
            temporary.write_text("".join(json.dumps(line) + "\n" for line in kept))

    def add(self, line):
        with self.path.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in line.items()), file=sys.stderr, flush=True)


def read_curve(path):
    """Returns the lines of a curve, without an incomplete last line."""
    lines = []
    for text in Path(path).read_text().splitlines():
        try:
            lines.append(json.loads(text))
        except json.JSONDecodeError:
            break
    return lines


class _Signals:
    """A handler that records SIGINT and SIGTERM, so that the step ends and a checkpoint is written first."""

    def __enter__(self):
        self.asked = False
        self.previous = {}
        try:
            for number in (signal.SIGINT, signal.SIGTERM):
                self.previous[number] = signal.signal(number, self._ask)
        except ValueError:  # not the main thread, which alone receives signals
            pass
        return self

    def _ask(self, number, frame):
        self.asked = True

    def __exit__(self, *_):
        for number, handler in self.previous.items():
            signal.signal(number, handler)
