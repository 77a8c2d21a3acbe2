"""Rows of a sweep, and chunks of them that clusters and folders take."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core

if TYPE_CHECKING:
    from ._progress import Bar
    from ._sweep import Engine, Plan

#: Seconds that a chunk takes, and those that are measured for it.
CHUNK, MEASURED = 0.75, 0.05


@dataclass(frozen=True)
class Rows:
    """Rows of a sweep as columns, m of them."""

    #: The entries of what is at the end.
    names: list[str]
    #: Shape (m, len(names)).
    ends: NDArray[np.float64]
    #: Each of shape (m,); empty words where there is nothing.
    status: NDArray[np.str_]
    codes: NDArray[np.str_]
    events: NDArray[np.int64]
    error_estimates: NDArray[np.float64]
    objectives: NDArray[np.float64]
    missed: NDArray[np.int64]
    is_interrupted: bool = False

    COLUMNS = ("status", "codes", "events", "error_estimates", "objectives", "missed")

    @classmethod
    def of(cls, rows: _core.Rows, outputs: tuple[str, ...] | None) -> Rows:
        """Those of a call, with what is kept of their ends."""
        names = rows.columns
        kept = [
            k
            for k, name in enumerate(names)
            if outputs is None or name in outputs or name.split("[")[0] in outputs
        ]
        ends = rows.ends if len(kept) == len(names) else rows.ends[:, kept]
        return cls(
            [names[k] for k in kept],
            ends,
            np.array([status or "" for status in rows.status], dtype=str),
            np.array([code or "" for code in rows.codes], dtype=str),
            rows.events,
            rows.error_estimates,
            rows.objectives,
            rows.missed,
            rows.is_interrupted,
        )

    @classmethod
    def joined(cls, count: int, parts: dict[int, Rows], is_interrupted: bool) -> Rows:
        """Rows by the number of the first of each part; those that are in none are missing."""
        names = next((part.names for part in parts.values() if part.names), [])
        ends = np.full((count, len(names)), np.nan)
        words = {
            column: np.zeros(count, dtype=f"U{_longest(parts, column)}")
            for column in ("status", "codes")
        }
        made = cls(
            names,
            ends,
            **words,
            events=np.full(count, -1),
            error_estimates=np.full(count, np.nan),
            objectives=np.full(count, np.nan),
            missed=np.full(count, -1),
            is_interrupted=is_interrupted,
        )
        for first, part in parts.items():
            place = slice(first, first + len(part.status))
            if part.names:
                ends[place] = part.ends
            for column in cls.COLUMNS:
                getattr(made, column)[place] = getattr(part, column)
        return made


def _longest(parts: dict[int, Rows], column: str) -> int:
    widths: list[int] = [getattr(part, column).dtype.itemsize // 4 for part in parts.values()]
    return max([1, *widths])


class Folder:
    """Finished chunks of one sweep as Parquet files."""

    def __init__(self, path: str | os.PathLike[str], key: str) -> None:
        if not os.fspath(path):
            raise ValueError("checkpoint: expected a folder, got an empty path")
        self._path = Path(path)
        self._path.mkdir(parents=True, exist_ok=True)
        told = self._path / "sweep.json"
        if told.exists():
            try:
                known = json.loads(told.read_text(encoding="utf-8"))["key"]
            except (ValueError, KeyError, TypeError):
                raise ValueError(f"checkpoint: `{told}` is not that of a sweep") from None
            if known != key:
                raise ValueError(f"checkpoint: `{path}` has chunks of another sweep")
        else:
            _replaced(told, json.dumps({"key": key}).encode())

    def read(self) -> dict[int, Rows]:
        """The chunks that are finished, by the number of their first row."""
        import pyarrow.parquet

        found = {}
        for path in sorted(self._path.glob("rows-*.parquet")):
            table = pyarrow.parquet.read_table(path)
            metadata = table.schema.metadata or {}
            names = json.loads(metadata[b"names"])
            ends = [table[f"end {name}"].to_numpy() for name in names]
            columns: dict[str, Any] = {
                column: np.array(table[column].to_pylist(), dtype=str)
                if column in ("status", "codes")
                else table[column].to_numpy()
                for column in Rows.COLUMNS
            }
            stacked = np.column_stack(ends) if ends else np.zeros((len(table), 0))
            found[int(path.stem.split("-")[1])] = Rows(names, stacked, **columns)
        return found

    def write(self, first: int, rows: Rows) -> None:
        """Keeps a chunk, whole."""
        import pyarrow
        import pyarrow.parquet

        ends = {f"end {name}": rows.ends[:, k] for k, name in enumerate(rows.names)}
        table = pyarrow.table({**{column: getattr(rows, column) for column in Rows.COLUMNS}, **ends})
        table = table.replace_schema_metadata({b"names": json.dumps(rows.names).encode()})
        sink = pyarrow.BufferOutputStream()
        pyarrow.parquet.write_table(table, sink)
        name = f"rows-{first:09}-{first + len(rows.status):09}.parquet"
        _replaced(self._path / name, sink.getvalue().to_pybytes())


def _replaced(path: Path, content: bytes) -> None:
    """Writes a file whole, or not at all."""
    temporary = path.with_suffix(f".{os.getpid()}.part")
    temporary.write_bytes(content)
    os.replace(temporary, path)


def in_chunks(plan: Plan, count: int, engine: Engine, folder: Folder | None, bar: Bar) -> Rows:
    """All rows, by chunks here or on a cluster; those in the folder are taken from there."""
    parts = {} if folder is None else folder.read()
    done = sum(len(part.status) for part in parts.values())

    def keep(first: int, part: Rows) -> None:
        nonlocal done
        parts[first] = part
        done += len(part.status)
        if folder is not None and not part.is_interrupted:
            folder.write(first, part)
        bar.show(done)

    try:
        size = engine.chunk or _measured(plan, count, parts, keep)
        ranges = [
            (first, min(first + size, last))
            for start, last in _gaps(count, parts)
            for first in range(start, last, size)
        ]
        for first, part in _worked(plan, ranges, engine):
            keep(first, part)
    except KeyboardInterrupt:
        return Rows.joined(count, parts, True)
    return Rows.joined(count, parts, any(part.is_interrupted for part in parts.values()))


def _gaps(count: int, parts: dict[int, Rows]) -> Iterator[tuple[int, int]]:
    """The rows that are in no part."""
    place = 0
    for first in sorted(parts):
        if first > place:
            yield place, first
        place = max(place, first + len(parts[first].status))
    if place < count:
        yield place, count


def _measured(plan: Plan, count: int, parts: dict[int, Rows], keep: Any) -> int:
    """Runs of a chunk, from the time that the first ones take, here and on one thread."""
    gap = next(_gaps(count, parts), None)
    if gap is None:
        return 1
    # What is compiled in the first is not what runs take.
    first, size, seconds = gap[0], 1, 0.0
    while first < gap[1] and seconds < MEASURED:
        last = min(first + size, gap[1])
        started = time.perf_counter()
        part = plan.rows(first, last, 1, None)
        seconds = time.perf_counter() - started
        keep(first, part)
        if part.is_interrupted:
            raise KeyboardInterrupt
        size, first, ran = 2 * size, last, last - first
    return max(1, int(CHUNK * ran / seconds))


def _worked(plan: Plan, ranges: list[tuple[int, int]], engine: Engine) -> Iterator[tuple[int, Rows]]:
    """Chunks, as they are finished."""
    if engine.on is None:
        for first, last in ranges:
            part = plan.rows(first, last, engine.threads, None)
            yield first, part
            if part.is_interrupted:
                return
    elif isinstance(engine.on, str) and engine.on == "ray":
        yield from _by_ray(plan, ranges)
    elif hasattr(engine.on, "map") and hasattr(engine.on, "scheduler_info"):
        yield from _by_dask(plan, ranges, engine.on)
    else:
        raise TypeError(f"on: expected a dask.distributed.Client or 'ray', got {engine.on!r}")


def work(span: tuple[int, int], plan: Plan) -> tuple[int, Rows]:
    """A chunk, on a worker, which may have one thread for it."""
    return span[0], plan.rows(*span, 1, None)


def _by_dask(plan: Plan, ranges: list[tuple[int, int]], client: Any) -> Iterator[tuple[int, Rows]]:
    import distributed

    # A task whose worker is lost is done by another; its rows are the same.
    futures = client.map(work, ranges, plan=plan, pure=False, retries=3)
    try:
        for _, found in distributed.as_completed(futures, with_results=True):
            yield found
    finally:
        client.cancel(futures)


def _by_ray(plan: Plan, ranges: list[tuple[int, int]]) -> Iterator[tuple[int, Rows]]:
    import ray

    task = ray.remote(work).options(num_cpus=1, max_retries=3)
    shared, left = ray.put(plan), list(reversed(ranges))
    # Some more than are worked on: no worker waits, and no queue grows.
    most = 4 * max(1, int(ray.cluster_resources().get("CPU", 1)))
    running: list[Any] = []
    try:
        while left or running:
            while left and len(running) < most:
                running.append(task.remote(left.pop(), shared))
            finished, running = ray.wait(running)
            yield from ray.get(finished)
    finally:
        for one in running:
            ray.cancel(one)
