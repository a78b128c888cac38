import json
import shutil

import numpy as np
import pytest
import torch

from phasefront_training.__main__ import main
from phasefront_training.checkpoint import Checkpoint
from phasefront_training.data import Manifest, Scenes
from phasefront_training.evaluate import evaluate, rgb_as_field, torch_predictor
from phasefront_training.loop import Budget, LossNotFinite, Workers, fit, read_curve
from phasefront_training.losses import field_terms, fill_invalid, focal_stack_terms
from phasefront_training.networks import Architecture, Chain
from phasefront_training.stage1 import Stage1

HERE = Workers(0, 1, torch.device("cpu"))


def task(folder, **options):
    manifest = Manifest.read(folder)
    torch.manual_seed(1)
    network = Chain(Architecture(4, 8))
    settings = {"crop": 48, "batch": 2, "planes": 2, "bf16": False} | options
    return Stage1(network, Scenes(manifest, "train"), Scenes(manifest, "validation"), HERE, **settings)


def without_time(curve):
    return [{k: v for k, v in line.items() if k != "elapsed_s"} for line in curve]


@pytest.mark.parametrize("budget", [{}, {"steps": 0}, {"minutes": -1}, {"steps": 1, "minutes": 1}], ids=str)
def test_a_budget_is_one_and_more_than_nothing(budget):
    with pytest.raises(ValueError, match="budget"):
        Budget(**budget)


@pytest.mark.parametrize("sensor_depth", [0.0, 0.5])
def test_a_resumed_training_gives_the_same_curve_and_weights(data_folder, tmp_path, sensor_depth):
    budget = Budget(steps=12)
    whole = fit(task(data_folder, sensor_depth=sensor_depth), budget, 2e-3, tmp_path / "whole", HERE)
    fit(task(data_folder, sensor_depth=sensor_depth), budget, 2e-3, tmp_path / "parts", HERE, stop_at=5)
    half = Checkpoint.load(tmp_path / "parts" / "checkpoint.pt")
    assert half.step == 5
    second = task(data_folder, sensor_depth=sensor_depth)
    second.network.load_state_dict(half.network().state_dict())
    resumed = fit(second, budget, 2e-3, tmp_path / "parts", HERE, resume=half)
    curves = [read_curve(tmp_path / name / "curve.jsonl") for name in ("whole", "parts")]
    assert len(curves[0]) == 12 and without_time(curves[0]) == without_time(curves[1])
    for a, b in zip(whole.network().parameters(), resumed.network().parameters()):
        assert torch.equal(a, b)


def test_training_lowers_the_loss_and_beats_the_rgb(data_folder, tmp_path):
    t = task(data_folder)
    fit(t, Budget(steps=150), 4e-3, tmp_path, HERE)
    scenes = t.validation
    before, after = evaluate(rgb_as_field, scenes), evaluate(torch_predictor(t.network), scenes)
    assert after["amplitude_psnr"] > before["amplitude_psnr"] + 0.5
    assert after["focal_psnr"] > before["focal_psnr"]


def test_nan_stops_with_the_last_good_weights(data_folder, tmp_path):
    t = task(data_folder)
    healthy = t.loss

    def poisoned(module, batch, step):
        loss, terms = healthy(module, batch, step)
        return (loss * float("nan") if step == 6 else loss), terms

    fit(t, Budget(steps=20), 2e-3, tmp_path, HERE, stop_at=4)
    kept = Checkpoint.load(tmp_path / "checkpoint.pt")
    t.loss = poisoned
    with pytest.raises(LossNotFinite, match="step 6.*step 4 are kept"):
        fit(t, Budget(steps=20), 2e-3, tmp_path, HERE, resume=kept)
    after = Checkpoint.load(tmp_path / "checkpoint.pt")
    assert after.step == 4
    assert all(torch.equal(a, b) and torch.isfinite(a).all() for a, b in zip(kept.network().parameters(), after.network().parameters()))


def test_losses_vanish_at_the_truth_and_only_there(data_folder):
    batch = task(data_folder).sample(0)
    display = task(data_folder).display
    for planes in (3, 20):
        focal, variation = focal_stack_terms(batch.target, batch.target, batch.depth, display, planes, np.random.default_rng(0))
        assert focal < 1e-6 and variation < 1e-6
        worse = focal_stack_terms(batch.target * 0.9, batch.target, batch.depth, display, planes, np.random.default_rng(0))
        assert worse[0] > 1e-3 and worse[1] > 1e-3
    assert field_terms(batch.target, batch.target)[1] < 1e-6
    wrong = fill_invalid(torch.zeros_like(batch.target), batch.target, batch.valid)
    assert torch.equal(wrong[batch.valid.expand_as(wrong) == 0], batch.target[batch.valid.expand_as(wrong) == 0])
    assert (wrong[batch.valid.expand_as(wrong) == 1] == 0).all()


def test_commands_train_resume_export_and_evaluate(data_folder, tmp_path, capsys):
    out = tmp_path / "run"
    base = ["stage1", "--data", str(data_folder), "-o", str(out)]
    assert main([*base, "--layers", "4", "--filters", "8", "--crop", "48", "--steps", "4", "--sensor-depth", "0.5"]) == 0
    assert main([*base, "--resume", "--steps", "8"]) == 0
    last = Checkpoint.load(out / "checkpoint.pt")
    assert last.step == 8 and last.options["crop"] == 48 and last.options["sensor_depth"] == 0.5
    onnx = tmp_path / "n.onnx"
    assert main(["export", str(out / "checkpoint.pt"), "-o", str(onnx)]) == 0
    grown = ["stage1", "--data", str(data_folder), "-o", str(tmp_path / "grown"), "--layers", "6", "--filters", "8"]
    assert main([*grown, "--init", str(onnx), "--steps", "2", "--crop", "48"]) == 0
    figures = tmp_path / "figures.json"
    call = ["evaluate", str(onnx), str(out / "checkpoint.pt"), "--data", str(data_folder), "--json", str(figures)]
    assert main(call) == 0
    results = json.loads(figures.read_text())["results"]
    assert results[str(onnx)]["clean"]["amplitude_psnr"] == pytest.approx(results[str(out / "checkpoint.pt")]["clean"]["amplitude_psnr"], abs=1e-3)
    assert "RGB as the field" in capsys.readouterr().out
    text = tmp_path / "small.md"
    assert main(["card", str(out / "checkpoint.pt"), str(figures), "-o", str(text)]) == 0
    told = text.read_text()
    assert "4 layers of 8 filters" in told and "| n.onnx | simulated sensor |" in told and "--layers 4" in told and "50%" in told
    assert main(["plot", str(out), "-o", str(tmp_path / "curves.png")]) == 0 and (tmp_path / "curves.png").stat().st_size > 5000


def test_a_training_on_two_data_sets_says_so(data_folder, tmp_path, capsys):
    other = tmp_path / "other"
    shutil.copytree(data_folder, other)
    table = json.loads((other / "manifest.json").read_text()) | {"look": {"like": "photographs"}, "seed": 9}
    (other / "manifest.json").write_text(json.dumps(table))
    out, text = tmp_path / "run", tmp_path / "both.md"
    call = ["stage1", "--data", str(data_folder), str(other), "-o", str(out), "--layers", "4", "--filters", "8", "--crop", "48"]
    assert main([*call, "--steps", "2", "--dimmed", "0.5"]) == 0
    assert Checkpoint.load(out / "checkpoint.pt").extra["data"]["scenes"] == 10
    assert main(["card", str(out / "checkpoint.pt"), "-o", str(text), *figures_of(other, out, tmp_path)]) == 0
    told = text.read_text()
    assert "Training data: 5 scenes of 64² pixels, 3 planes, seed 3; 5 scenes like photographs of 64² pixels, 3 planes, seed 9." in told
    assert "--scenes-like photographs" in told and "--data DATA1 DATA2" in told and "--dimmed 0.5" in told
    assert "1 test scene like photographs:" in told
    assert main([*call, "--steps", "2", "--seeds", str(tmp_path)]) == 1
    assert "2 data sets and 1 folders of seeds" in capsys.readouterr().err


def figures_of(data, run, folder):
    figures = folder / "figures.json"
    assert main(["evaluate", str(run / "checkpoint.pt"), "--data", str(data), "--json", str(figures)]) == 0
    return [str(figures)]


def test_wrong_use_is_one_line(data_folder, tmp_path, capsys):
    assert main(["stage1", "--data", str(tmp_path), "-o", str(tmp_path / "o"), "--steps", "1"]) == 1
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1 and "manifest.json" in told
    assert main(["stage1", "--data", str(data_folder), "-o", str(tmp_path / "o")]) == 1
    assert "--minutes or --steps" in capsys.readouterr().err


def test_layered_input_trains(data_folder, tmp_path):
    out = tmp_path / "ldi"
    call = ["stage1", "--data", str(data_folder), "-o", str(out), "--input", "ldi3", "--layers", "4", "--filters", "8", "--crop", "48", "--steps", "2"]
    assert main(call) == 0
    assert Checkpoint.load(out / "checkpoint.pt").network().architecture.input_channels == 12


def test_averaged_weights_are_kept_and_the_training_itself_is_not_changed(data_folder, tmp_path):
    budget = Budget(steps=8)
    plain = fit(task(data_folder), budget, 2e-3, tmp_path / "plain", HERE)
    whole = fit(task(data_folder), budget, 2e-3, tmp_path / "whole", HERE, average=4)
    fit(task(data_folder), budget, 2e-3, tmp_path / "parts", HERE, stop_at=5, average=4)
    half = Checkpoint.load(tmp_path / "parts" / "checkpoint.pt")
    second = task(data_folder)
    second.network.load_state_dict(half.network().state_dict())
    resumed = fit(second, budget, 2e-3, tmp_path / "parts", HERE, resume=half, average=4)
    own = whole.average["trained"]["hologram"]
    for name, value in plain.network().state_dict().items():
        assert torch.equal(own[name], value) and torch.equal(resumed.average["trained"]["hologram"][name], value)
        assert torch.equal(whole.network().state_dict()[name], resumed.network().state_dict()[name])
    assert any(not torch.equal(a, b) for a, b in zip(whole.network().parameters(), plain.network().parameters()))
