"""The chunk function of a study on Dask: worker processes of this machine, or those of a scheduler
elsewhere that see the same folder.

The chunk files are the only interface: a worker writes its file and returns nothing. If a worker
dies, its chunk is tried again on a new one. If that dies too, the runs are tried one by one, runs
that kill a worker alone are quarantined, and the chunk is run without them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from logging import CRITICAL
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from ...checks import DataError
from ...extras import optional_import
from ...plugins import SESSION, require
from ...typing import Notify
from .chunks import Chunk, compile_for, plugins_of, run_chunk

if TYPE_CHECKING:
    from dask.distributed import Client, Future, LocalCluster

    from .campaign import Campaign
    from .study import Study

ATTEMPTS = 2
"""Workers that a chunk may kill before its runs are tried one by one."""
CLUSTER_PATIENCE = 10
"""s to wait for a scheduler, and between two looks at the workers."""


def run(
    campaign: Campaign,
    missing: list[Chunk],
    workers: int,
    scheduler: str | None,
    notify: Notify | None = None,
) -> Iterator[Chunk]:
    """Run the missing chunks of a campaign on `workers` processes, or on the cluster of
    `scheduler`; yield each when its file is there."""
    if not missing:
        return
    study = campaign.study
    assert study is not None  # it began this campaign
    needed = _needed_plugins(study)
    if not scheduler:
        compile_for(study, notify)  # once, into the cache that the workers load from
    with _client(workers, scheduler) as client:
        from dask.distributed import as_completed

        options = {"pure": False, "retries": 0}
        futures = {
            client.submit(_work, needed, campaign, chunk, **options): chunk for chunk in missing
        }
        waiting = as_completed(futures)  # type: ignore[no-untyped-call]
        tried = dict.fromkeys(missing, 0)
        for future in waiting:
            chunk = futures[future]
            if not _is_killed(future):
                future.result()
                yield chunk
                continue
            tried[chunk] += 1
            again = client.submit(
                _work,
                needed,
                campaign,
                chunk,
                _killers(client, needed, study, chunk, tried[chunk], notify),
                **options,
            )
            futures[again] = chunk
            waiting.add(again)  # type: ignore[no-untyped-call]


def _needed_plugins(study: Study) -> list[tuple[str, str]]:
    """[(name, where)] of the plugins that a worker must have. Raises DataError."""
    needed = [(plugin.name, plugin.where) for plugin in plugins_of(study)]
    if (SESSION, "") in needed:
        raise DataError(
            "worker processes cannot see plugins that were registered in a session: write the plugin into a "
            "file, register it there and import that file"
        )
    return needed


def _work(
    needed: list[tuple[str, str]], campaign: Campaign, chunk: Chunk, skip: tuple[int, ...] = ()
) -> Chunk:
    require(needed)
    return campaign.work(chunk, skip)


def _is_killed(future: Future[Any]) -> bool:
    """True where the task killed its worker; any other failure is raised where the result is
    read."""
    from distributed.scheduler import KilledWorker

    if future.status != "error":
        return False
    return isinstance(future.exception(), KilledWorker)  # type: ignore[no-untyped-call]


def _killers(
    client: Client,
    needed: list[tuple[str, str]],
    study: Study,
    chunk: Chunk,
    times: int,
    notify: Notify | None,
) -> tuple[int, ...]:
    """Return the runs of a chunk that kill their worker alone, tested one after the other. Raises
    DataError."""
    from dask.distributed import wait

    cell, killers = study.cells[chunk.cell], []
    for number in range(chunk.first, chunk.stop):
        alone = client.submit(
            _probe, needed, study, Chunk(chunk.cell, number, number + 1), pure=False
        )
        wait(alone)  # type: ignore[no-untyped-call]
        if not _is_killed(alone):
            alone.result()
            continue
        killers.append(number)
        if notify:
            notify(
                f"{cell.name}: run {number} kills its worker; it is quarantined (seed {study.seed}, "
                f"run {number})"
            )
    if not killers and times == ATTEMPTS:
        raise DataError(
            f"{cell.name}, runs {chunk.first} to {chunk.stop - 1}: together they kill their worker, "
            f"but none does alone; "
            "memory may be short: use fewer workers and run again, finished chunks are kept"
        )
    return tuple(killers)


def _probe(needed: list[tuple[str, str]], study: Study, chunk: Chunk) -> None:
    require(needed)
    run_chunk(study, chunk)


@contextmanager
def _kept_alive(cluster: LocalCluster, workers: int) -> Iterator[None]:
    """Start new workers where two successive checks find none: occasionally a dead worker is not
    restarted, and the campaign would wait forever."""
    over = Event()

    def watch() -> None:
        empty = 0
        while not over.wait(CLUSTER_PATIENCE):
            known = cluster.scheduler.workers  # type: ignore[union-attr]  # it has one until closed
            empty = 0 if known else empty + 1
            if empty == 2:
                cluster.scale(0)  # type: ignore[no-untyped-call]
                cluster.scale(workers)  # type: ignore[no-untyped-call]
                empty = 0

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """A Dask client of an own cluster of processes, or of a scheduler's. Raises DataError."""
    with optional_import():
        import dask
        from dask.distributed import Client, LocalCluster
    if not scheduler:
        dask.config.set(
            {
                "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
                "distributed.scheduler.worker-saturation": 1.0,
            }
        )
        with LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",
            silence_logs=CRITICAL,
        ) as cluster:
            with (
                Client(cluster) as client,  # type: ignore[no-untyped-call]
                _kept_alive(cluster, workers),
            ):
                yield client
        return
    try:
        client = Client(scheduler, timeout=f"{CLUSTER_PATIENCE}s")  # type: ignore[no-untyped-call]
        client.wait_for_workers(1, CLUSTER_PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise DataError(
            f"scheduler {scheduler}: no answer, or it has no workers "
            f"({str(error).splitlines()[0]}); check the address"
        ) from None
    with client:
        yield client
