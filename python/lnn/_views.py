"""Lagrangians beside each other, and what is seen through metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from . import _lnn
from ._arrays import as_json, bounds_of, names, read_result, real, thread_count, whole
from ._mechanics import Model, System
from ._progress import Progress, receiver
from ._results import Comparison, Shadow, View


def compare(
    first: System | Model | str,
    second: System | Model | str,
    *,
    region: Mapping[str, tuple[float, float]] | None = None,
    basis: str | None = None,
    points: int | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares two Lagrangians A and B of the same coordinates up to factor and gauge, by the best ``A = s B + dF/dt + constant``.

    Parameters
    ----------
    first, second : System, Model or str
        A and B; a name is one of the catalogue.
    region : dict of str to (low, high), optional
        Bounds of the states that are looked at, by column; those of both by default.
    basis : str, optional
        Functions that F is made of, such as ``"polynomial:2,trigonometric:1"``.

    Examples
    --------
    >>> import lnn
    >>> found = compare(lnn.System("kepler", mu=2.0), "kepler")
    >>> found.motion > 0.1 and abs(compare("kepler", "kepler").factors[0] - 1) < 1e-9
    True
    """
    first, second = (System(one) if isinstance(one, str) else one for one in (first, second))
    points = None if points is None else whole("points", points, 1)
    text = _lnn.compare_lagrangians(first._subject, second._subject, bounds_of(region), basis, points, whole("seed", seed))
    fields = read_result(text)
    number = lambda x: np.nan if x is None else x
    for name in "factors", "group_factors", "gauge":
        fields[name] = np.array(fields[name], float)
    for name in "lagrangian", "motion", "mass_matrix", "energy":
        fields[name] = number(fields[name])
    return Comparison(**fields)


def shadow(
    system: System | str | None = None,
    model: Model | None = None,
    *,
    time: str = "t",
    space: Sequence[str] = (),
    distance: float = 20.0,
    inclination: float = 80.0,
    azimuth: float = 0.0,
    observer: str = "rest",
    field_of_view: float = 70.0,
    width: int = 400,
    height: int | None = None,
    far: float | None = None,
    tolerance: float = 1e-6,
    edges: int = 64,
    threads: int | None = None,
    progress: Progress = None,
) -> Shadow:
    """The shadow of a black hole before a checkerboard sky: a ray of light is followed backwards through every pixel of a camera.

    Parameters
    ----------
    system, model : System or str, Model
        The exact metric, a learned one, or both: the picture then shows the two and their difference.
    time, space : str, sequence of str
        Time coordinate, and Cartesian coordinates around the centre, the last along the axis; or those of a wormhole: a radial one, the
        angle from the axis, the angle about it. By default x, y, z if there are such, otherwise the three beside the time.
    distance, inclination, azimuth : float
        Where the camera is: distance from the centre in the unit of the coordinates, angles from the axis and about it in degrees.
    observer : str
        ``"rest"``, or ``"normal"`` for a camera along the normal of the slices of equal time.
    field_of_view : float
        Angle between the left and the right end in degrees.
    width, height : int
        Pixels of a row, and rows; as many by default, 2^24 pixels at most.
    far : float, optional
        Distance beyond which an outgoing ray comes from the sky; 100 times `distance` by default, twice with a model.
    tolerance : float
        Relative error of a step of a ray, 1e-12 to 0.01.
    edges : int
        Directions in which the edge of the shadow is found; 0 omits it.
    """
    system = System(system) if isinstance(system, str) else system
    width = whole("width", width, 1, 2**24)
    choices = {
        "time": str(time),
        "space": names("space", space),
        "distance": real("distance", distance, positive=True),
        "inclination": real("inclination", inclination),
        "azimuth": real("azimuth", azimuth),
        "observer": str(observer),
        "field_of_view": real("field_of_view", field_of_view, positive=True),
        "width": width,
        "height": width if height is None else whole("height", height, 1, 2**24),
        "far": None if far is None else real("far", far, positive=True),
        "tolerance": real("tolerance", tolerance, positive=True),
        "edges": whole("edges", edges, 0, 4096),
        "threads": thread_count(threads),
    }
    exact, learned = (None if one is None else one._subject for one in (system, model))
    text, pixels, shape = _lnn.shadow(exact, learned, as_json(choices), receiver(progress))
    fields = read_result(text)
    return Shadow(
        image=np.frombuffer(pixels, np.uint8).reshape(*shape, 3),
        views={name: View(**fields[name]) for name in ("exact", "learned") if name in fields},
        difference=fields.get("difference"),
        free_factor=fields.get("free_factor", False),
        unit=fields["unit"],
        _text=fields["_text"],
        _html=fields["_html"],
    )
