import json
import shutil

import numpy as np
import pytest
import torch

from phasefront_training.__main__ import main
from phasefront_training.checkpoint import load_network
from phasefront_training.data import DataError, Manifest, Sampler, Scenes
from phasefront_training.sensor_depth import simulate_sensor_depth
from phasefront_training.evaluate import depths, evaluate, scene_as_seen, seed_as_field, sensor_generator, torch_predictor
from phasefront_training.export import read_description
from phasefront_training.networks import Architecture, Chain
from phasefront_training.seeds import Seeds

SCALE = 8192.0


def stored(field):
    return (np.concatenate([field.real, field.imag]) * SCALE).round().astype(np.int16)


@pytest.fixture
def seeds_folder(data_folder, tmp_path):
    """Makes seeds by the command with a substitute for the lab: the seed is the truth, or half of it on simulated
    sensor depth. The single refined depth is 0.25 everywhere."""
    folder = tmp_path / "seeds"
    main(["seeds", "--data", str(data_folder), "-o", str(folder), "--variants", "3", "--phasefront-lab", "true"])
    for i in range(8):
        truth = np.load(data_folder / f"pair_{i:06d}.npz")["hologram"]
        np.save(folder / f"seed_{i:06d}.npy", np.stack([stored(truth)] + [stored(truth / 2)] * 3))
        np.save(folder / f"refined_{i:06d}.npy", np.full((1, *truth.shape[1:]), 1 << 14, np.uint16))
    table = {"format": "phasefront-seeds-1", "scale": SCALE, "planes": 3, "refined": 1}
    (folder / "seeds.json").write_text(json.dumps(table))
    return folder


def scenes(data_folder, seeds_folder, split="train"):
    return Scenes(Manifest.read(data_folder), split, seeds=Seeds.read(seeds_folder))


def test_depths_are_the_clean_one_and_those_that_scenes_are_judged_on(data_folder, seeds_folder):
    found = scenes(data_folder, seeds_folder)
    for i in range(len(found)):
        colour, depth, _ = found.scene(i)
        assert torch.allclose(found.variant(i, 0)[0], depth, atol=1e-3)
        measured = simulate_sensor_depth(colour[:3], depth[0], sensor_generator(found.numbers[i]))
        assert torch.allclose(found.variant(i, 1)[0][0], measured, atol=1e-3)
        assert not torch.equal(found.variant(i, 1)[0], found.variant(i, 2)[0])
        assert torch.allclose(scene_as_seen(found, i, "refined")[1], torch.tensor(0.25), atol=1e-3)


def test_a_network_that_adds_nothing_gives_the_seed(data_folder, seeds_folder):
    found = scenes(data_folder, seeds_folder, "validation")
    network = Chain(Architecture(4, 8, "seeded"))
    torch.nn.init.zeros_(network.convs[-1].weight)
    for depth in depths(found):
        alone = evaluate(seed_as_field, found, depth, full=False)["amplitude_psnr"]
        assert evaluate(torch_predictor(network), found, depth, full=False)["amplitude_psnr"] == pytest.approx(alone, abs=1e-3)
    assert evaluate(seed_as_field, found, full=False)["amplitude_psnr"] > 60


def test_samples_hold_the_seed_of_their_depth(data_folder, seeds_folder):
    found = scenes(data_folder, seeds_folder)
    for share, factor in ((0.0, 1.0), (1.0, 0.5)):
        batch = Sampler(found, 4, 48, 4, share, kind="seeded").draw(0)
        real, imaginary = 2 * batch.input[:, 4:7] + 0.5, 2 * batch.input[:, 7:]
        assert torch.allclose(real, factor * batch.target.real, atol=2e-3)
        assert torch.allclose(imaginary, factor * batch.target.imag, atol=2e-3)


def test_other_networks_take_depth_from_the_seeds_folder(data_folder, seeds_folder):
    found = scenes(data_folder, seeds_folder)
    batches = [Sampler(found, 8, 48, 4, 1.0, seed).draw(0) for seed in range(3)]
    depths = torch.cat([batch.input[:, 3] + 0.5 for batch in batches])
    assert batches[0].input.shape[1] == 4
    refined = (depths - 0.25).abs().amax((1, 2)) < 1e-3
    assert 0 < refined.sum() < len(depths)


def test_a_seeded_network_is_trained_quantized_and_judged(data_folder, seeds_folder, tmp_path, capsys):
    common = ["--data", str(data_folder), "--seeds", str(seeds_folder)]
    train = ["stage1", *common, "-o", str(tmp_path / "out"), "--input", "seeded", "--layers", "4", "--filters", "8"]
    assert main([*train, "--steps", "3", "--crop", "48", "--sensor-depth", "0.5", "--f32"]) == 0
    checkpoint, onnx = str(tmp_path / "out" / "checkpoint.pt"), str(tmp_path / "small.onnx")
    assert main(["quantize", checkpoint, *common, "-o", onnx, "--steps", "2", "--crop", "48"]) == 0
    assert main(["evaluate", checkpoint, onnx, *common]) == 0
    assert "the sweep" in capsys.readouterr().out
    assert main(["export", checkpoint, "-o", str(tmp_path / "small-f32.onnx")]) == 0
    for file in (onnx, tmp_path / "small-f32.onnx"):
        assert read_description(file)["seed_planes"] == "3"
    half = tmp_path / "half.onnx"
    assert main(["export", checkpoint, "--shrink", "0.5", "-o", str(half)]) == 0
    whole, half = (load_network(path)[0] for path in (tmp_path / "small-f32.onnx", half))
    x = torch.rand(1, 10, 9, 13)
    assert torch.allclose(0.5 * whole(x), half(x), atol=1e-6)
    assert main(["evaluate", checkpoint, "--data", str(data_folder)]) == 1
    assert "--seeds" in capsys.readouterr().err


def test_a_seeded_network_trains_on_a_pool(data_folder, seeds_folder, tmp_path, capsys):
    pool, seeds, out = (tmp_path / name for name in ("pool", "of-pool", "out"))
    shards = ["shard_0000", "shard_0001"]
    for shard in shards:
        shutil.copytree(data_folder, pool / shard)
    make = ["seeds", "--pool", str(pool), "-o", str(seeds), "--variants", "3", "--phasefront-lab", "true"]
    assert main(make) == 0
    for shard in shards:
        assert np.load(seeds / shard / "depth_000000.npy").shape == (3, 64, 64)
        shutil.copytree(seeds_folder, seeds / shard, dirs_exist_ok=True)
    train = ["stage1", "--pool", str(pool), "-o", str(out), "--input", "seeded", "--layers", "4", "--filters", "8"]
    train += ["--steps", "3", "--crop", "48", "--sensor-depth", "0.5", "--f32"]
    assert main(train) == 1 and "--seeds" in capsys.readouterr().err
    assert main([*train, "--seeds", str(seeds)]) == 0
    figures, card = tmp_path / "figures.json", tmp_path / "card.md"
    common = ["--data", str(data_folder), "--seeds", str(seeds_folder)]
    assert main(["evaluate", str(out / "checkpoint.pt"), *common, "--json", str(figures)]) == 0
    assert main(["card", str(out / "checkpoint.pt"), str(figures), "-o", str(card)]) == 0
    told = card.read_text()
    assert "seeds --pool POOL -o SEEDS --variants 3 -- --planes 3 --refined 1" in told
    assert "--pool POOL" in told and "--seeds SEEDS" in told


def test_seeds_that_do_not_fit_are_named(data_folder, seeds_folder, tmp_path):
    with pytest.raises(DataError, match="make the seeds first"):
        Seeds.read(tmp_path / "nowhere")
    np.save(seeds_folder / "seed_000000.npy", np.zeros((3, 6, 8, 8), np.int16))
    with pytest.raises(DataError, match="do not belong together"):
        scenes(data_folder, seeds_folder)
