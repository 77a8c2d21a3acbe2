"""Sweeps on clusters: the rows of a sweep on threads, whatever the chunks are, and whoever is lost."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest
from models import BALL, BELT

import nsdc

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def same(one: nsdc.Sweep, other: nsdc.Sweep) -> bool:
    """Bit for bit."""
    for column in ("ends", *nsdc._chunks.Rows.COLUMNS):
        np.testing.assert_array_equal(getattr(one._rows, column), getattr(other._rows, column))
    return one._rows.names == other._rows.names


def test_rows_do_not_depend_on_chunks(client) -> None:
    belt = nsdc.loads(BELT)["pulls"]
    axes = {"mu": np.linspace(-0.3, 0.9, 25), "speed": [0.1, 0.3]}
    here = belt.sweep(**axes)
    for chunk in (1, 7, 50):
        assert same(belt.sweep(**axes, on=client, chunk=chunk), here)
    assert same(belt.sweep(**axes, on=client), here)


def test_failed_runs_are_rows(client) -> None:
    grows = nsdc.loads("model m { state x = 1; x' = x^2; } simulate s of m { horizon 2; }")["s"]
    x = np.linspace(0.1, 1, 10)
    assert same(grows.sweep(x=x, on=client, chunk=3), grows.sweep(x=x))


def test_a_first_row_that_is_refused_is_a_row(client) -> None:
    ball = nsdc.loads(BALL)["falls"]
    for chunk in (None, 1, 2):
        found = ball.sweep(e=[3, 0.5, 0.6], on=client, chunk=chunk)
        assert found.status.tolist() == ["refused", "solved", "solved"]


def test_a_lost_worker_loses_nothing(client) -> None:
    belt = nsdc.loads(BELT)["pulls"]
    mu = np.linspace(0.1, 0.9, 3000)
    here = belt.sweep(mu=mu)
    pids = list(client.run(os.getpid).values())

    def lose() -> None:
        time.sleep(0.3)
        os.kill(pids[0], signal.SIGKILL)

    thread = threading.Thread(target=lose)
    thread.start()
    found = belt.sweep(mu=mu, on=client, chunk=100)
    thread.join()
    assert pids[0] not in client.run(os.getpid).values()
    assert same(found, here)


def test_checkpoints_go_on(client, tmp_path) -> None:
    pytest.importorskip("pyarrow")
    belt = nsdc.loads(BELT)["pulls"]
    mu = np.linspace(0.1, 0.9, 60)
    here = belt.sweep(mu=mu)
    first = belt.sweep(mu=mu, on=client, chunk=10, checkpoint=tmp_path)
    chunks = sorted(tmp_path.glob("*.parquet"))
    assert len(chunks) == 6 and same(first, here)
    for lost in chunks[2:4]:
        lost.unlink()
    kept = {path: path.stat().st_mtime_ns for path in chunks if path.exists()}
    assert same(belt.sweep(mu=mu, on=client, chunk=10, checkpoint=tmp_path), here)
    assert all(path.stat().st_mtime_ns == known for path, known in kept.items())
    assert sorted(tmp_path.glob("*.parquet")) == chunks


@pytest.mark.slow
def test_ray_has_the_same_rows() -> None:
    ray = pytest.importorskip("ray")
    belt = nsdc.loads(BELT)["pulls"]
    mu = np.linspace(-0.3, 0.9, 40)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        for chunk in (3, 40):
            assert same(belt.sweep(mu=mu, on="ray", chunk=chunk), belt.sweep(mu=mu))
    finally:
        ray.shutdown()
