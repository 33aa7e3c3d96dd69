"""Forward derivatives over NumPy arrays: values with all first and second derivatives by a few variables."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from .lagrangian import TURN


class Jet:
    """A value ``shape`` with its gradient ``(variables, *shape)`` and its Hessian ``(variables, variables, *shape)``."""

    __array_ufunc__ = None

    def __init__(self, value, gradient, hessian):
        self.value, self.gradient, self.hessian = value, gradient, hessian

    @classmethod
    def variables(cls, x):
        """The last axis of an array as variables."""
        d = x.shape[-1]
        gradient = np.zeros((d, *x.shape))
        for i in range(d):
            gradient[i, ..., i] = 1
        return cls(x, gradient, np.zeros((d, d, *x.shape)))

    def linear(self, function):
        """A linear function of the trailing axes."""
        return Jet(function(self.value), function(self.gradient), function(self.hessian))

    def chain(self, f, df, ddf):
        """A function of one number with its derivatives at the value."""
        g = self.gradient
        return Jet(f, df * g, df * self.hessian + ddf * (g[:, None] * g[None]))

    def __getitem__(self, key):
        return self.linear(lambda x: x[key])

    def __matmul__(self, matrix):
        return self.linear(lambda x: x @ matrix)

    def __neg__(self):
        return self.linear(np.negative)

    def __add__(self, other):
        if not isinstance(other, Jet):
            value = self.value + other
            grow = lambda x, lead: np.broadcast_to(x, x.shape[:lead] + np.shape(value))
            return Jet(value, grow(self.gradient, 1), grow(self.hessian, 2))
        return Jet(self.value + other.value, self.gradient + other.gradient, self.hessian + other.hessian)

    def __mul__(self, other):
        if not isinstance(other, Jet):
            return self.linear(lambda x: x * other)
        a, b = self, other
        mixed = a.gradient[:, None] * b.gradient[None]
        mixed = mixed + np.swapaxes(mixed, 0, 1)
        return Jet(
            a.value * b.value,
            a.value * b.gradient + b.value * a.gradient,
            a.value * b.hessian + b.value * a.hessian + mixed,
        )

    __radd__, __rmul__ = __add__, __mul__

    def __sub__(self, other):
        return self + (-other)

    def __rsub__(self, other):
        return -self + other

    def __truediv__(self, other):
        return self * other**-1 if isinstance(other, Jet) else self.linear(lambda x: x / other)

    def __rtruediv__(self, other):
        return self**-1 * other

    def __pow__(self, p: int):
        x = self.value
        if p == 0:
            return self.chain(np.ones_like(x), np.zeros_like(x), np.zeros_like(x))
        second = p * (p - 1) * x ** float(p - 2) if p != 1 else np.zeros_like(x)
        return self.chain(x ** float(p), p * x ** float(p - 1), second)


_ERFC = np.vectorize(math.erfc, otypes=[float])


def _of(table):
    """A function of arrays and jets from value and two derivatives."""

    def function(x):
        if isinstance(x, Jet):
            return x.chain(*table(x.value))
        return table(np.asarray(x, float))[0]

    return function


def _logistic(x):
    return 0.5 * (1 + np.tanh(0.5 * x))


def _erfc(x):
    slope = -2 / math.sqrt(math.pi) * np.exp(-x * x)
    return _ERFC(x), slope, -2 * x * slope


def _tan(x):
    slope = 1 + np.tan(x) ** 2
    return np.tan(x), slope, 2 * np.tan(x) * slope


def _tanh(x):
    slope = 1 / np.cosh(np.clip(x, -350, 350)) ** 2
    return np.tanh(x), slope, -2 * np.tanh(x) * slope


def _sqrt(x):
    root = np.sqrt(x)
    return root, 0.5 / root, -0.25 / (root * x)


def _arc(function, sign):
    def table(x):
        slope = sign / np.sqrt(1 - x * x)
        return function(x), slope, slope * x / (1 - x * x)

    return table


def _logistic_table(x):
    y = _logistic(x)
    return y, y * (1 - y), y * (1 - y) * (1 - 2 * y)


def _softplus(x):
    y = _logistic(x)
    return np.logaddexp(x, 0), y, y * (1 - y)


def _log_cosh(x):
    slope, second, _ = _tanh(x)
    return np.logaddexp(x, -x) - math.log(2), slope, second


def _join(function):
    """Arrays and jets along the last axis."""

    def joined(parts):
        jets = [part for part in parts if isinstance(part, Jet)]
        if not jets:
            return function(parts, axis=-1)
        d = len(jets[0].gradient)
        zero = lambda part, lead: np.zeros(lead + np.shape(part))
        parts = [p if isinstance(p, Jet) else Jet(p, zero(p, (d,)), zero(p, (d, d))) for p in parts]
        return Jet(*(function([getattr(p, name) for p in parts], axis=-1) for name in ("value", "gradient", "hessian")))

    return joined


def _sum(x, axis):
    return x.linear(lambda x: x.sum(axis)) if isinstance(x, Jet) else np.sum(x, axis)


def _wrap(x):
    if isinstance(x, Jet):
        return Jet(np.mod(x.value, TURN), x.gradient, x.hessian)
    return np.mod(x, TURN)


def _choose(compare):
    def chosen(a, b):
        if not isinstance(a, Jet) and not isinstance(b, Jet):
            return np.where(compare(a, b), a, b)
        value = lambda x: x.value if isinstance(x, Jet) else x
        first = compare(value(a), value(b))
        return a * first + b * ~first

    return chosen


def _atan2(y, x):
    if not isinstance(y, Jet) and not isinstance(x, Jet):
        return np.arctan2(y, x)
    value = lambda x: x.value if isinstance(x, Jet) else np.asarray(x, float)
    angle = np.arctan2(value(y), value(x))
    # Away from the branch, the angle differs by a constant from that of a rotated pair.
    cosine, sine = np.cos(angle), np.sin(angle)
    along, across = x * cosine + y * sine, y * cosine - x * sine
    return NUMPY.atan(across / along) + angle


def _power(a, b):
    if not isinstance(a, Jet) and not isinstance(b, Jet):
        return np.power(a, b)
    if not isinstance(b, Jet):
        x = a.value
        return a.chain(x**b, b * x ** (b - 1), b * (b - 1) * x ** (b - 2))
    return NUMPY.exp(NUMPY.log(a) * b)


#: The functions of NumPy arrays and jets that a Lagrangian is made of.
NUMPY = SimpleNamespace(
    constant=lambda x: np.asarray(x, float),
    stack=_join(np.stack),
    concatenate=_join(np.concatenate),
    sum=_sum,
    wrap=_wrap,
    power=_power,
    atan2=_atan2,
    maximum=_choose(np.greater_equal),
    minimum=_choose(np.less_equal),
    sin=_of(lambda x: (np.sin(x), np.cos(x), -np.sin(x))),
    cos=_of(lambda x: (np.cos(x), -np.sin(x), -np.cos(x))),
    tan=_of(_tan),
    asin=_of(_arc(np.arcsin, 1)),
    acos=_of(_arc(np.arccos, -1)),
    atan=_of(lambda x: (np.arctan(x), 1 / (1 + x * x), -2 * x / (1 + x * x) ** 2)),
    sinh=_of(lambda x: (np.sinh(x), np.cosh(x), np.sinh(x))),
    cosh=_of(lambda x: (np.cosh(x), np.sinh(x), np.cosh(x))),
    tanh=_of(_tanh),
    exp=_of(lambda x: (np.exp(x),) * 3),
    expm1=_of(lambda x: (np.expm1(x), np.exp(x), np.exp(x))),
    log=_of(lambda x: (np.log(x), 1 / x, -1 / x**2)),
    log1p=_of(lambda x: (np.log1p(x), 1 / (1 + x), -1 / (1 + x) ** 2)),
    sqrt=_of(_sqrt),
    abs=_of(lambda x: (np.abs(x), np.sign(x), np.zeros_like(x))),
    erfc=_of(_erfc),
    logistic=_of(_logistic_table),
    softplus=_of(_softplus),
    log_cosh=_of(_log_cosh),
)
