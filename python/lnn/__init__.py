"""Stabilized Lagrangian neural networks."""
