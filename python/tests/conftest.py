"""What several tests use."""

from __future__ import annotations

import json
import subprocess

import pytest
from models import BALL, BELT, BUILT

import nsdc


@pytest.fixture
def ball() -> nsdc.Experiment:
    return nsdc.loads(BALL, "ball.nsd")["falls"]


@pytest.fixture
def belt() -> nsdc.Experiment:
    return nsdc.loads(BELT, "belt.nsd")["pulls"]


@pytest.fixture(scope="session")
def read() -> dict[str, dict]:
    """Texts with their tokens, as the compiler reads them: `cargo build -p nsd-tests --example editors` makes what prints
    them."""
    printed = subprocess.run([BUILT / "examples/editors", "--tokens"], capture_output=True, check=True)
    return json.loads(printed.stdout)
