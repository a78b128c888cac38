"""Makes all shipped networks from scratch: data, trainings, int8, figures and cards. Completed steps are not
repeated."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

KINDS = {"objects": 1, "photographs": 22}  # kinds of scenes and the seeds of their data sets
DEEP = "-deep"  # suffix of data sets with twice the depth of the volume
DEEP_DISPLAY = """pitch_um = 8.0
wavelengths_nm = [638.0, 520.0, 450.0]
volume_depth_mm = 12.0
"""
INT8_MINUTES = 10.0
SEED_PLANES = 80


@dataclass(frozen=True)
class Network:
    """A network of stage 1 or a pair of stage 2, with its share of the training time."""

    share: float
    flags: tuple[str, ...]
    after: str | None = None  # the network that a pair starts from
    wide: bool = False  # whether it also learns volumes of twice the depth

    @property
    def seeded(self):
        return "seeded" in self.flags


NETWORKS = {
    "rgbd-8": Network(0.15, ("--layers", "8")),
    "rgbd-15": Network(0.2, ("--layers", "15")),
    "rgbd-30": Network(0.25, ("--layers", "30")),
    "rgbd-15-wide": Network(0.2, ("--layers", "15"), wide=True),
    "seeded-8-80": Network(0.1, ("--layers", "8", "--input", "seeded")),
    "ddpm-8": Network(0.1, (), after="rgbd-8"),
}


@dataclass(frozen=True)
class Settings:
    """The settings of a run, which may differ between machines."""

    output: Path
    phasefront: str  # path of the command phasefront-lab
    networks: tuple[str, ...]
    hours: float  # of training, all networks together
    scenes: int  # of each kind
    size: int
    planes: int
    training: tuple[str, ...]  # more flags of every training, such as --device cuda


@dataclass(frozen=True)
class Step:
    """A step: a command of this package."""

    name: str
    arguments: tuple[str, ...]
    resumed: Path | None = None  # if this file exists, the command resumes with --resume


def steps(settings: Settings) -> Iterator[Step]:
    """Returns all steps, in order."""
    folder = settings.output
    chosen = {name: NETWORKS[name] for name in NETWORKS if name in settings.networks}
    for kind, seed in KINDS.items():
        scenes = ("--scenes", settings.scenes, "--size", settings.size, "--seed", seed, "--scenes-like", kind)
        made = ("data", "--phasefront-lab", settings.phasefront, "-o")
        yield _step(f"data {kind}", *made, folder / kind, "--", *scenes, "--planes", settings.planes)
        if any(network.wide for network in chosen.values()):
            deep = ("--planes", 2 * settings.planes, "--display", folder / "deep.toml")
            yield _step(f"data {kind}{DEEP}", *made, folder / f"{kind}{DEEP}", "--", *scenes, *deep)
        if any(network.seeded for network in chosen.values()):
            more = ("--", "--planes", SEED_PLANES) + (("--refined", 3) if settings.size % 4 == 0 else ())
            given = ("--data", folder / kind, "-o", folder / f"seeds-{kind}", "--phasefront-lab", settings.phasefront)
            yield _step(f"seeds {kind}", "seeds", *given, *more)
    for name, network in chosen.items():
        yield from _of_network(settings, name, network)


def _of_network(settings, name, network):
    folder = settings.output
    checkpoint = folder / name / "checkpoint.pt"
    kinds = [*KINDS, *(f"{kind}{DEEP}" for kind in KINDS if network.wide)]
    sets = ("--data", *(folder / kind for kind in kinds))
    if network.seeded:
        sets += ("--seeds", *(folder / f"seeds-{kind}" for kind in KINDS))
    minutes = 60 * settings.hours * network.share / sum(NETWORKS[each].share for each in settings.networks)
    begins = ("--init", folder / network.after / "checkpoint.pt") if network.after else ("--dimmed", 0.25)
    training = ("stage2" if network.after else "stage1", *sets, "-o", folder / name, *network.flags, *begins)
    training += ("--sensor-depth", 0.5, "--minutes", round(minutes, 3), *settings.training)
    yield _step(f"train {name}", *training, resumed=checkpoint)
    for part in ("hologram", "prefilter") if network.after else ("hologram",):
        stem = name if part == "hologram" else f"{name}-prefilter"
        yield _step(f"export {stem}", "export", checkpoint, "--network", part, "-o", folder / f"{stem}.onnx")
        rounded = ("quantize", checkpoint, "--network", part, *sets, "-o", folder / f"{stem}-int8.onnx")
        yield _step(f"int8 {stem}", *rounded, "--minutes", min(INT8_MINUTES, minutes), *settings.training)
    figures = []
    for kind in kinds:
        figures.append(folder / f"{name}-{kind}.json")
        judged = ("--data", folder / kind, "--json", figures[-1])
        if network.after:
            yield _step(f"judge {name} {kind}", "evaluate-encoding", checkpoint, *judged)
        else:
            judged += ("--seeds", folder / f"seeds-{kind}") if network.seeded else ()
            files = (folder / f"{name}.onnx", folder / f"{name}-int8.onnx")
            yield _step(f"judge {name} {kind}", "evaluate", *files, *judged)
    yield _step(f"card {name}", "card", checkpoint, *figures, "-o", folder / f"{name}.md")


def _step(name, *arguments, resumed=None):
    return Step(name, tuple(str(argument) for argument in arguments), resumed)


def check(settings: Settings):
    """Raises ValueError if the settings name unknown networks or values."""
    if unknown := [name for name in settings.networks if name not in NETWORKS]:
        raise ValueError(f"no network is called {', '.join(unknown)}; there are {', '.join(NETWORKS)}")
    for name in settings.networks:
        if (before := NETWORKS[name].after) and before not in settings.networks:
            raise ValueError(f"{name} begins with {before}: name both")
    if not settings.hours > 0:
        raise ValueError(f"{settings.hours} hours train nothing; --hours must be above 0")


def run(settings: Settings, call: Callable[[tuple[str, ...]], int] | None = None) -> int:
    """Runs every step that is not done yet and returns their number. A step counts as done only with the same
    arguments.

    `call` takes a command's arguments and gives its exit status.
    """
    done = settings.output / "done.json"
    known = json.loads(done.read_text()) if done.exists() else {}
    todo = [step for step in steps(settings) if known.get(step.name) != list(step.arguments)]
    settings.output.mkdir(parents=True, exist_ok=True)
    (settings.output / "deep.toml").write_text(DEEP_DISPLAY)
    for number, step in enumerate(todo, 1):
        print(f"{time.strftime('%H:%M')} {number} of {len(todo)}: {step.name}", file=sys.stderr, flush=True)
        more = ("--resume",) if step.resumed and step.resumed.exists() and step.name not in known else ()
        if status := (call or _called)((*step.arguments, *more)):
            raise ValueError(f"'{step.name}' failed with status {status}; mend what it says and call the same command again, which goes on there")
        known[step.name] = list(step.arguments)
        written = done.with_suffix(".new")
        written.write_text(json.dumps(known, indent=1))
        written.replace(done)
    return len(todo)


def _called(arguments):
    return subprocess.run([sys.executable, "-m", __package__, *arguments], check=False).returncode
