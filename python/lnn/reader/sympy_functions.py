"""Formulas of system files as expressions of SymPy."""

from __future__ import annotations

import math

import sympy

from .formula import Parser, evaluate, names


class SympyFunctions:
    """Functions of the grammar by their names."""

    sqrt, exp, log, erfc = sympy.sqrt, sympy.exp, sympy.log, sympy.erfc
    sin, cos, tan, asin, acos, atan, atan2 = sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.atan2
    sinh, cosh, tanh, abs = sympy.sinh, sympy.cosh, sympy.tanh, sympy.Abs
    maximum, minimum, power = sympy.Max, sympy.Min, sympy.Pow

    @staticmethod
    def constant(x):
        return sympy.pi if x == math.pi else sympy.Integer(int(x)) if x == int(x) else sympy.Float(x)

    @staticmethod
    def expm1(x):
        return sympy.exp(x) - 1

    @staticmethod
    def log1p(x):
        return sympy.log(1 + x)

    @staticmethod
    def logistic(x):
        return 1 / (1 + sympy.exp(-x))

    @staticmethod
    def softplus(x):
        return sympy.log(1 + sympy.exp(x))


def expression(terms: list[tuple[float, str]]):
    """A sum of coefficients and terms."""
    total = sympy.Integer(0)
    for coefficient, text in terms:
        node = Parser(text).whole()
        scope = {name: sympy.Symbol(name, real=True) for name in names(node)}
        total += sympy.Float(coefficient) * evaluate(SympyFunctions, node, scope)
    return total
