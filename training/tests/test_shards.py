import json
import stat
import sys

import pytest
import ray

from phasefront_training import shards
from phasefront_training.__main__ import main
from phasefront_training.data import DataError

# Replaces the lab's command: it records its shard and threads for each pair of the shard.
COMMAND = """#!{python}
import json, pathlib, sys
arguments = sys.argv[1:]
assert arguments.pop(0) == "dataset"
flags = dict(zip(arguments[::2], arguments[1::2]))
shard, count = map(int, flags["--shard"].split("/"))
if flags["--seed"] == "13" and shard == 2:
    sys.exit("error: the disk is full")
folder = pathlib.Path(flags["-o"])
folder.mkdir(exist_ok=True)
for i in range(shard, int(flags["--scenes"]), count):
    with open(folder / f"pair_{{i:06d}}.json", "x") as file:
        json.dump([shard, count, flags["--threads"]], file)
"""


@pytest.fixture
def command(tmp_path):
    path = tmp_path / "phasefront"
    path.write_text(COMMAND.format(python=sys.executable))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


@pytest.fixture(scope="module")
def cluster():
    ray.init(address="local", num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


def test_every_pair_is_made_once(cluster, command, tmp_path):
    out = tmp_path / "set"
    assert shards.make(out, ["--scenes", "11", "--seed", "1"], command, shards=4) == 4
    made = sorted(out.iterdir())
    assert [path.name for path in made] == [f"pair_{i:06d}.json" for i in range(11)]
    assert [json.loads(path.read_text()) for path in made] == [[i % 4, 4, "1"] for i in range(11)]


def test_the_command_counts_shards_by_the_cluster(cluster, command, tmp_path):
    out = tmp_path / "set"
    call = ["shards", "-o", str(out), "--phasefront-lab", command, "--cpus", "2", "--", "--scenes", "9", "--seed", "1"]
    assert main(call) == 0
    assert [json.loads(path.read_text())[1:] for path in sorted(out.iterdir())] == [[4, "2"]] * 9


def test_a_failing_shard_is_named(cluster, command, tmp_path):
    with pytest.raises(DataError, match="--shard 2/3.*the disk is full"):
        shards.make(tmp_path / "set", ["--scenes", "5", "--seed", "13"], command, shards=3)
    with pytest.raises(DataError, match="nowhere.*cannot be run"):
        shards.make(tmp_path / "set", ["--scenes", "5", "--seed", "1"], str(tmp_path / "nowhere"), shards=1)
    with pytest.raises(DataError, match="lower --cpus"):
        shards.make(tmp_path / "set", ["--scenes", "5", "--seed", "1"], command, cpus=64)
    with pytest.raises(DataError, match="1 or more"):
        shards.make(tmp_path / "set", [], command, shards=0)


def test_without_ray_it_says_how_to_get_it(command, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(DataError, match="pip install"):
        shards.make(tmp_path / "set", [], command)
