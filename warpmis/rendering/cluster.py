"""One picture by many workers: rows of pixels as tasks, put together where they belong.

Each row's sums are a function of the row alone, and a pixel's samples are added up one after another wherever they are
taken. So the picture has the bits of one machine, whatever worker did what, and however often one was lost.
"""

from __future__ import annotations

import logging
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from warpmis.config import RenderConfig
from warpmis.device.cpus import available_cpus
from warpmis.device.snapshot import restore
from warpmis.errors import ConfigError, WarpmisError
from warpmis.learn.schedule import Round
from warpmis.rendering import cluster_worker
from warpmis.rendering.cluster_worker import Job, Task, Traced
from warpmis.rendering.fingerprint import program_fingerprint, scene_fingerprint
from warpmis.rendering.held import interrupts_held
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.run import Run

# A task takes about so long, so that a lost one costs little and an end comes soon [s].
TASK_SECONDS = 3.0
# Tasks at a worker or on their way to it.
IN_FLIGHT = 2
# Few passes, since each sends the sums to and fro: of so many samples, so many times as many, and so on.
FIRST_PASS, GROWTH, PASS_SECONDS = 16, 8, 60.0
# So often a task may be lost with its worker.
MOST_LOSSES = 20
TICK = 0.5
CONNECT_SECONDS = 10
# A process of this machine that is not back after so long is started anew; without any worker we give up [s].
RESTART_SECONDS = 20.0
PATIENCE = 120.0

# Rows, how often they were lost, and the worker that has them.
Pending = tuple[range, int, str]

HINT = "is an extra: pip install warpmis[distributed]"


class Farm:
    """Workers that trace rows of pictures.

    Attributes:
        is_local: whether they are processes of this machine, which share its compiled kernels.
        ships: whether tasks bring the scene with them, instead of a path.
        source: path and options of the stage at work, None where there is no path.
        lost: how many workers were lost.
    """

    def __init__(self, client: Any, *, local: Any = None, ships: bool, tell: Callable[[str], None]) -> None:
        """local: the LocalCluster, if these are processes of this machine."""
        self.client = client
        self.local = local
        self.is_local = local is not None
        self.most = 0
        self.complete = time.monotonic()  # when there were as many workers as ever
        self.ships = ships
        self.tell = tell
        self.source: tuple[str, dict[str, Any]] | None = None
        self.lost = 0
        self.pace: float | None = None  # samples per second of one worker
        self.known = self._workers()
        self._check_versions()

    def _workers(self) -> set[str]:
        return set(self.client.scheduler_info(n_workers=-1)["workers"])

    @property
    def workers(self) -> int:
        return max(len(self.known), 1)

    def _check_versions(self) -> None:
        own = program_fingerprint()
        try:
            programs = self.client.run(cluster_worker.program)
        except Exception as error:
            raise WarpmisError(f"the cluster's workers cannot run warpmis: {one_line(error)}") from error
        others = [address for address, found in programs.items() if found != own]
        if others:
            raise WarpmisError(f"the worker at {others[0]} has another version of warpmis or Warp: install one")

    # ---- a picture -------------------------------------------------------------------------------------------------

    def join(self, run: Run) -> None:
        """Let a run that is about to trace do so on the workers."""
        path, options = self.source or ("", {})
        by_path = bool(path) and not self.ships
        job = Job(
            name=uuid.uuid4().hex,
            scene=None if by_path else run.scene,
            stage=path,
            options={**options, "time": run.scene.time} if by_path else {},
            fingerprint=scene_fingerprint(run.scene),
            program=program_fingerprint(),
            config=run.config,
            features=run.features,
        )
        shared = self.submit(cluster_worker.same, job)
        picture = Picture(self, run, shared)
        run.integrator.remote = picture.trace
        run.first_pass, run.growth, run.pass_seconds = FIRST_PASS, GROWTH, PASS_SECONDS

    def submit(self, function: Callable[..., Any], *arguments: Any, address: str = "") -> Any:
        """A task, for this worker, or for another one if it is lost; "" for any."""
        where: dict[str, Any] = {"workers": [address], "allow_other_workers": True} if address else {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of the size of what is sent
            return self.client.submit(function, *arguments, pure=False, **where)

    def look_for_lost(self) -> None:
        """One line for each worker that is gone; a new process in its place, where Dask does not start one.

        Raises:
            WarpmisError: there has been no worker for a while.
        """
        present = self._workers()
        for address in self.known - present:
            self.lost += 1
            self.tell(f"a worker is lost ({address}): others do its tasks")
        self.known = present
        self.most = max(self.most, len(present))
        if len(present) == self.most:
            self.complete = time.monotonic()
        missing_for = time.monotonic() - self.complete
        if self.local is not None and missing_for > RESTART_SECONDS:
            self.local.scale(len(self.local.worker_spec) + self.most - len(present))
            self.complete = time.monotonic()
        elif not present and missing_for > PATIENCE:
            raise WarpmisError(f"the cluster has had no worker for {PATIENCE:.0f} s: start some, and render again")


class Picture:
    """The tasks of one picture."""

    def __init__(self, farm: Farm, run: Run, job: Any) -> None:
        self.farm = farm
        self.run = run
        self.job = job
        self.round = -1
        self.common: Any = None

    def trace(self, part: Round, piece: range, samples: range, advance: Callable[[int], None]) -> None:
        """Trace some samples of a round on the workers; see Integrator.trace.

        Raises:
            WarpmisError: a task fails for another reason than a worker that is lost.
        """
        farm, integrator = self.farm, self.run.integrator
        if self.round != self.run.round:
            self.round = self.run.round
            self.common = farm.submit(cluster_worker.same, integrator.common_of(part))
        if farm.is_local:
            integrator.compiler.wait([integrator.target_of(part).kernel])  # once, not in every process
        left = list(self._chunks(integrator.rows_of(part), len(samples)))
        pending: dict[Any, Pending] = {}
        begun = self.run.reporter.tracing_seconds()
        try:
            while left or pending:
                while left and len(pending) < IN_FLIGHT * farm.workers:
                    self._add(pending, left.pop(0), 0, part, piece, samples)
                for future in self._done(pending):
                    rows, losses, _ = pending.pop(future)
                    found = self._result_of(future, losses)
                    if found is None:
                        self._add(pending, rows, losses + 1, part, piece, samples)
                        continue
                    put(integrator, part, rows, found)
                    advance(found.samples)
                    self.run.between(part.is_kept)
        finally:
            farm.client.cancel(list(pending))
        seconds = self.run.reporter.tracing_seconds() - begun
        farm.pace = integrator.rows_of(part) * len(samples) / max(seconds * farm.workers, 1e-6)

    def _chunks(self, rows: int, samples: int) -> Iterator[range]:
        """The rows that are not through, in parts of about TASK_SECONDS, smaller towards the end."""
        traced = self.run.integrator.traced
        pace, workers = self.farm.pace, self.farm.workers
        most = -(-rows // (4 * workers)) if pace is None else max(1, int(pace * TASK_SECONDS / samples))
        least = max(1, most // 8)
        first = 0
        while first < rows:
            count = min(rows - first, most, max(least, (rows - first) // (2 * workers)))
            if not traced[first : first + count].all():
                yield range(first, first + count)
            first += count

    def _add(
        self, pending: dict[Any, Pending], rows: range, losses: int, part: Round, piece: range, samples: range
    ) -> None:
        """Give the rows to the worker that has least to do; Dask would rather send them where the stage is already."""
        tasks = dict.fromkeys(self.farm.known, 0)
        for _, _, address in pending.values():
            tasks[address] = tasks.get(address, 0) + 1
        address = min(sorted(self.farm.known), key=lambda one: tasks[one], default="")
        pending[self._submit(part, piece, samples, rows, address)] = rows, losses, address

    def _submit(self, part: Round, piece: range, samples: range, rows: range, address: str) -> Any:
        integrator, span = self.run.integrator, slice(rows.start, rows.stop)
        sums = cluster_worker.sums_in(integrator, part, span)
        is_new = not any(array.any() for one in sums.values() for array in one.values())
        task = Task(
            round=self.round,
            part=part,
            piece=piece,
            samples=samples,
            rows=rows,
            traced=integrator.traced[span].copy(),
            decisions=cluster_worker.decisions_in(integrator, part, span),
            sums={} if is_new else sums,
        )
        return self.farm.submit(cluster_worker.trace_rows, self.job, self.common, task, address=address)

    def _done(self, pending: dict[Any, Any]) -> list[Any]:
        """Those that are through, waiting for one; meanwhile workers may be lost."""
        from distributed import wait

        while True:
            self.farm.look_for_lost()
            try:
                with self.farm.client.as_current():
                    return list(wait(list(pending), timeout=TICK, return_when="FIRST_COMPLETED").done)
            except TimeoutError:
                self.run.reporter.advance(0)

    def _result_of(self, future: Any, losses: int) -> Traced | None:
        """None where the task is to be done again, because its worker was lost."""
        if future.status == "finished":
            try:
                found: Traced = future.result()
                return found
            except Exception as error:  # lost between its end and our asking
                failure: Any = error
        else:
            failure = future.exception() if future.status == "error" else None
        if is_loss(failure) and losses < MOST_LOSSES:
            return None
        if isinstance(failure, WarpmisError):
            raise failure
        raise WarpmisError(f"a task on the cluster failed: {one_line(failure)}")


def is_loss(failure: object) -> bool:
    """Whether a task failed with its worker: it may be done again."""
    from distributed.client import FutureCancelledError
    from distributed.scheduler import KilledWorker

    return failure is None or isinstance(failure, KilledWorker | FutureCancelledError | OSError)


def put(integrator: Integrator, part: Round, rows: range, found: Traced) -> None:
    """What a task brought, where it belongs."""
    span = slice(rows.start, rows.stop)
    with interrupts_held():
        for name, sums in integrator.sums_of(part).items():
            restore(sums, found.sums[name], span)
        integrator.put_records(found.records)
        integrator.traced[span] = True


# ---- clusters -------------------------------------------------------------------------------------------------------


@contextmanager
def farm_of(
    cluster: Any, config: RenderConfig, *, ship_stage: bool = False, tell: Callable[[str], None] | None = None
) -> Iterator[Farm | None]:
    """The workers of "local:N", of a scheduler's address, or of a distributed.Client; None without a cluster.

    Raises:
        ConfigError: the extra is missing, or there is no such cluster.
        WarpmisError: the workers are of another version.
    """
    if cluster is None or isinstance(cluster, Farm):
        yield cluster
        return
    _require_distributed()
    say = tell or (lambda line: None)
    if not isinstance(cluster, str):
        yield Farm(cluster, ships=ship_stage, tell=say)
        return
    is_local = cluster.startswith("local:")
    with (
        _quiet(),
        _local(cluster.removeprefix("local:"), config) if is_local else _remote(cluster) as client,
    ):
        yield Farm(client, local=client.cluster if is_local else None, ships=ship_stage, tell=say)


def _require_distributed() -> None:
    try:
        import_module("distributed")
    except ImportError:
        raise ConfigError(f"a cluster needs Dask's distributed, which {HINT}") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """What Dask has to say goes through `tell`; a worker that is lost is no reason to give up, nor is a full memory."""
    import dask

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    memory = {f"distributed.worker.memory.{name}": False for name in ("target", "spill", "pause", "terminate")}
    with dask.config.set({"distributed.scheduler.allowed-failures": MOST_LOSSES, **memory}):
        yield


@contextmanager
def _local(text: str, config: RenderConfig) -> Iterator[Any]:
    """So many processes on this machine, which share its CPUs."""
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise ConfigError(f"'local:{text}' is not a number of processes such as local:2")
    from distributed import Client, LocalCluster

    count = int(text)
    threads = max(1, (config.threads or available_cpus()) // count)
    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            silence_logs=logging.CRITICAL,
            env={cluster_worker.THREADS: str(threads)},
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.run(cluster_worker.ignore_interrupts)
        yield client


@contextmanager
def _remote(address: str) -> Iterator[Any]:
    from distributed import Client

    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ConfigError(f"there is no scheduler at {address}: {one_line(error)}") from None
    with client:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            raise ConfigError(f"the scheduler at {address} has no workers: start one with `dask worker {address}`")
        yield client


def one_line(error: object) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]
