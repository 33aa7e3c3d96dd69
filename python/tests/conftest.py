import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from kinds import kinds  # noqa: E402


@pytest.fixture(scope="session")
def models():
    """A model file of every kind, by name."""
    return kinds()


@pytest.fixture(scope="session")
def shipped():
    """The model that ships with the repository."""
    return Path(__file__).parents[2] / "examples/data/double_pendulum.safetensors"
