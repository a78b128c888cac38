"""Tests the order of the recipe, the steps that it skips when it is called again, and one run of all its commands."""

import json
import os
from pathlib import Path

import pytest

from phasefront_training import recipe
from phasefront_training.__main__ import main

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "phasefront"
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", CACHE / "target")) / "release" / "phasefront-lab"


def settings(folder, **changes):
    common = {"networks": tuple(recipe.NETWORKS), "hours": 2.0, "scenes": 40, "size": 48, "planes": 4, "training": ("--f32",)}
    return recipe.Settings(folder, str(COMMAND), **common | changes)


def test_every_network_is_trained_rounded_judged_and_described(tmp_path):
    names = [step.name for step in recipe.steps(settings(tmp_path))]
    assert len(names) == len(set(names))
    for name in recipe.NETWORKS:
        order = [names.index(f"{what} {name}") for what in ("train", "export", "int8", "card")]
        assert order == sorted(order)
    assert names.index("train rgbd-8") < names.index("train ddpm-8")
    assert "int8 ddpm-8-prefilter" in names
    assert names.index("data objects-deep") < names.index("train rgbd-15-wide") < names.index("judge rgbd-15-wide photographs-deep")
    assert not any("deep" in step.name for step in recipe.steps(settings(tmp_path, networks=("rgbd-15",))))
    minutes = [float(step.arguments[step.arguments.index("--minutes") + 1]) for step in recipe.steps(settings(tmp_path)) if step.name.startswith("train")]
    assert sum(minutes) == pytest.approx(120, abs=0.1)


def test_the_plan_is_printed_and_nothing_done(tmp_path, capsys):
    assert main(["recipe", "-o", str(tmp_path / "new"), "--networks", "rgbd-8", "--plan", "--", "--device", "cuda"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("stage1 ") and line.endswith("--device cuda") for line in lines)
    assert not (tmp_path / "new").exists()


def test_what_is_done_is_not_done_again(tmp_path):
    taken = []

    def call(arguments):
        taken.append(arguments)
        return 1 if len(taken) == 5 else 0

    few = settings(tmp_path, networks=("rgbd-8",))
    with pytest.raises(ValueError, match="train|export|int8|judge|card"):
        recipe.run(few, call)
    failed = taken[-1]
    total = len(list(recipe.steps(few)))
    assert recipe.run(few, call) == total - 4
    assert taken[5] == failed
    assert recipe.run(few, call) == 0
    longer = settings(tmp_path, networks=("rgbd-8",), hours=3.0)
    assert recipe.run(longer, call) == 1  # the training, whose budget has changed


def test_a_training_that_was_stopped_goes_on(tmp_path):
    few = settings(tmp_path, networks=("rgbd-8",))
    (tmp_path / "rgbd-8").mkdir()
    (tmp_path / "rgbd-8" / "checkpoint.pt").touch()
    taken = []
    recipe.run(few, lambda arguments: taken.append(arguments) or 0)
    assert [arguments[0] for arguments in taken if "--resume" in arguments] == ["stage1"]


@pytest.mark.parametrize(
    "changes, words", [({"networks": ("rgbd-9",)}, "rgbd-9"), ({"networks": ("ddpm-8",)}, "begins with rgbd-8"), ({"hours": 0.0}, "above 0")]
)
def test_what_there_is_not_is_named(tmp_path, changes, words):
    with pytest.raises(ValueError, match=words):
        recipe.check(settings(tmp_path, **changes))


def test_all_of_it_from_nothing(tmp_path):
    assert COMMAND.exists(), "cargo build --release --workspace builds the command"
    few = settings(tmp_path, networks=("rgbd-8", "rgbd-15-wide"), hours=0.002, training=("--f32", "--crop", "48"))
    assert recipe.run(few, lambda arguments: main(list(arguments))) == len(list(recipe.steps(few)))
    for name in ("rgbd-8.onnx", "rgbd-8-int8.onnx", "rgbd-8.md"):
        assert (tmp_path / name).stat().st_size > 0
    assert json.loads((tmp_path / "rgbd-8-photographs.json").read_text())["data"]["like"] == "photographs"
    assert "volume 12 mm" in (card := (tmp_path / "rgbd-15-wide.md").read_text()) and ", 6 mm deep" in card
