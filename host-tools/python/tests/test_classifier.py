"""The classifier in scikit-learn: its own checks, pipelines, and linear discriminant analysis as the oracle."""

import pickle

import numpy as np
import pytest
from conftest import sklearn

import tactus

try:
    from sklearn.base import clone
    from sklearn.datasets import load_digits, load_iris, load_wine
    from sklearn.decomposition import PCA
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.model_selection import GroupKFold, cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.utils.estimator_checks import estimator_checks_generator

    from tactus import TactusClassifier

    # every check of an estimator that says of itself what it is; none is expected to fail
    CHECKS = list(estimator_checks_generator(TactusClassifier(), mark="skip"))
except ImportError:
    CHECKS = []


@pytest.fixture(autouse=True)
def there_is_scikit_learn():
    sklearn()


def name(check):
    return getattr(check, "func", check).__name__


@pytest.mark.parametrize("estimator, check", CHECKS, ids=[name(check) for _, check in CHECKS])
def test_scikit_learn_takes_it(estimator, check):
    check(estimator)


def test_there_are_checks():
    assert len(CHECKS) > 40


@pytest.mark.parametrize("load, features", [("iris", 4), ("wine", 12), ("digits", 12)])
def test_it_is_as_right_as_linear_discriminant_analysis(load, features):
    X, y = {"iris": load_iris, "wine": load_wine, "digits": load_digits}[load](return_X_y=True)
    reduce = PCA(features) if load == "digits" else "passthrough"
    X = X if load == "digits" else X[:, :features]
    ours, theirs = (
        cross_val_score(make_pipeline(reduce, one), X, y, cv=5).mean()
        for one in (TactusClassifier(), LinearDiscriminantAnalysis())
    )
    assert ours > theirs - 0.02


def test_it_takes_features_of_any_scale_and_shift():
    X, y = load_iris(return_X_y=True)
    plain = TactusClassifier().fit(X, y).predict_proba(X)
    for scale, shift in (1e-9, 0), (1e9, 0), (1, 1e6), (np.array([1e-6, 1, 1e3, 1e6]), -5):
        moved = X * scale + shift
        other = TactusClassifier().fit(moved, y).predict_proba(moved)
        assert (other.argmax(1) == plain.argmax(1)).mean() > 0.98
        np.testing.assert_allclose(other, plain, atol=0.1)


def test_features_without_scatter_tell_classes_apart_and_constant_ones_say_nothing():
    X = np.repeat([[0.0, 7.0], [1.0, 7.0], [10.0, 7.0]], 5, axis=0)
    y = np.repeat(["a", "b", "c"], 5)
    classifier = TactusClassifier().fit(X, y)
    assert (classifier.predict(X) == y).all()
    assert (classifier.predict(X + [0, 100]) == y).all()


def test_it_serves_what_recordings_say(small):
    told = small.features()
    X, y, groups = told["ln_fused_bands"], told["name"], told["trial"]
    # a trial of each movement a group; nothing of it is learned from
    assert cross_val_score(TactusClassifier(), X, y, groups=groups, cv=GroupKFold(3)).mean() > 0.5
    fitted = TactusClassifier().fit(X, y)
    assert fitted.classes_.tolist() == sorted(small.textures) and len(fitted.table_) == len(small.textures)
    again = pickle.loads(pickle.dumps(fitted))
    assert (again.predict_proba(X) == fitted.predict_proba(X)).all()
    assert not hasattr(clone(fitted), "table_")


def test_expected_drift_makes_it_less_sure():
    rng = np.random.default_rng(1)
    y = np.repeat([0, 1, 2], 30)
    X = rng.normal(0, 1, (90, 3)) + 2 * y[:, None]
    sure = [TactusClassifier(drift=drift).fit(X, y).predict_proba(X).max(1).mean() for drift in (0.0, 1.0, 3.0)]
    assert sure[0] > sure[1] > sure[2] > 0.34


def test_what_a_table_does_not_hold_is_refused():
    rng = np.random.default_rng(1)
    y = np.repeat(np.arange(3), 10)
    with pytest.raises(ValueError, match="PCA"):
        TactusClassifier().fit(rng.normal(size=(30, tactus.MAX_FEATURES + 1)), y)
    with pytest.raises(ValueError, match="128"):
        TactusClassifier().fit(rng.normal(size=(260, 2)), np.repeat(np.arange(130), 2))
    with pytest.raises(ValueError, match="two slides"):
        TactusClassifier().fit(rng.normal(size=(3, 2)), np.arange(3))
