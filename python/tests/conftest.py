"""What several tests use."""

from __future__ import annotations

import pytest
from models import BALL, BELT

import nsdc


@pytest.fixture
def ball() -> nsdc.Experiment:
    return nsdc.loads(BALL, "ball.nsd")["falls"]


@pytest.fixture
def belt() -> nsdc.Experiment:
    return nsdc.loads(BELT, "belt.nsd")["pulls"]
