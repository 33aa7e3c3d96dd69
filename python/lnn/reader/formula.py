"""Formulas of system files, such as ``m*l^2*theta_dot^2/2 + m*g*l*cos(theta)``, over the functions of any backend."""

from __future__ import annotations

import math
import re

# A node of a parsed formula is ("number", x), ("name", text), or a function with its operands.
PLAIN = ["sqrt", "exp", "expm1", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
PLAIN += ["erfc", "logistic", "softplus", "abs", "recip"]
UNARY = {name: name for name in PLAIN} | {"ln": "log", "log": "log", "ln1p": "log1p"}
UNARY |= {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}
BINARY = {"atan2": "atan2", "max": "maximum", "min": "minimum"}

PIECE = re.compile(r"\s*(?:((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|([^\W\d]\w*)|([-+*/^(),]))")


class Parser:
    """Recursive descent by the grammar of the program's own reader."""

    def __init__(self, text: str):
        self.text, self.pieces, at = text, [], 0
        while text[at:].strip():
            match = PIECE.match(text, at)
            if not match:
                raise ValueError(f"formula {text!r}: nothing known at column {at + 1}")
            self.pieces.append(match.groups())
            at = match.end()
        self.at = 0

    def peek(self):
        return self.pieces[self.at] if self.at < len(self.pieces) else (None, None, None)

    def takes(self, sign: str) -> bool:
        found = self.peek()[2] == sign
        self.at += found
        return found

    def expect(self, sign: str) -> None:
        if not self.takes(sign):
            raise ValueError(f"formula {self.text!r}: expected {sign!r} at piece {self.at + 1}")

    def whole(self):
        node = self.sum()
        if self.at < len(self.pieces):
            raise ValueError(f"formula {self.text!r}: expected the end at piece {self.at + 1}")
        return node

    def sum(self):
        node = self.product()
        while True:
            if self.takes("+"):
                node = ("add", node, self.product())
            elif self.takes("-"):
                node = ("sub", node, self.product())
            else:
                return node

    def product(self):
        node = self.sign()
        while True:
            if self.takes("*"):
                node = ("mul", node, self.sign())
            elif self.takes("/"):
                node = ("div", node, self.sign())
            else:
                return node

    def sign(self):
        return ("neg", self.sign()) if self.takes("-") else self.power()

    def power(self):
        node = self.atom()
        return ("power", node, self.sign()) if self.takes("^") else node

    def atom(self):
        number, name, _ = self.peek()
        if number is not None:
            self.at += 1
            return ("number", float(number))
        if self.takes("("):
            node = self.sum()
            self.expect(")")
            return node
        if name is None:
            raise ValueError(f"formula {self.text!r}: expected a number, a name or '(' at piece {self.at + 1}")
        self.at += 1
        if name == "pi":
            return ("number", math.pi)
        if name not in UNARY and name not in BINARY:
            return ("name", name)
        self.expect("(")
        operands = [self.sum()]
        if name in BINARY:
            self.expect(",")
            operands.append(self.sum())
        self.expect(")")
        return ((UNARY | BINARY)[name], *operands)


def names(node) -> set[str]:
    """Names in a formula."""
    if node[0] in ("number", "name"):
        return {node[1]} - {node[1] if node[0] == "number" else None}
    return set().union(*map(names, node[1:]))


def evaluate(xp, node, scope: dict):
    """Value of a formula whose names mean what `scope` says."""
    kind, *operands = node
    if kind == "number":
        return xp.constant(operands[0])
    if kind == "name":
        if operands[0] not in scope:
            raise ValueError(f"unknown name {operands[0]!r} in a formula")
        return scope[operands[0]]
    if kind == "power":
        base, exponent = operands
        return power(xp, base, exponent, scope)
    a, *rest = (evaluate(xp, operand, scope) for operand in operands)
    if not rest:
        return -a if kind == "neg" else 1 / a if kind == "recip" else getattr(xp, kind)(a)
    (b,) = rest
    return {
        "add": lambda: a + b,
        "sub": lambda: a - b,
        "mul": lambda: a * b,
        "div": lambda: a / b,
    }.get(kind, lambda: getattr(xp, kind)(a, b))()


def power(xp, base, exponent, scope):
    """A power: by products for a whole exponent, which allows negative bases, a square root for one half."""
    a = evaluate(xp, base, scope)
    sign, number = (-1, exponent[1]) if exponent[0] == "neg" else (1, exponent)
    if number[0] != "number":
        return xp.power(a, evaluate(xp, exponent, scope))
    p = sign * number[1]
    if p == int(p):
        return a ** int(p)
    return xp.sqrt(a) if p == 0.5 else xp.power(a, xp.constant(p))


class Described:
    """The Lagrangian of a description: what a system file says."""

    def __init__(self, description: dict):
        self.coordinates = [coordinate["name"] for coordinate in description["coordinates"]]
        self.parameters = dict(sorted(description.get("parameters", {}).items()))
        waiting = {name: Parser(text).whole() for name, text in description.get("definitions", {}).items()}
        # Every definition after those that it needs.
        self.definitions: dict[str, tuple] = {}
        while waiting:
            ready = [name for name, node in waiting.items() if not names(node) & waiting.keys()]
            if not ready:
                raise ValueError(f"the definitions {sorted(waiting)} need each other")
            self.definitions |= {name: waiting.pop(name) for name in ready}
        metric = description.get("metric")
        self.metric = None if metric is None else {self.pair(key): Parser(text).whole() for key, text in metric.items()}
        self.lagrangian = None if metric is not None else Parser(description["lagrangian"]).whole()
        dissipation = description.get("dissipation")
        self.dissipation = None if dissipation is None else Parser(dissipation).whole()

    def pair(self, key: str) -> tuple[int, int]:
        i, j = (self.coordinates.index(name.strip()) for name in key.split(","))
        return i, j

    def constants(self, xp, learned=None, given: dict | None = None) -> dict:
        """Values of the parameters: those given, defaults, and those that one number each of `learned` changes."""
        values, next_learned = {}, 0
        for name, entry in self.parameters.items():
            entry = entry if isinstance(entry, dict) else {"default": entry}
            value = float((given or {})[name] if name in (given or {}) else entry["default"])
            values[name] = xp.constant(value)
            if learned is not None and entry.get("learn", False):
                theta, next_learned = learned[next_learned], next_learned + 1
                positive = entry.get("range", "any") != "any" and value > 0
                values[name] = value * xp.exp(theta) if positive else value + theta
        return values

    def evaluate(self, xp, constants: dict, q, v):
        """L of states ``(..., n)``."""
        scope = self.scope(xp, constants, q, v)
        if self.metric is None:
            return evaluate(xp, self.lagrangian, scope)
        total = 0
        for (i, j), node in self.metric.items():
            term = evaluate(xp, node, scope) * (v[..., i] * v[..., j])
            total = total + (0.5 * term if i == j else term)
        return total

    def dissipation_of(self, xp, constants: dict, q, v):
        """D of states ``(..., n)``; None for a description without."""
        return None if self.dissipation is None else evaluate(xp, self.dissipation, self.scope(xp, constants, q, v))

    def scope(self, xp, constants: dict, q, v) -> dict:
        """What the names in formulas mean at states ``(..., n)``."""
        scope = dict(constants)
        for i, name in enumerate(self.coordinates):
            scope |= {name: q[..., i], f"{name}_dot": v[..., i]}
        for name, node in self.definitions.items():
            scope[name] = evaluate(xp, node, scope)
        return scope
