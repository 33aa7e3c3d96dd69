"""The estimator of scikit-learn."""

import pickle
import warnings

import numpy as np
import pytest

import lnn

sklearn = pytest.importorskip("sklearn")


def test_accelerations_of_two_oscillators_are_learned():
    from sklearn.model_selection import cross_val_score

    X = np.random.default_rng(0).uniform(-1, 1, (600, 4))
    y = X[:, :2] * [-1, -2]
    regressor = lnn.LagrangianRegressor(structure="mechanical", hidden=(16,), epochs=400, threads=1)
    assert cross_val_score(regressor, X, y, cv=3).min() > 0.99
    fitted = regressor.fit(X, y)
    assert np.array_equal(pickle.loads(pickle.dumps(fitted)).predict(X), fitted.predict(X))
    assert fitted.model_.columns == ("q1", "q2", "q1_dot", "q2_dot")


def test_the_checks_that_do_not_pass_have_one_reason():
    """Most checks bring data of any number of features; a state has two for each acceleration."""
    from sklearn.utils.estimator_checks import check_estimator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = check_estimator(lnn.LagrangianRegressor(hidden=(4,), epochs=1, threads=1), on_fail=None)
    failed = [check for check in found if check["status"] == "failed"]
    for check in failed:
        error, message = check["exception"], ""
        while error is not None:
            message, error = message + str(error), error.__cause__ or error.__context__
        assert "two features for each acceleration" in message, (check["check_name"], message)
    assert sum(check["status"] == "passed" for check in found) >= 30 and len(failed) <= 22
