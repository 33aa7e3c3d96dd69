"""The estimator of scikit-learn."""

import json
import os
import pickle
import subprocess
import sys

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


# What each check brings, which is no state with one acceleration: that has two features, a coordinate and its velocity.
EXCUSED = {
    "check_array_api_input": "10 features, as arrays of another kind",
    "check_dict_unchanged": "3 features",
    "check_dont_overwrite_parameters": "3 features",
    "check_dtype_object": "10 features, as objects",
    "check_estimators_dtypes": "5 features, in several types",
    "check_estimators_nan_inf": "3 features",
    "check_estimators_pickle": "3 features",
    "check_f_contiguous_array_estimator": "3 features, in the order of Fortran",
    "check_fit2d_predict1d": "3 features",
    "check_fit_score_takes_y": "3 features",
    "check_methods_sample_order_invariance": "3 features",
    "check_methods_subset_invariance": "3 features",
    "check_n_features_in_after_fitting": "4 features, with one acceleration",
    "check_pipeline_consistency": "3 features",
    "check_positive_only_tag_during_fit": "4 features, with one acceleration",
    "check_regressor_data_not_an_array": "10 features",
    "check_regressors_int": "10 features, whole numbers",
    "check_regressors_no_decision_function": "4 features, with one acceleration",
    "check_regressors_train": "10 features, three times",
    "check_supervised_y_2d": "3 features",
}

# Arrays of other kinds are checked where SciPy is told so before it is imported.
PROGRAM = """
import json, sys, warnings
import lnn
from sklearn.utils.estimator_checks import check_estimator


class OfFirstColumns(lnn.LagrangianRegressor):
    def _states(self, X, n):
        return super()._states(X[:, : 2 * n], n)


def reason(error):
    text = ""
    while error is not None:
        text, error = text + str(error), error.__cause__ or error.__context__
    return text


warnings.simplefilter("ignore")
estimator = {"plain": lnn.LagrangianRegressor, "of the first columns": OfFirstColumns}[sys.argv[1]]
excused = json.loads(sys.argv[2])
found = check_estimator(estimator(hidden=(4,), epochs=1, threads=1), on_fail=None, expected_failed_checks=excused)
print(json.dumps([(check["check_name"], check["status"], reason(check["exception"])) for check in found]))
"""


def checked(estimator, excused):
    """Names, outcomes and messages of scikit-learn's checks of estimators."""
    command = [sys.executable, "-c", PROGRAM, estimator, json.dumps(excused)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "SCIPY_ARRAY_API": "1"})
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_check_passes_but_those_whose_data_are_no_states():
    found = checked("plain", EXCUSED)
    assert [one for one in found if one[1] not in ("passed", "xfail")] == []
    excused = {name: message for name, status, message in found if status == "xfail"}
    assert excused.keys() == EXCUSED.keys()
    for name, message in excused.items():
        assert "two features for each acceleration" in message, (name, message)


def test_with_their_first_columns_as_a_state_all_checks_pass():
    found = checked("of the first columns", {})
    assert [one for one in found if one[1] != "passed"] == [] and len(found) >= 50
