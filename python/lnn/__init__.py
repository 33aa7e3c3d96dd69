"""Stabilized Lagrangian neural networks: learn ``L(q, dq/dt)`` from motion, predict it, read physics off it.

>>> import lnn
>>> pendulum = lnn.System("double-pendulum", m2=0.5)
>>> pendulum.acceleration([0.3, 0.1], [0.0, 0.0]).shape
(2,)

States are ``(q, v)`` with ``v = dq/dt``, arrays ``(..., n)`` of one state or any batch, in SI units and radians. Systems, models and
results can be pickled, and be used from any thread. `lnn.reader` is the part that needs no compiled code.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

__version__ = "0.1.0"

# Imported when it is asked for: `lnn.reader` needs none of it.
_WHERE = {
    **dict.fromkeys(["Model", "System", "systems"], "_mechanics"),
    **dict.fromkeys(["fit", "learn", "sweep", "train"], "_learning"),
    **dict.fromkeys(["check", "find_constraints", "formula", "identify"], "_readings"),
    **dict.fromkeys(["compare", "shadow"], "_views"),
    **dict.fromkeys(["Checked", "Comparison", "Shadow", "Surface", "Swept", "View"], "_results"),
    **dict.fromkeys(["Bodies", "ByTrajectory", "Certificate", "Combination", "Constraint", "Constraints", "Formula", "Geometry"], "_results"),
    **dict.fromkeys(["Identified", "IdentifiedConstant", "InverseDynamics", "Learned", "Linearization", "OfTrajectory", "Outlier", "OwnConstraints"], "_results"),
    **dict.fromkeys(["Event", "PeriodicDrive", "Residual", "Scatter", "SensorConstant", "Symmetries", "Trajectory", "Undetermined"], "_results"),
    "Terms": "reader",
    "LagrangianRegressor": "_regressor",
}
__all__ = [name for name, where in _WHERE.items() if where != "_regressor" or find_spec("sklearn")]

if TYPE_CHECKING:
    from ._learning import fit, learn, sweep, train
    from ._mechanics import Model, System, systems
    from ._readings import check, find_constraints, formula, identify
    from ._regressor import LagrangianRegressor
    from ._results import Bodies, ByTrajectory, Certificate, Checked, Combination, Comparison, Constraint, Constraints, Event, Formula, Geometry, Identified
    from ._results import IdentifiedConstant, InverseDynamics, Learned, Linearization, OfTrajectory, Outlier, OwnConstraints, PeriodicDrive, Residual
    from ._results import Scatter, SensorConstant, Symmetries, Trajectory
    from ._results import Shadow, Surface, Swept, Undetermined, View
    from ._views import compare, shadow
    from .reader import Terms


def __getattr__(name: str) -> object:
    if name not in _WHERE:
        raise AttributeError(f"module 'lnn' has no attribute {name!r}")
    from importlib import import_module

    try:
        found = getattr(import_module(f".{_WHERE[name]}", __name__), name)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] == __name__:
            raise
        raise AttributeError(f"lnn.{name} needs {error.name}, which is not installed") from error
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *_WHERE])
