"""Models of several tests."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"

#: What `cargo build` makes.
BUILT = ROOT / (os.environ.get("CARGO_TARGET_DIR") or "target") / "debug"

#: x' = v, v' = -g, and v := -e*v where it strikes.
BALL = """
model ball {
  /// On Earth.
  param g : m/s^2 in [0, 100] = 9.81;
  param e in [0, 1] = 0.5;
  state q : m = 1;
  state v : m/s = 0;
  q' = v; v' = -g;
  jump floor when q <= 0 m and v < 0 m/s { v := -e*v; }
  output energy = g*q + v^2/2;
}
/// A ball that is let go.
simulate falls of ball { horizon 1; }
"""


def agree(name: str, text: Any, tokens: Iterable[tuple[str, Any]], found: Sequence[str]) -> None:
    """Tokens, in order, have the kinds that were found at all of their characters."""
    at = 0
    for kind, written in tokens:
        at = text.index(written, at)
        end = at + len(written)
        assert set(found[at:end]) == {kind}, (name, written, text[max(at - 40, 0) : end + 40])
        at = end


#: A block on a belt: sticks, slips, and swings.
BELT = """
model belt {
  param mu = 0.6; param speed = 0.3;
  state x[2] = [0, 1];
  x' = [x[2], -x[1] - mu*sign(x[2] - speed)];
}
simulate pulls of belt { horizon 20; }
"""
