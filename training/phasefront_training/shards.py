"""Makes a data set with many processes or machines: each shard of `phasefront-lab dataset` is a Ray task.

All tasks write to one folder. Every machine must have the folder and the command under the same paths. A pair is
renamed to its final name when it is complete, so shards do not depend on each other, and a stopped run can resume with
any number of shards. Ray is an extra: `pip install './training[ray]'`.
"""

import subprocess
import sys
from pathlib import Path

from tqdm import tqdm

from .data import DataError

SHARDS_PER_SLOT = 4  # scenes differ in cost, and small shards keep all machines busy to the end
RETRIES = 2  # of a shard whose machine was lost


def make(output, arguments, command="phasefront-lab", address=None, shards=None, cpus=1):
    """Makes the data set in `output` with `shards` tasks of `cpus` cores. Returns the number of shards.

    `address` is the address of the Ray cluster. None starts a cluster on this machine for the duration of the call.
    Raises DataError if Ray is not installed or a shard fails.
    """
    try:
        import ray
    except ImportError:
        raise DataError("Ray is not installed: pip install './training[ray]', or make the data set by `data`") from None
    if cpus < 1 or (shards is not None and shards < 1):
        raise DataError("--cpus and --shards must be 1 or more")
    begun_here = not ray.is_initialized()
    if begun_here:
        try:
            ray.init(address=address or "local", log_to_driver=False, include_dashboard=False if address is None else None)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise DataError(f"no Ray cluster at '{address or 'local'}': {str(error).splitlines()[0]}") from None
    try:
        slots = int(ray.cluster_resources().get("CPU", 0)) // cpus
        if slots == 0:
            raise DataError(f"no machine of the cluster has {cpus} cores for a task; lower --cpus")
        count = shards or SHARDS_PER_SLOT * slots
        task = ray.remote(num_cpus=cpus, max_retries=RETRIES)(_run)
        output = str(Path(output).absolute())
        pending = [task.remote(_call(command, arguments, output, i, count, cpus)) for i in range(count)]
        with tqdm(total=count, desc="shards", disable=not sys.stderr.isatty()) as bar:
            while pending:
                finished, pending = ray.wait(pending)
                for failure in ray.get(finished):
                    if failure:
                        raise DataError(failure)
                bar.update(len(finished))
        return count
    except ray.exceptions.RayError as error:
        raise DataError(f"Ray: {str(error).splitlines()[0]}") from None
    finally:
        if begun_here:
            ray.shutdown()


def _call(command, arguments, output, shard, count, cpus):
    return [command, "dataset", *arguments, "--shard", f"{shard}/{count}", "--threads", str(cpus), "-o", output]


def _run(call):
    """Runs a shard on this machine. Returns an error message or None."""
    try:
        done = subprocess.run(call, capture_output=True, text=True, check=False)
    except OSError as error:
        return f"'{call[0]}' cannot be run on every machine: {error.strerror}"
    if done.returncode == 0:
        return None
    last = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
    return f"'{' '.join(call)}' failed: {last}"
