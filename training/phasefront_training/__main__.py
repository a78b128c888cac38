"""The command `python -m phasefront_training COMMAND`. This module defines the flags; other modules do the work."""

import argparse
import copy
import itertools
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import torch

from . import card, checkpoint, data, evaluate, evaluate_encoding, export, export_int8, grow, loop, networks, plot, pool, prepare, quantize, recipe, rounding, seeds, shards, stacks, statistics
from .checkpoint import Checkpoint
from .encode import DeepDoublePhase
from .natural import Natural
from .stage1 import Stage1
from .stage2 import Identity, Stage2, prefilter_network

FAILURES = (data.DataError, checkpoint.CheckpointError, export.ExportError, loop.LossNotFinite, ValueError, OSError)
BEGINNING_SCENES = 4  # for finding units that never fire, and for fitting a grown last layer
VALIDATION_SCENES = 8  # for the curve; `evaluate` uses all
NEEDS_SEEDS = "a seeded network reads the sweep's fields: --seeds FOLDER"


def parser():
    top = argparse.ArgumentParser(prog="phasefront_training", description="Train hologram networks for a display.")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name, run, text):
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(run=run)
        return sub

    p = add("data", run_data, "Make a data set with `phasefront-lab dataset`, which receives the arguments after --.")
    p.add_argument("-o", "--output", required=True, help="folder of the data set")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab (default: the one on the PATH)")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --scenes 1000 --size 384 --planes 200")

    p = add("shards", run_shards, "Make a data set on many machines, as Ray tasks of `phasefront-lab dataset`, which receives the arguments after --.")
    p.add_argument("-o", "--output", required=True, help="folder of the data set, the same one on all machines")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab on all machines (default: the one on the PATH)")
    p.add_argument("--address", help="address of the Ray cluster, or auto (default: start a cluster of this machine's cores)")
    p.add_argument("--cpus", type=int, default=1, help="number of cores and threads of a task (default 1)")
    p.add_argument("--shards", type=int, help="number of tasks (default: four times the number that run at the same time)")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --scenes 4000 --size 384 --planes 1000")

    p = add("pool", run_pool, "Make a pool of scenes for --pool, shard by shard. Networks can train on it meanwhile, and a second call continues it. `phasefront-lab dataset` receives the arguments after --.")
    p.add_argument("-o", "--output", required=True, help="folder of the pool")
    p.add_argument("--scenes", type=int, required=True, help="total number of scenes")
    p.add_argument("--shares", nargs="+", default=[f"{kind}={share:g}" for kind, share in pool.SHARES.items()], metavar="KIND=NUMBER", help="relative number of scenes of each kind (default %(default)s)")
    p.add_argument("--shard-scenes", type=int, default=pool.SHARD_SCENES, help="number of scenes of a shard, which are all of one kind (default %(default)s)")
    p.add_argument("--gib", type=float, help="make no further shards once the pool occupies this many GiB of the disk")
    p.add_argument("--textures", metavar="DIR", help="folder of pictures for the surfaces of photographs and varied scenes")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab (default: the one on the PATH)")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --size 256 --planes 200 --threads 1")

    p = add("seeds", run_seeds, "Make the seeds of a data set or a pool with `phasefront-lab seeds`, which receives the arguments after --.")
    scenes = p.add_mutually_exclusive_group(required=True)
    scenes.add_argument("--data", help="folder of the data set")
    scenes.add_argument("--pool", metavar="DIR", help="folder of the pool")
    p.add_argument("-o", "--output", required=True, help="folder of the seeds")
    p.add_argument("--variants", type=int, default=4, help="number of depths per scene: the clean one, and those of the data set's sensors or, if it has none, simulated ones (default 4)")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab (default: the one on the PATH)")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --planes 32")

    p = add("stacks", run_stacks, "Make the incoherent focal stacks of a data set or a pool with `phasefront-lab stacks`, which receives the arguments after --.")
    scenes = p.add_mutually_exclusive_group(required=True)
    scenes.add_argument("--data", help="folder of the data set")
    scenes.add_argument("--pool", metavar="DIR", help="folder of the pool")
    p.add_argument("-o", "--output", required=True, help="folder of the stacks")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab (default: the one on the PATH)")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --depths 8")

    p = add("statistics", run_statistics, "Compare the brightness, spectrum and depths of data sets with those of captured frames.")
    p.add_argument("--data", required=True, nargs="+", help="folders of data sets")
    p.add_argument("--split", choices=data.SPLITS, default="train")
    p.add_argument("--scenes", type=int, help="use only the first SCENES scenes of each")
    p.add_argument("--frames", metavar="DIR", help="folder that contains captured frames at any depth: colorNAME and depthNAME.png side by side")

    p = add("stage1", run_stage1, "Train a hologram network on scenes and their holograms.")
    training_flags(p)
    resume_flag(p)
    p.add_argument("--layers", type=int, default=15, help="number of convolution layers (default 15)")
    p.add_argument("--filters", type=int, default=24, help="number of filters per layer (default 24)")
    p.add_argument("--halved", action="store_true", help="compute at half the resolution, which doubles the receptive field; 48 filters then cost as much as 24 without it")
    p.add_argument("--input", default="rgbd", help="rgbd, rgbdxy (with the position in the frame), seeded, or ldiN for N layers of a layered depth image (default rgbd)")
    p.add_argument("--head", choices=networks.HEADS, default=networks.HEADS[0], help="meaning of the last layer's outputs (default %(default)s)")
    p.add_argument("--init", metavar="FILE", help="start with the weights of an .onnx or a checkpoint; layers are added up to --layers")
    p.add_argument("--average", type=int, default=0, metavar="STEPS", help="keep and evaluate the running mean of the weights over about this many steps (default 0: the weights themselves)")
    p.add_argument("--dimmed", type=float, default=0.0, help="share of samples whose colours, and with them their holograms, are scaled by a factor each (default 0)")

    p = add("natural", run_natural, "Train a network at half the resolution for natural focus: what the default encoder displays of its field, against incoherent focal stacks.")
    training_flags(p, rate=7e-4)
    resume_flag(p)
    p.add_argument("--stacks", required=True, nargs="+", help="folder of the stacks of each data set or of the pool")
    p.add_argument("--layers", type=int, default=8, help="number of convolution layers (default 8)")
    p.add_argument("--filters", type=int, default=48, help="number of filters per layer (default 48)")
    p.add_argument("--init", metavar="FILE", help="start with the weights of an .onnx or a checkpoint; layers are added up to --layers")
    p.add_argument("--average", type=int, default=0, metavar="STEPS", help="keep and evaluate the running mean of the weights over about this many steps (default 0: the weights themselves)")
    p.add_argument("--dimmed", type=float, default=0.0, help="share of samples whose colours, and with them their stacks, are scaled by a factor each (default 0)")

    p = add("stage2", run_stage2, "Train a hologram network and a pre-filter through the encoding (deep double phase method).")
    training_flags(p, crop=384, rate=2e-4)
    resume_flag(p)
    p.add_argument("--init", metavar="FILE", help="hologram network of stage 1 or 2 to start with: a checkpoint or a float32 .onnx")
    p.add_argument("--init-prefilter", metavar="FILE", help="pre-filter to start with, a float32 .onnx (default: a new one)")
    p.add_argument("--offset-mm", type=float, default=0.0, help="distance from the midpoint hologram to the modulator (default 0)")
    p.add_argument("--identity-steps", type=int, default=0, help="number of first steps that train the pre-filter to return true holograms unchanged, as in the paper (default 0: it starts as the blur of AA-DPM)")
    p.add_argument("--prefilter-layers", type=int, default=8, help="number of convolution layers of the pre-filter (default 8)")
    p.add_argument("--prefilter-filters", type=int, default=8, help="number of filters per layer of the pre-filter (default 8)")

    p = add("quantize", run_quantize, "Write a network as int8 ONNX. If rounding costs more than 0.1 dB, train it with rounding first.")
    p.add_argument("file", help="checkpoint or float32 .onnx")
    p.add_argument("--network", default="hologram", choices=("hologram", "prefilter"), help="network to take from a stage 2 checkpoint (default %(default)s)")
    whether = p.add_mutually_exclusive_group()
    whether.add_argument("--always-train", action="store_true", help="train even if rounding costs less")
    whether.add_argument("--never-train", action="store_true", help="do not train even if rounding costs more")
    training_flags(p, output="the .onnx file; training writes to FILE.qat", rate=1e-4)
    p.add_argument("--stacks", nargs="+", help="for a network for natural focus: folder of the stacks of each data set or of the pool")

    p = add("export", run_export, "Write a checkpoint's network as float32 ONNX.")
    p.add_argument("checkpoint")
    p.add_argument("--network", default="hologram", choices=("hologram", "prefilter"), help="network to take from a stage 2 checkpoint (default %(default)s)")
    p.add_argument("--shrink", type=float, default=1.0, metavar="FACTOR", help="factor of the correction that a seeded network adds to its seed: below 1 it leaves good seeds alone (default 1)")
    p.add_argument("-o", "--output", required=True, help="the .onnx file")

    p = add("evaluate", run_evaluate, "Evaluate networks on held-out scenes by PSNR and SSIM, and compare them with the RGB image as the field.")
    p.add_argument("networks", nargs="*", metavar="NETWORK", help="checkpoints or .onnx files that take the same input")
    p.add_argument("--clean-only", action="store_true", help="skip simulated sensor depth")
    evaluation_flags(p)

    p = add("evaluate-encoding", run_evaluate_encoding, "Evaluate the displayed images of encoded holograms: deep double phase of a stage 2 checkpoint, AA-DPM and plain double phase.")
    p.add_argument("checkpoint")
    p.add_argument("--prefilter", metavar="FILE", help=".onnx to evaluate instead of the checkpoint's pre-filter, for example its int8 form")
    p.add_argument("--sensor-depth", action="store_true", help="use simulated sensor depth")
    p.add_argument("--picture", metavar="FILE", help="file for a picture of the scene on which deep double phase is worst, by all encodings (.png, .jpg)")
    evaluation_flags(p)

    p = add("card", run_card, "Write the card of a network from its checkpoint and its measured figures.")
    p.add_argument("checkpoint")
    p.add_argument("figures", nargs="+", help="files that evaluate --json and evaluate-encoding --json wrote")
    p.add_argument("-o", "--output", required=True, help="file of the card: NAME.md beside NAME.onnx")

    p = add("recipe", run_recipe, "Make data, train, round and evaluate the bundled networks, and write their cards. A second call resumes. Every training receives the arguments after --.")
    p.add_argument("-o", "--output", required=True, help="folder of all results")
    p.add_argument("--phasefront-lab", default="phasefront-lab", metavar="FILE", help="path of the command phasefront-lab (default: the one on the PATH)")
    p.add_argument("--networks", nargs="+", default=list(recipe.NETWORKS), metavar="NAME", help=f"networks to train: {', '.join(recipe.NETWORKS)} (default: all)")
    p.add_argument("--hours", type=float, default=8.0, help="hours of training for all networks together (default 8)")
    p.add_argument("--scenes", type=int, default=2000, help="number of scenes of each of two kinds (default 2000)")
    p.add_argument("--size", type=int, default=384, help="side of a scene in pixels (default 384)")
    p.add_argument("--scene-planes", type=int, default=200, help="number of planes of the true holograms (default 200)")
    p.add_argument("--plan", action="store_true", help="print the commands without running them")
    p.add_argument("arguments", nargs=argparse.REMAINDER, help="for example: -- --device cuda --batch 16 --crop 256")

    p = add("plot", run_plot, "Plot the curves of trainings.")
    p.add_argument("folders", nargs="+", help="output folders of trainings")
    p.add_argument("-o", "--output", required=True, help="file of the plot: .png or .svg")
    return top


def machine_flags(p):
    p.add_argument("--device", default="cpu", help="cpu or cuda (default cpu)")
    p.add_argument("--threads", type=int, default=1, help="number of CPU threads (default 1); several networks train fastest in one process each with one thread")


def evaluation_flags(p):
    p.add_argument("--data", required=True, help="folder of the data set")
    p.add_argument("--seeds", help="folder of the data set's seeds, for seeded networks and refined depth; evaluates the sweep alone too")
    p.add_argument("--split", choices=data.SPLITS, default="test")
    p.add_argument("--scenes", type=int, help="use only the first SCENES scenes")
    p.add_argument("--json", metavar="FILE", help="file to write the figures to")
    machine_flags(p)


def training_flags(p, output="folder for checkpoint.pt and curve.jsonl", rate=2e-3, crop=192):
    scenes = p.add_mutually_exclusive_group(required=True)
    scenes.add_argument("--data", nargs="+", help="folder of the data set, or folders of several data sets to train on together")
    scenes.add_argument("--pool", metavar="DIR", help="folder of a pool of scenes, which may grow meanwhile")
    p.add_argument("--seeds", nargs="+", help="folder of the seeds of each data set or of the pool, for seeded networks and to add refined depth to simulated sensor depth")
    p.add_argument("-o", "--output", required=True, help=output)
    budget = p.add_mutually_exclusive_group()
    budget.add_argument("--minutes", type=float, help="budget in minutes of wall time, including earlier runs that are resumed")
    budget.add_argument("--steps", type=int, help="budget in steps")
    p.add_argument("--batch", type=int, default=1, help="number of samples per step and process (default 1)")
    p.add_argument("--crop", type=int, default=crop, help="side of a sample in pixels (default %(default)s)")
    p.add_argument("--planes", type=int, help="number of focal planes per step, 0 to 20 (default 1 on a CPU, 20 on a GPU)")
    p.add_argument("--sensor-depth", type=float, default=0.0, help="share of samples with simulated sensor depth (default 0)")
    p.add_argument("--rate", type=float, default=rate, help="learning rate (default %(default)s)")
    p.add_argument("--scenes", type=int, help="use only the first SCENES training scenes of each data set or shard")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--f32", action="store_true", help="compute in float32; bf16 is 3 to 4 times faster on CPUs that support it")
    p.add_argument("--loaders", type=int, help="number of threads that prepare samples ahead (default 0 on a CPU, 8 on a GPU)")
    machine_flags(p)


def resume_flag(p):
    p.add_argument("--resume", action="store_true", help="resume from the checkpoint in the output folder, with its flags unless others are given")


def run_data(args):
    data.make(args.output, passed_on(args), args.phasefront_lab)


def run_shards(args):
    made = shards.make(args.output, passed_on(args), args.phasefront_lab, args.address, args.shards, args.cpus)
    print(f"{args.output}: {made} shards", file=sys.stderr)


def run_pool(args):
    limit = None if args.gib is None else int(args.gib * 2**30)
    shares = pool.parse_shares(args.shares)
    made = pool.make(args.output, args.scenes, shares, args.shard_scenes, limit, args.textures, passed_on(args), args.phasefront_lab)
    print(f"{args.output}: {made} shards", file=sys.stderr)


def run_seeds(args):
    if args.variants < 2:
        raise ValueError("seeds need at least 2 variants a scene: clean and simulated sensor depth")
    if args.pool:
        sets = [(each, Path(args.output) / each.folder.name) for each in pool.shards(args.pool)]
    else:
        sets = [(data.Manifest.read(args.data), args.output)]
    for manifest, output in sets:
        seeds.make(manifest, output, args.variants, passed_on(args), args.phasefront_lab)


def run_stacks(args):
    if args.pool:
        sets = [(each, Path(args.output) / each.folder.name) for each in pool.shards(args.pool)]
    else:
        sets = [(data.Manifest.read(args.data), args.output)]
    for manifest, output in sets:
        stacks.make(manifest, output, passed_on(args), args.phasefront_lab)


def run_recipe(args):
    settings = recipe.Settings(
        Path(args.output), args.phasefront_lab, tuple(args.networks), args.hours, args.scenes, args.size, args.scene_planes, tuple(passed_on(args))
    )
    recipe.check(settings)
    if args.plan:
        for step in recipe.steps(settings):
            print(shlex.join(step.arguments))
        return
    taken = recipe.run(settings)
    print(f"{args.output}: {taken} steps taken, networks and cards lie there", file=sys.stderr)


def run_statistics(args):
    named = {str(folder): statistics.of_data(folder, args.split, args.scenes) for folder in args.data}
    if args.frames:
        captured = statistics.of_frames(args.frames)
        if captured:
            named["captured frames"] = captured
        else:
            print(f"{args.frames}: no captured frames there; left out", file=sys.stderr)
    print(statistics.table(named))


def passed_on(args):
    """Returns the arguments after --."""
    return args.arguments[1:] if args.arguments[:1] == ["--"] else args.arguments


def run_stage1(args):
    resume = resumed(args)
    workers = loop.Workers.start(args.device)
    if resume is not None:
        network = resume.network()
        train, validation = load(args, network.architecture)
    else:
        wanted = networks.Architecture(args.layers, args.filters, args.input, args.head, args.halved)
        train, validation = load(args, wanted)
        network = begun(args, wanted, train)
    task = Stage1(network, train, validation, workers, bf16=not args.f32, dimmed=args.dimmed, **sampling(args))
    go(task, args, workers, resume)


def run_natural(args):
    resume = resumed(args)
    workers = loop.Workers.start(args.device)
    wanted = networks.Architecture(args.layers, args.filters, halved=True)
    train, validation = load(args, wanted)
    network = resume.network() if resume else begun(args, wanted, train)
    task = Natural(network, train, validation, workers, bf16=not args.f32, dimmed=args.dimmed, **sampling(args))
    go(task, args, workers, resume)


def begun(args, wanted, train):
    """Returns a fresh network, or the network of --init, with more input channels and layers if the flags ask for
    them."""
    if not args.init:
        return networks.Chain(wanted)
    network, display = checkpoint.load_network(args.init)
    if (stretch := fmean(display.stretches(train.display))) != 1:
        network = grow.of_depths(network, stretch)
    found = network.architecture
    if (found.filters, found.head, found.halved) != (wanted.filters, wanted.head, wanted.halved):
        raise ValueError(f"{args.init}: {found}, the flags ask for {wanted}")
    if found.input != wanted.input:
        network = grow.widen(network, wanted.input)
    seen = list(itertools.islice(quantize.examples(train, network.architecture.input), BEGINNING_SCENES))
    return grow.grow(network, args.layers, seen)


def run_stage2(args):
    resume = resumed(args)
    if resume is not None:
        hologram, prefilter = resume.network("hologram"), resume.network("prefilter")
        offset_m = resume.extra["offset_m"]
    else:
        if not args.init:
            raise ValueError("stage 2 begins with a network of stage 1: --init FILE")
        hologram, display = checkpoint.load_network(args.init)
        prefilter = begun_prefilter(args, display)
        offset_m = args.offset_mm * 1e-3
    workers = loop.Workers.start(args.device)
    train, validation = load(args, hologram.architecture)
    model = DeepDoublePhase(hologram, prefilter, offset_m, train.display, bf16=not args.f32)
    options = sampling(args)
    if resume is None and args.identity_steps:
        identity = Identity(model, train, validation, workers, **{k: v for k, v in options.items() if k != "planes"})
        loop.fit(identity, loop.Budget(steps=args.identity_steps), 10 * args.rate, Path(args.output) / "identity", workers)
    go(Stage2(model, train, validation, workers, **options), args, workers, resume)


def begun_prefilter(args, display):
    """Returns a fresh pre-filter, or the pre-filter of --init-prefilter, which must be for the same display."""
    if not args.init_prefilter:
        return prefilter_network(args.prefilter_layers, args.prefilter_filters)
    network, its_display = checkpoint.load_network(args.init_prefilter)
    if not network.architecture.of_fields:
        raise ValueError(f"{args.init_prefilter}: it takes '{network.architecture.input}', a pre-filter takes a field")
    if its_display != display:
        raise ValueError(f"{args.init_prefilter} is for {its_display}, {args.init} for {display}")
    return network


def sampling(args):
    """Returns the sampling arguments of the tasks."""
    return {name: getattr(args, name) for name in ("batch", "crop", "planes", "sensor_depth", "seed")}


def load(args, architecture):
    """Returns the training scenes, and a few scenes for the curve's validation."""
    if args.pool:
        if architecture.seeded and not args.seeds:
            raise ValueError(NEEDS_SEEDS)
        of_pool = {}
        for name in ("seeds", "stacks"):
            if len(folders := getattr(args, name, None) or [None]) > 1:
                raise ValueError(f"a pool's {name} are in one folder, which `{name} --pool` makes")
            of_pool[name] = folders[0]
        train = pool.Pool(args.pool, architecture.ldi_layers, args.scenes, **of_pool)
        return train, pool.validation(args.pool, architecture.ldi_layers, VALIDATION_SCENES, **of_pool)
    folders, inputs = args.data, {architecture.input}
    more = []
    for name in ("seeds", "stacks"):
        more.append(getattr(args, name, None) or [None] * len(folders))
        if len(more[-1]) != len(folders):
            raise ValueError(f"{len(folders)} data sets and {len(more[-1])} folders of {name}: --{name} takes one for each, in the same order")

    def all_of(split, limit):
        return data.Scenes.joined([scenes_for(*each, split, inputs, limit) for each in zip(folders, *more)])

    return all_of("train", args.scenes), all_of("validation", max(1, VALIDATION_SCENES // len(folders)))


def scenes_for(folder, folder_of_seeds, folder_of_stacks, split, inputs, limit):
    """Returns scenes with the data that networks with these inputs read, and with stacks if there is a folder of
    them."""
    if "seeded" in inputs and not folder_of_seeds:
        raise ValueError(NEEDS_SEEDS)
    layers = {networks.Architecture(3, input=each).ldi_layers for each in inputs}
    if len(layers) > 1:
        raise ValueError("networks for different inputs are evaluated one call each")
    manifest = data.Manifest.read(folder)
    more = {
        "seeds": seeds.Seeds.read(folder_of_seeds) if folder_of_seeds else None,
        "stacks": stacks.Stacks.read(folder_of_stacks) if folder_of_stacks else None,
    }
    return data.Scenes(manifest, split, layers.pop(), limit, **more)


def resumed(args):
    """Returns the checkpoint to resume from, or None."""
    if not args.resume:
        if args.minutes is None and args.steps is None:
            raise ValueError("a training needs a budget: --minutes or --steps")
        return None
    return Checkpoint.load(Path(args.output) / "checkpoint.pt")


def go(task, args, workers, resume, folder=None):
    """Trains and prints the path of the result."""
    folder = folder or args.output
    options = {k: v for k, v in vars(args).items() if k not in ("run", "command", "resume", "output")}
    loaders = args.loaders if args.loaders is not None else (8 if workers.device.type == "cuda" else 0)
    budget = loop.Budget(args.steps, args.minutes)
    last = loop.fit(task, budget, args.rate, folder, workers, resume, options, loaders=loaders, average=getattr(args, "average", 0))
    if workers.rank == 0:
        print(f"{last.step} steps in {last.elapsed_s / 60:.1f} minutes: {Path(folder) / 'checkpoint.pt'}", file=sys.stderr)


def run_quantize(args):
    subject = (quantized_prefilter if args.network == "prefilter" else quantized_hologram)(args)
    exact = subject.figure(subject.chain)
    trainable = prepare.prepare(subject.chain, subject.examples)

    def settled(how):
        """Returns the rounded network and prints its origin and quality."""
        network = copy.deepcopy(trainable).cpu()
        rounding.round_in_order(network, subject.examples)
        rounded = subject.figure(network)
        print(f"{how}: float32 {exact:.2f} dB, int8 {rounded:.2f} dB on the validation scenes", file=sys.stderr)
        return network, exact - rounded

    network, loss_db = settled("after training")
    if worth_training(args, loss_db):
        workers = loop.Workers.start(args.device)
        go(subject.training(trainable, workers), args, workers, None, folder=f"{args.output}.qat")
        network, _ = settled("trained through the rounding")
    export.write(export_int8.int8_model(network, **subject.trained_for), args.output)


@dataclass(frozen=True)
class Subject:
    """The network that `quantize` converts."""

    chain: networks.Chain
    examples: list  # its inputs on the first scenes, (C, H, W)
    figure: Callable  # PSNR in dB on the validation scenes, of a network in its place
    training: Callable  # the task that trains a Quantized network in its place, on workers
    trained_for: dict  # arguments of the file's metadata


def quantized_hologram(args):
    chain, display = checkpoint.load_network(args.file)
    train, validation = load(args, chain.architecture)
    figure, training = (quantize.natural_figure, quantize.NaturalQuantizationAware) if args.stacks else (quantize.figure, quantize.QuantizationAware)
    return Subject(
        chain,
        list(quantize.examples(train, chain.architecture.input)),
        lambda network: figure(network, validation),
        lambda network, workers: training(network, train, validation, workers, **sampling(args)),
        {"display": display, "seed_planes": data.seed_planes(train.facts)},
    )


def quantized_prefilter(args):
    model = stage2_model(args.file, bf16=not args.f32)
    model.prefilter = prepare.in_two_parts(model.prefilter)
    train, validation = load(args, model.hologram.architecture)

    def behind(network):
        model.prefilter = network
        return model

    with torch.no_grad():
        examples = list(quantize.prefilter_examples(model, train))
    return Subject(
        model.prefilter,
        examples,
        lambda network: quantize.encoded_figure(behind(network).cpu(), validation),
        lambda network, workers: quantize.PrefilterQuantizationAware(behind(network), train, validation, workers, **sampling(args)),
        {"display": model.display, "offset_m": model.offset_m},
    )


def worth_training(args, loss_db):
    """Checks whether to train with rounding, which needs a budget."""
    if args.never_train or not args.always_train and loss_db <= quantize.ALLOWED_LOSS_DB:
        return False
    if args.minutes is None and args.steps is None:
        raise ValueError("the rounding costs over 0.1 dB: give quantization-aware training a budget, --minutes or --steps, or say --never-train")
    return True


def stage2_model(path, **options):
    """Returns the DeepDoublePhase of a stage 2 checkpoint."""
    if Path(path).suffix == ".onnx" or "prefilter" not in (last := Checkpoint.load(path)).networks:
        raise ValueError(f"{path}: no checkpoint of stage 2")
    return DeepDoublePhase(last.network("hologram"), last.network("prefilter"), last.extra["offset_m"], last.display, **options)


def run_export(args):
    last = Checkpoint.load(args.checkpoint)
    if args.network not in last.networks:
        raise ValueError(f"{args.checkpoint}: no {args.network}, only {', '.join(last.networks)}")
    offset_m, seed_planes = last.extra.get("offset_m", 0.0), data.seed_planes(last.extra["data"])
    network = last.network(args.network)
    if args.shrink != 1:
        if not network.architecture.seeded:
            raise ValueError("--shrink is for seeded networks, whose output is a correction")
        networks.scale_output(network, args.shrink)
    export.write(export.float_model(network, last.display, offset_m, seed_planes), args.output)


def run_evaluate(args):
    predictors = {str(path): evaluate.predictor(path, args.device) for path in args.networks}
    inputs = {architecture.input for _, architecture, _ in predictors.values()} or {"rgbd"}
    scenes = scenes_for(args.data, args.seeds, None, args.split, inputs, args.scenes)
    methods = {
        "RGB as the field": evaluate.rgb_as_field,
        "SM-LBM of what is visible": evaluate.visible_layers(scenes.display, scenes.origin["planes"]),
    }
    if scenes.seeded:
        methods["the sweep"] = evaluate.seed_as_field
    methods |= {name: evaluate.served(predict, trained, scenes.display) for name, (predict, _, trained) in predictors.items()}
    depths = ("clean",) if args.clean_only else evaluate.depths(scenes)
    results = {
        name: {depth: evaluate.evaluate(predict, scenes, depth, progress=True) for depth in depths}
        for name, predict in methods.items()
    }
    print(evaluate.table(results))
    if args.json:
        evaluate.save({"data": scenes_of(args, scenes), "results": results}, args.json)


def scenes_of(args, scenes):
    """Returns the description of the scenes of an evaluation."""
    manifest = data.Manifest.read(args.data)
    known = {k: manifest.table[k] for k in ("seed", "size", "planes", "display")}
    return {"split": args.split, "scenes": len(scenes), "like": manifest.like} | known


def run_evaluate_encoding(args):
    model = stage2_model(args.checkpoint).to(args.device)
    if args.prefilter:
        del model.prefilter  # a module attribute accepts only modules, and the file is not one
        model.prefilter = evaluate.OnnxNetwork(args.prefilter)
    scenes = scenes_for(args.data, args.seeds, None, args.split, {model.hologram.architecture.input}, args.scenes)
    depth = evaluate.SENSOR if args.sensor_depth else "clean"
    results = evaluate_encoding.encoding_figures(model, scenes, depth)
    if args.picture:
        evaluate_encoding.draw_worst(model, scenes, results, args.picture, depth)
    print(evaluate_encoding.table(results))
    if args.json:
        facts = scenes_of(args, scenes) | {"depth": depth}
        evaluate.save({"data": facts, "offset_mm": model.offset_m * 1e3, "results": results}, args.json)


def run_card(args):
    card.write(args.output, Checkpoint.load(args.checkpoint), args.figures)


def run_plot(args):
    plot.plot(args.folders, args.output)


def parse(arguments):
    """Parses the arguments. A resumed training keeps the values of flags that are not given."""
    top = parser()
    args = top.parse_args(arguments)
    if not getattr(args, "resume", False):
        return args
    kept = Checkpoint.load(Path(args.output) / "checkpoint.pt").options
    if args.minutes is not None or args.steps is not None:
        kept = {k: v for k, v in kept.items() if k not in ("minutes", "steps")}
    sub = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction)).choices[args.command]
    sub.set_defaults(**kept)
    return top.parse_args(arguments)


def main(arguments=None):
    try:
        args = parse(arguments)
        if hasattr(args, "threads"):
            torch.set_num_threads(args.threads)
        if hasattr(args, "seed"):
            torch.manual_seed(args.seed)
        args.run(args)
    except FAILURES as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
