"""A learned Lagrangian as an estimator of scikit-learn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from ._learning import learn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from sklearn.utils import Tags


class LagrangianRegressor(RegressorMixin, BaseEstimator):
    """Accelerations from states by a Lagrangian that is learned.

    ``X`` holds states ``(samples, 2n)``, coordinates before velocities, and ``y`` their accelerations ``(samples, n)``, or ``(samples,)`` of one
    coordinate. The choices are those of `learn`.

    Parameters
    ----------
    angles : tuple of int
        Coordinates, by index, that are angles in rad.
    structure : str, optional
        ``"black-box"``, ``"mechanical"`` or ``"metric"``.
    hidden : tuple of int, optional
    epochs : int, optional
    dissipation : int, optional
    random_state : int
        Seed.
    threads : int, optional

    Attributes
    ----------
    model_ : Model
        The learned Lagrangian.
    history_ : dict of str to numpy.ndarray
    n_features_in_ : int
    """

    def __init__(
        self,
        angles: Sequence[int] = (),
        structure: str | None = None,
        hidden: Sequence[int] | None = None,
        epochs: int | None = None,
        dissipation: int | None = None,
        random_state: int = 0,
        threads: int | None = None,
    ) -> None:
        self.angles = angles
        self.structure = structure
        self.hidden = hidden
        self.epochs = epochs
        self.dissipation = dissipation
        self.random_state = random_state
        self.threads = threads

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        tags.target_tags.required = True
        # States and accelerations of no motion have no Lagrangian.
        tags.regressor_tags.poor_score = True
        return tags

    def fit(self, X: ArrayLike, y: ArrayLike) -> LagrangianRegressor:
        """Learns from states and accelerations."""
        rows, targets = validate_data(self, X, y, dtype=np.float64, y_numeric=True, multi_output=True, ensure_min_samples=3)
        a = targets[:, None] if targets.ndim == 1 else targets
        q, v = self._states(rows, a.shape[1])
        names = [f"q{i + 1}" for i in range(a.shape[1])]
        learned = learn(
            q,
            v,
            a,
            angles=[names[i] for i in self.angles],
            structure=self.structure,
            hidden=self.hidden,
            epochs=self.epochs,
            dissipation=self.dissipation,
            seed=self.random_state,
            threads=self.threads,
        )
        self.model_, self.history_, self._flat = learned.model, learned.history, targets.ndim == 1
        return self

    def predict(self, X: ArrayLike) -> np.ndarray:
        """Accelerations of states."""
        check_is_fitted(self)
        rows = validate_data(self, X, dtype=np.float64, reset=False)
        a = self.model_.acceleration(*self._states(rows, len(self.model_.coordinates)))
        return a[:, 0] if self._flat else a

    def _states(self, X: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities of ``X``."""
        if X.shape[1] != 2 * n:
            found = f"n_samples = {X.shape[0]}, n_features = {X.shape[1]}, targets = {n}"
            raise ValueError(f"expected two features for each acceleration, coordinates before velocities, found {found}")
        return X[:, :n], X[:, n:]
