"""A pool of scenes that grows while networks train on it.

A pool is a folder of shards, `shard_0000`, `shard_0001`, …. Each shard is a data set of one kind of scenes with its own
splits. A shard is renamed to its final name when it is complete, so readers see only complete shards. Shard k has the
seed FIRST_SEED + k and the kind that is farthest below its share, so that a pool of any length holds the kinds in their
shares, and a pool that is made again has the same bytes.

Networks train on the training scenes of all shards, including shards that are added later. The validation scenes of the
first shards validate the training. The samples of a step depend on the number of scenes at that step, so a training on
a growing pool is not reproducible bit by bit. A training on a complete pool is.
"""

import sys
from pathlib import Path

from . import data
from .seeds import Seeds
from .stacks import Stacks

FIRST_SEED = 1000  # lower seeds are for other data sets, some of them for tests
KINDS = ("objects", "photographs", "varied")
SHARES = {"objects": 1.0, "photographs": 1.0, "varied": 2.0}
SHARD_SCENES = 40  # one of them for validation and one for tests
PART = ".part"  # suffix of an incomplete shard
TENSORS = ("colour", "depth", "target", "sensed")  # of each scene
SEEDED = ("variant_depth", "variant_seed")  # of each scene with seeds
STACKED = ("stack_depths", "stack")  # of each scene with an incoherent focal stack


def kind_of(shard, shares):
    """Returns the kind of a shard's scenes."""
    whole = sum(shares.values())
    made = dict.fromkeys(shares, 0)
    for k in range(shard + 1):
        kind = max(shares, key=lambda each: (k + 1) * shares[each] / whole - made[each])
        made[kind] += 1
    return kind


def check(shares, scenes, shard_scenes, arguments):
    """Raises ValueError if no pool can be made with these arguments."""
    if unknown := [kind for kind in shares if kind not in KINDS]:
        raise ValueError(f"no kind of scenes is called {', '.join(unknown)}; there are {', '.join(KINDS)}")
    if not shares or min(shares.values()) < 0 or sum(shares.values()) <= 0:
        raise ValueError("shares are numbers of 0 and more, one at least above 0")
    if shard_scenes < SHARD_SCENES or scenes < shard_scenes:
        raise ValueError(f"a shard has {SHARD_SCENES} scenes at least, so that one is for validation, and a pool one shard at least")
    if taken := [flag for flag in ("--seed", "--scenes", "--scenes-like", "--textures", "-o") if flag in arguments]:
        raise ValueError(f"{', '.join(taken)} behind -- is the pool's own to say")


def make(folder, scenes, shares=None, shard_scenes=SHARD_SCENES, limit_bytes=None, textures=None, arguments=(), command="phasefront-lab"):
    """Makes the missing shards until there are `scenes` scenes or the disk limit is reached.

    textures: a folder of images for surfaces. arguments: more arguments for `phasefront-lab dataset`, such as --size
    256. After an interruption the same call resumes. Returns the number of shards.
    """
    shares = shares or SHARES
    check(shares, scenes, shard_scenes, arguments)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    wanted = scenes // shard_scenes
    for k in range(wanted):
        place = folder / f"shard_{k:04d}"
        if place.exists():
            continue
        if limit_bytes is not None and (used := size_of(folder)) >= limit_bytes:
            print(f"{folder}: {used / 2**30:.2f} GiB are there, the limit; {k} of {wanted} shards", file=sys.stderr)
            return k
        kind = kind_of(k, shares)
        begun = place.with_name(place.name + PART)
        named = ["--textures", str(textures)] if textures and kind != "objects" else []
        flags = ["--scenes", str(shard_scenes), "--seed", str(FIRST_SEED + k), "--scenes-like", kind, *named, *arguments]
        data.make(begun, flags, command)
        begun.rename(place)
    return wanted


def size_of(folder):
    """Returns the size in bytes of all files in a folder."""
    return sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())


def shards(folder):
    """Returns the manifests of the complete shards, in order."""
    found = sorted(path for path in Path(folder).glob("shard_*") if not path.name.endswith(PART))
    return [data.Manifest.read(path) for path in found]


def more_of(manifest, seeds, stacks):
    """Returns the seeds and the stacks of a shard in the folders of a pool's, as arguments of Scenes."""
    folders = {"seeds": (Seeds, seeds), "stacks": (Stacks, stacks)}
    return {name: kind.read(Path(folder) / manifest.folder.name) for name, (kind, folder) in folders.items() if folder}


def validation(folder, ldi_layers, scenes, seeds=None, stacks=None):
    """Returns one validation scene of each of the first `scenes` shards. seeds, stacks: the folders of the pool's."""
    first = shards(folder)[:scenes]
    parts = [data.Scenes(manifest, "validation", ldi_layers, 1, **more_of(manifest, seeds, stacks)) for manifest in first]
    return data.Scenes.joined(parts)


class Pool(data.Scenes):
    """The training scenes of a pool in memory. Each scene is a separate tensor, so that more scenes can be added.

    seeds, stacks: the folders of the pool's seeds and stacks, which hold those of each shard in a folder of the shard's
    name.
    """

    def __init__(self, folder, ldi_layers=1, limit=None, seeds=None, stacks=None):
        self.folder, self.limit, self.seeds, self.stacks = Path(folder), limit, seeds, stacks
        found = shards(folder)
        if not found:
            raise data.DataError(f"{folder}: no whole shard there yet; make the pool first (python -m phasefront_training pool)")
        self.known = set()
        first = self._read(found[0], ldi_layers)
        for name in ("display", "ldi_layers", "corrected", "seeded", "refined", "sensors"):
            setattr(self, name, getattr(first, name))
        self.origin, self.sets, self.damaged, self.numbers = {}, [], [], []
        self.tensors = TENSORS + (SEEDED if self.seeded else ()) + (STACKED if stacks else ())
        for name in self.tensors:
            setattr(self, name, [])
        self._take(first)
        self.look()

    @property
    def shape(self):
        return tuple(self.depth[0].shape[-2:])

    @property
    def facts(self):
        """The facts about the pool that a checkpoint keeps: the number of scenes of each kind."""
        kinds = {}
        for each in self.sets:
            known = kinds.setdefault(each["like"], dict(each) | {"scenes": 0, "shards": 0})
            known["scenes"] += each["scenes"]
            known["shards"] += 1
        facts = {"pool": True, "scenes": len(self), "size": self.shape[-1], "ldi_layers": self.ldi_layers, "sets": list(kinds.values())}
        return facts | ({"sensors": list(self.sensors)} if self.sensors else {})

    def stretch(self, i):
        return 1.0

    def look(self):
        """Adds the shards that are new since the last call. Returns the number of new scenes.

        A shard whose display or size differs from the first is reported and skipped.
        """
        before = len(self)
        for manifest in shards(self.folder):
            if manifest.folder.name in self.known:
                continue
            try:
                scenes = self._read(manifest, self.ldi_layers)
                self._fits(scenes, manifest)
            except data.DataError as error:
                print(f"{error}; left out", file=sys.stderr)
                continue
            self._take(scenes)
        return len(self) - before

    def _read(self, manifest, ldi_layers):
        self.known.add(manifest.folder.name)
        return data.Scenes(manifest, "train", ldi_layers, self.limit, **more_of(manifest, self.seeds, self.stacks))

    def _fits(self, scenes, manifest):
        for what in ("display", "shape", "corrected", "refined", "sensors"):
            mine, its = getattr(self, what), getattr(scenes, what)
            if mine != its:
                raise data.DataError(f"{manifest.folder}: its {what} is {its}, that of the other shards {mine}")

    def _take(self, scenes):
        self.sets.append(scenes.facts)
        self.damaged += scenes.damaged
        for name in self.tensors:
            getattr(self, name).extend(getattr(scenes, name))
        # The count changes last, because other threads may draw samples meanwhile.
        self.numbers += scenes.numbers


def parse_shares(texts):
    """Parses words such as varied=2 as {kind: share}."""
    try:
        pairs = (text.split("=") for text in texts)
        return {kind: float(share) for kind, share in pairs}
    except ValueError:
        raise ValueError("shares are written KIND=NUMBER, such as varied=2") from None
