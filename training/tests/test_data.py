import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from phasefront_training import data, seeds
from phasefront_training.data import DataError, Manifest, Sampler, Scenes, network_input, read_pair
from phasefront_training.sensor_depth import fill_nearest, simulate_sensor_depth
from phasefront_training.evaluate import scene_as_seen, served, visible_layers
from phasefront_training.metrics import psnr


def test_reading_follows_the_contract(data_folder):
    manifest = Manifest.read(data_folder)
    scenes = Scenes(manifest, "train", ldi_layers=2)
    assert len(scenes) == 5 and scenes.shape == (64, 64)
    raw = np.load(manifest.pair(0))
    colour, depth, truth = scenes.scene(0)
    assert np.abs(truth.numpy() - raw["hologram"]).max() < 2e-3
    assert np.allclose(colour[:3].numpy(), raw["rgb"][0, ..., :3].transpose(2, 0, 1) / 255)
    miss = raw["rgb"][1, ..., 3] == 0
    assert miss.any() and (depth[1].numpy()[miss] == 1).all() and (colour[3:].numpy()[:, miss] == 0).all()
    x = network_input(colour, depth)
    assert torch.equal(x[3], depth[0] - 0.5) and torch.equal(x[4], colour[3] - 0.5) and x.shape == (8, 64, 64)


def test_damaged_shards_are_named_and_skipped(data_folder, tmp_path, capsys):
    folder = shutil.copytree(data_folder, tmp_path / "set")
    damaged = folder / "pair_000001.npz"
    damaged.write_bytes(damaged.read_bytes()[:2000])
    (folder / "pair_000002.npz").write_bytes(b"no zip at all")
    bytes_ = bytearray((folder / "pair_000003.npz").read_bytes())
    bytes_[len(bytes_) // 2] ^= 0xFF
    (folder / "pair_000003.npz").write_bytes(bytes(bytes_))
    scenes = Scenes(Manifest.read(folder), "train")
    assert scenes.numbers == [0, 4]
    told = capsys.readouterr().err
    assert all(f"pair_00000{n}.npz" in told for n in (1, 2, 3))
    for n in (0, 4):
        (folder / f"pair_00000{n}.npz").unlink()
    with pytest.raises(data.DataError, match="no readable pair"):
        Scenes(Manifest.read(folder), "train")


def test_a_set_without_validation_says_how_many_scenes_have_one(data_folder):
    manifest = Manifest.read(data_folder)
    manifest.table.update(scenes=39, splits={"train": [0, 39], "validation": [39, 39], "test": [39, 39]})
    with pytest.raises(data.DataError, match="39 scenes leave none for the split 'validation'; a set of 40 has one"):
        Scenes(manifest, "validation")


def test_pairs_of_too_few_layers_are_refused(data_folder):
    with pytest.raises(data.DataError, match="3 layers"):
        read_pair(Manifest.read(data_folder).pair(0), 5)


def found(scene, batch, n, turn):
    """Checks whether sample n of a batch, after flips and a transpose, is a window of the scene."""
    colour, depth, truth = scene
    views = torch.cat([network_input(colour, depth), truth.real, truth.imag]).unfold(-2, 48, 1).unfold(-2, 48, 1)
    window = torch.cat([batch.input[n], batch.target[n].real, batch.target[n].imag])
    window = window.transpose(-1, -2) if turn & 4 else window
    window = window.flip([axis for axis, bit in ((-2, 1), (-1, 2)) if turn & bit])
    corners = (views[..., 0, 0] == window[:, None, None, 0, 0]).all(0).nonzero()
    return any(torch.equal(views[:, y, x], window) for y, x in corners)


def test_samples_are_cut_from_scenes_and_repeat(data_folder):
    scenes = Scenes(Manifest.read(data_folder), "train")
    sampler = Sampler(scenes, batch=3, crop=48, margin=8, seed=5)
    one, again, other = sampler.draw(11), sampler.draw(11), sampler.draw(12)
    assert torch.equal(one.input, again.input) and torch.equal(one.target, again.target)
    assert not torch.equal(one.input, other.input)
    assert one.input.shape == (3, 4, 48, 48) and one.target.shape == (3, 3, 48, 48) and one.valid.shape == (3, 1, 48, 48)
    # Without its flips and transposes, each sample is a window of one scene, with input and target at the same place.
    for n in range(3):
        assert any(found(scenes.scene(k), one, n, turn) for k in range(len(scenes)) for turn in range(8))


def test_valid_marks_cut_sides_only(data_folder):
    scenes = Scenes(Manifest.read(data_folder), "train")
    whole = Sampler(scenes, 1, 64, 8).draw(0)
    assert whole.valid.all()
    for step in range(20):
        valid = Sampler(scenes, 1, 48, 8).draw(step).valid[0, 0]
        rows, columns = valid.amax(1), valid.amax(0)
        assert torch.equal(valid, rows[:, None] * columns[None])
        assert rows.sum() in (32, 40) and columns.sum() in (32, 40)


def test_sensor_depths_keep_shape_and_range_and_change_depth(data_folder):
    scenes = Scenes(Manifest.read(data_folder), "train")
    colour, depth, _ = scenes.scene(0)
    changed = 0
    for seed in range(60):
        bad = simulate_sensor_depth(colour[:, :, :51], depth[0, :, :51], np.random.default_rng(seed))
        assert bad.shape == (64, 51) and torch.isfinite(bad).all() and 0 <= bad.min() and bad.max() <= 1
        changed += not torch.equal(bad, depth[0, :, :51])
        assert (bad - depth[0, :, :51]).abs().median() < 0.05
    assert changed > 50
    again = [simulate_sensor_depth(colour, depth[0], np.random.default_rng(9)) for _ in range(2)]
    assert torch.equal(*again)


def test_dimmed_samples_are_a_scene_and_its_hologram_by_the_same_gains(data_folder):
    scenes = Scenes(Manifest.read(data_folder), "train")
    sampler = Sampler(scenes, 1, 64, 8, seed=5, dimmed=1.0)

    def dimmed(k, batch):
        """Returns the gains that convert scene k to the sample, or None."""
        colour, _, field = scenes.scene(k)
        for turn in range(8):
            seen, target = batch.input[0, :3] + 0.5, batch.target[0]
            if turn & 4:
                seen, target = seen.transpose(-1, -2), target.transpose(-1, -2)
            axes = [axis for axis, bit in ((-2, 1), (-1, 2)) if turn & bit]
            seen, target = seen.flip(axes), target.flip(axes)
            gains = (seen.sum((1, 2)) / colour.sum((1, 2)))[:, None, None]
            if torch.allclose(seen, gains * colour, atol=1e-5) and torch.allclose(target, gains * field, atol=1e-5):
                return gains
        return None

    for step in range(6):
        batch = sampler.draw(step)
        gains = next(found for k in range(len(scenes)) if (found := dimmed(k, batch)) is not None)
        assert batch.input[:, :3].max() <= 0.5 + 1e-5 and gains.min() > 0 and (gains - 1).abs().max() > 1e-3
        # The samples assume that waves through a scene with occlusion are linear in each of its colours.
        colour, depth, _ = scenes.scene(0)
        by_waves = visible_layers(scenes.display, 16)
        assert torch.allclose(by_waves(gains * colour, depth), gains * by_waves(colour, depth), atol=1e-5)


def test_data_sets_are_joined(data_folder, tmp_path):
    manifest = Manifest.read(data_folder)
    sets = [Scenes(manifest, "train"), Scenes(manifest, "validation")]
    want = [scenes.scene(i) for scenes in sets for i in range(len(scenes))]
    whole = Scenes.joined(sets)
    assert len(whole) == 7 and [each["scenes"] for each in whole.facts["sets"]] == [5, 2]
    for i, members in enumerate(want):
        assert all(map(torch.equal, whole.scene(i), members))
    alone = Scenes(manifest, "train")
    assert Scenes.joined([alone]) is alone and "sets" not in alone.facts


def for_another_display(folder, to, **changes):
    """Copies a data set with another display in its manifest."""
    shutil.copytree(folder, to)
    table = json.loads((to / "manifest.json").read_text())
    table["display"] |= changes
    (to / "manifest.json").write_text(json.dumps(table))
    return to


def test_depths_of_a_shallower_volume_are_stretched_to_the_deeper_one(data_folder, tmp_path):
    shallow = for_another_display(data_folder, tmp_path / "shallow", volume_depth_mm=3.0)
    sets = [Scenes(Manifest.read(folder), "train") for folder in (shallow, data_folder)]
    whole = Scenes.joined(sets)
    assert whole.display == Manifest.read(data_folder).display
    assert [each["volume_depth_mm"] for each in whole.facts["sets"]] == [3.0, 6.0]
    for kind in ("clean", "simulated sensor"):
        own, deep = (scene_as_seen(whole, i, kind)[1] for i in (0, 5))
        assert torch.allclose(own, 0.25 + 0.5 * deep, atol=1e-3)
    samples = Sampler(whole, 1, 64, 0)
    spans = [float(batch.depth.max() - batch.depth.min()) for batch in map(samples.draw, range(30))]
    assert {min(abs(span - 0.75), abs(span - 0.375)) < 1e-2 for span in spans} == {True} and max(spans) - min(spans) > 0.3
    assert all(torch.allclose(b.input[:, 3] + 0.5, b.depth, atol=1e-3) for b in map(samples.draw, range(30)))


def test_a_wave_depends_on_stretched_depths_alone(data_folder):
    """The waves of half the volume, in as many planes, equal those of depths compressed to the middle half."""
    scenes = Scenes(Manifest.read(data_folder), "train")
    colour, depth, _ = scenes.scene(0)
    depth = (depth * 16).floor().clamp(max=15).add(0.5) / 16
    half = replace(scenes.display, volume_depth_m=scenes.display.volume_depth_m / 2)
    finer = replace(half, pitch_m=half.pitch_m / 2, volume_depth_m=half.volume_depth_m / 4)
    (stretch,) = {*half.stretches(scenes.display)}
    want = visible_layers(scenes.display, 32)(colour, 0.5 + stretch * (depth - 0.5))
    assert stretch == 0.5 and psnr(visible_layers(half, 16)(colour, depth).abs(), want.abs()) > 50
    assert finer.stretches(scenes.display) == half.stretches(scenes.display)
    assert psnr(visible_layers(finer, 16)(colour, depth).abs(), want.abs()) > 45  # to the paraxial order


def test_a_network_serves_displays_of_no_more_depth(data_folder):
    display = Manifest.read(data_folder).display
    seen = []
    half = replace(display, volume_depth_m=display.volume_depth_m / 2)
    served(lambda colour, depth, seed: seen.append(depth), display, half)(None, torch.tensor([0.0, 0.5, 1.0]))
    assert torch.allclose(seen[0], torch.tensor([0.25, 0.5, 0.75]))
    with pytest.raises(ValueError, match="2.00 times"):
        served(None, half, display)
    with pytest.raises(ValueError, match="wavelengths"):
        served(None, display, replace(half, wavelengths_m=(638e-9, 520e-9, 405e-9)))
    with pytest.raises(ValueError, match="corrects"):
        served(None, replace(display, corrected=True), half)


def with_sensors(folder, to):
    """Copies a data set and gives it two sensors, which see a quarter and three quarters everywhere."""
    shutil.copytree(folder, to)
    table = json.loads((to / "manifest.json").read_text())
    (to / "manifest.json").write_text(json.dumps(table | {"sensors": ["lidar", "kinect"]}))
    for path in to.glob("pair_*.npz"):
        arrays = dict(np.load(path))
        size = arrays["depth"].shape[1:]
        sensed = np.stack([np.full(size, 16384, np.uint16), np.full(size, 49151, np.uint16)])
        np.savez_compressed(path, **arrays, sensed=sensed)
    return to


def test_sensor_depth_is_that_of_the_data_sets_sensors(data_folder, tmp_path):
    folder = with_sensors(data_folder, tmp_path / "sensed")
    scenes = Scenes.joined([Scenes(Manifest.read(folder), "train") for _ in range(2)])
    assert scenes.facts["sensors"] == ["lidar", "kinect"]
    seen = [Sampler(scenes, 1, 48, 8, sensor_depth=1).draw(step).input[0, 3] + 0.5 for step in range(20)]
    assert {round(float(depth.mean()), 3) for depth in seen} == {0.25, 0.75} and max(float(depth.std()) for depth in seen) < 1e-3
    clean = Sampler(scenes, 1, 48, 8).draw(0)
    assert torch.allclose(clean.input[:, 3] + 0.5, clean.depth, atol=1e-3)
    with pytest.raises(DataError, match="sensors"):
        Scenes.joined([Scenes(Manifest.read(each), "train") for each in (folder, data_folder)])


def test_seeds_are_made_on_the_depth_of_the_data_sets_sensors(data_folder, tmp_path):
    folder = with_sensors(data_folder, tmp_path / "sensed")
    seeds.make(Manifest.read(folder), tmp_path / "seeds", 3, [], "true")
    for number in range(2):
        clean, *sensed = np.load(tmp_path / "seeds" / f"depth_{number:06d}.npy")
        assert np.abs(clean / 65535 - read_pair(folder / f"pair_{number:06d}.npz", 1)[1][0]).max() < 1e-3
        assert [round(float(each.mean() / 65535), 2) for each in sensed] == [0.25, 0.75]


def test_data_sets_for_other_displays_are_not_joined(data_folder, tmp_path):
    other = for_another_display(data_folder, tmp_path / "other", pitch_um=6.4)
    with pytest.raises(DataError, match="volume's depth"):
        Scenes.joined([Scenes(Manifest.read(folder), "train") for folder in (data_folder, other)])


def test_holes_take_the_nearest_valid_depth():
    depth = torch.arange(7.0)[None, None, None].repeat(1, 1, 5, 1)
    holes = torch.zeros_like(depth, dtype=torch.bool)
    holes[..., 1:5] = True
    assert torch.equal(fill_nearest(depth, holes)[0, 0, 2], torch.tensor([0.0, 0, 0, 5, 5, 5, 6]))


def test_sensor_depth_of_layered_inputs_is_refused(data_folder):
    with pytest.raises(ValueError, match="rgbd"):
        Sampler(Scenes(Manifest.read(data_folder), "train", 2), 1, 48, 8, sensor_depth=0.5)


def test_coordinates_say_where_a_crop_lies_and_nothing_is_flipped(data_folder):
    scenes = Scenes(Manifest.read(data_folder), "train")
    height, width = scenes.shape
    whole = network_input(*scenes.scene(0)[:2], kind="rgbdxy")
    assert whole.shape[0] == 6
    assert whole[4, 3, 0] == pytest.approx(0.5 / width - 0.5) and whole[5, -1, 2] == pytest.approx(0.5 - 0.5 / height)
    sampler = Sampler(scenes, 1, 16, 2, kind="rgbdxy")
    for step in range(20):
        given = sampler.draw(step).input[0]
        assert given.shape[0] == 6
        # The scene that has these pixels at this place.
        x, y = round(((given[4, 0, 0] + 0.5) * width - 0.5).item()), round(((given[5, 0, 0] + 0.5) * height - 0.5).item())
        window = (..., slice(y, y + 16), slice(x, x + 16))
        inputs = (network_input(*scenes.scene(i)[:2], kind="rgbdxy")[window] for i in range(len(scenes)))
        assert any(torch.allclose(given, each) for each in inputs)
