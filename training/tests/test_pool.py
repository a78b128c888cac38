import json
import shutil
import stat
import sys

import pytest
import torch

from phasefront_training import pool
from phasefront_training.__main__ import main
from phasefront_training.checkpoint import Checkpoint
from phasefront_training.data import DataError
from phasefront_training.loop import Workers
from phasefront_training.networks import Architecture, Chain
from phasefront_training.pool import Pool
from phasefront_training.stage1 import Stage1

# Replaces the lab's command: it records its flags and fails for seed 1002 until the folder holds a file `mended`.
COMMAND = """#!{python}
import json, pathlib, sys
arguments = sys.argv[1:]
assert arguments.pop(0) == "dataset"
flags = dict(zip(arguments[::2], arguments[1::2]))
folder = pathlib.Path(flags["-o"])
folder.mkdir(exist_ok=True)
(folder / "manifest.json").write_text(json.dumps(flags))
if flags["--seed"] == "1002" and not (folder.parent / "mended").exists():
    sys.exit("stopped")
"""


@pytest.fixture
def command(tmp_path):
    path = tmp_path / "phasefront"
    path.write_text(COMMAND.format(python=sys.executable))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def flags(folder, shard):
    return json.loads((folder / f"shard_{shard:04d}" / "manifest.json").read_text())


def test_kinds_come_in_their_shares_from_the_first_shard_on():
    kinds = [pool.kind_of(k, {"objects": 1, "photographs": 1, "varied": 2}) for k in range(8)]
    assert sorted(kinds[:4]) == sorted(kinds[4:]) == ["objects", "photographs", "varied", "varied"]
    assert {pool.kind_of(k, {"objects": 0, "varied": 3}) for k in range(5)} == {"varied"}


def test_a_pool_is_made_shard_by_shard_and_goes_on_where_it_stopped(command, tmp_path):
    folder = tmp_path / "pool"
    call = ["pool", "-o", str(folder), "--scenes", "160", "--phasefront-lab", command, "--textures", "t", "--", "--size", "32"]
    assert main(call) == 1
    assert sorted(path.name for path in folder.iterdir()) == ["shard_0000", "shard_0001", "shard_0002.part"]
    (folder / "mended").touch()
    kept = (folder / "shard_0000" / "manifest.json").stat().st_mtime_ns
    assert main(call) == 0 and (folder / "shard_0000" / "manifest.json").stat().st_mtime_ns == kept
    made = [flags(folder, k) for k in range(4)]
    assert [each["--seed"] for each in made] == ["1000", "1001", "1002", "1003"]
    assert [each["--scenes-like"] for each in made].count("varied") == 2
    assert all(("--textures" in each) == (each["--scenes-like"] != "objects") for each in made)
    assert {each["--size"] for each in made} == {"32"} and {each["--scenes"] for each in made} == {"40"}


def test_a_pool_stays_within_its_share_of_the_disk(command, tmp_path):
    assert pool.make(tmp_path / "pool", 160, limit_bytes=1, command=command) == 1


@pytest.mark.parametrize(
    "more", [["--shares", "clouds=1"], ["--shares", "varied"], ["--shares", "varied=0"], ["--shard-scenes", "10"], ["--", "--seed", "3"]], ids=str
)
def test_wrong_pools_are_one_line(command, tmp_path, capsys, more):
    assert main(["pool", "-o", str(tmp_path / "pool"), "--scenes", "160", "--phasefront-lab", command, *more]) == 1
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1


def add_shard(data_folder, folder, k, like="objects", **display):
    place = folder / f"shard_{k:04d}"
    shutil.copytree(data_folder, place)
    table = json.loads((place / "manifest.json").read_text()) | {"look": {"like": like}, "seed": 1000 + k}
    table["display"] |= display
    (place / "manifest.json").write_text(json.dumps(table))
    return place


def test_whole_shards_are_taken_in_as_they_come(data_folder, tmp_path, capsys):
    with pytest.raises(DataError, match="no whole shard"):
        Pool(tmp_path)
    add_shard(data_folder, tmp_path, 0)
    begun = add_shard(data_folder, tmp_path, 1, "varied")
    begun = begun.rename(tmp_path / "shard_0001.part")
    scenes = Pool(tmp_path)
    assert len(scenes) == 5 and scenes.shape == (64, 64) and scenes.look() == 0
    begun.rename(tmp_path / "shard_0001")
    first = scenes.scene(0)
    assert scenes.look() == 5 and len(scenes) == 10 and scenes.look() == 0
    assert all(map(torch.equal, scenes.scene(0), first)) and all(map(torch.equal, scenes.scene(5), first))
    assert [(each["like"], each["scenes"]) for each in scenes.facts["sets"]] == [("objects", 5), ("varied", 5)]
    add_shard(data_folder, tmp_path, 2, pitch_um=6.4)
    assert scenes.look() == 0 and len(scenes) == 10 and scenes.look() == 0
    assert capsys.readouterr().err.count("shard_0002") == 1
    assert len(pool.validation(tmp_path, 1, 2)) == 2


def test_a_training_draws_from_new_shards_between_its_passes(data_folder, tmp_path):
    add_shard(data_folder, tmp_path, 0)
    scenes = Pool(tmp_path)
    here = Workers(0, 1, torch.device("cpu"))
    task = Stage1(Chain(Architecture(4, 8)), scenes, pool.validation(tmp_path, 1, 8), here, batch=1, crop=48, bf16=False)
    add_shard(data_folder, tmp_path, 1)
    known = []
    for step in range(7):
        task.before(step)
        known.append(len(task.sampler.scenes))
    assert known == [5] * 5 + [10] * 2
    assert task.extra()["data"]["scenes"] == 10


def test_the_command_trains_on_a_pool_and_resumes_with_averaged_weights(data_folder, tmp_path):
    folder, out, text = tmp_path / "pool", tmp_path / "run", tmp_path / "card.md"
    add_shard(data_folder, folder, 0)
    call = ["stage1", "--pool", str(folder), "-o", str(out), "--average", "4"]
    assert main([*call, "--layers", "4", "--filters", "8", "--crop", "48", "--steps", "4"]) == 0
    add_shard(data_folder, folder, 1, "varied")
    assert main([*call, "--resume", "--steps", "8"]) == 0
    last = Checkpoint.load(out / "checkpoint.pt")
    assert last.step == 8 and last.options["average"] == 4 and last.average["taken"] == 8
    assert last.extra["data"] | {"sets": 0} == {"pool": True, "scenes": 10, "size": 64, "ldi_layers": 1, "sets": 0}
    figures = tmp_path / "figures.json"
    assert main(["evaluate", str(out / "checkpoint.pt"), "--data", str(folder / "shard_0000"), "--json", str(figures)]) == 0
    assert main(["card", str(out / "checkpoint.pt"), str(figures), "-o", str(text)]) == 0
    told = text.read_text()
    assert "pool -o POOL --scenes 10 --shares objects=1 varied=1" in told and "--pool POOL" in told and "--average 4" in told
