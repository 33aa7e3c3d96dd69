"""A learned Lagrangian as an estimator of scikit-learn."""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from ._learning import learn


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
        self, angles=(), structure=None, hidden=None, epochs=None, dissipation=None, random_state=0, threads=None
    ):
        self.angles = angles
        self.structure = structure
        self.hidden = hidden
        self.epochs = epochs
        self.dissipation = dissipation
        self.random_state = random_state
        self.threads = threads

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        tags.target_tags.required = True
        # States and accelerations of no motion have no Lagrangian.
        tags.regressor_tags.poor_score = True
        return tags

    def fit(self, X, y):
        """Learns from states and accelerations."""
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True, multi_output=True)
        a = y[:, None] if y.ndim == 1 else y
        if X.shape[1] != 2 * a.shape[1]:
            found = f"n_samples = {X.shape[0]}, n_features = {X.shape[1]}, targets = {a.shape[1]}"
            raise ValueError(f"expected two features for each acceleration, coordinates before velocities, found {found}")
        names = [f"q{i + 1}" for i in range(a.shape[1])]
        learned = learn(
            *np.hsplit(X, 2),
            a,
            angles=[names[i] for i in self.angles],
            structure=self.structure,
            hidden=self.hidden,
            epochs=self.epochs,
            dissipation=self.dissipation,
            seed=self.random_state,
            threads=self.threads,
        )
        self.model_, self.history_, self._flat = learned.model, learned.history, y.ndim == 1
        return self

    def predict(self, X):
        """Accelerations of states."""
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        a = self.model_.acceleration(*np.hsplit(X, 2))
        return a[:, 0] if self._flat else a
