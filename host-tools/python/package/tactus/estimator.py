"""A fused table as a classifier of scikit-learn."""

import numpy as np

from ._tactus import Table, TableError, _posteriors

try:
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as why:
    raise ImportError("TactusClassifier needs scikit-learn 1.6 or newer: pip install 'scikit-learn>=1.6'") from why

# largest feature, in its unit, of what a table holds 31.99
_MOST = 30.0
# a class is so many standard deviations from the mean at most: whitened features end at 128
_FARTHEST = 60.0
# 1/1024 of the unit is the step of a feature; rounding adds this to each, in standard deviations
_ROUNDING = 12**-0.5 / 1024


class TactusClassifier(ClassifierMixin, BaseEstimator):
    """The fused method of `tactus.Table` on features of one's own, as a classifier of scikit-learn.

    X has 1 to `tactus.MAX_FEATURES` features of each slide: band powers of `Recordings.features()`, or any others. More
    of them are reduced before, as by `make_pipeline(PCA(tactus.MAX_FEATURES), TactusClassifier())`. `fit` centres and
    scales them to what fixed point holds, and learns a table: the classes' means, whitened by the covariance of slides
    within a class, which is shrunk as far as there are few slides. So it is a regularised linear discriminant analysis
    with the arithmetic of the chip.

    `predict_proba` is the posterior after one slide with equal priors, whatever the share of each class in y. A scaled
    feature is kept in steps of 1/1024, so the last digits of a probability mean nothing.

    Parameters
    ----------
    drift : float, default=0.0
        Standard deviation of what a class may have changed since, in standard deviations within a class.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The classes, 128 at most.
    n_features_in_ : int
        Features of X.
    table_ : Table
        The table; its textures are the places of classes in `classes_`, as text.
    """

    def __init__(self, *, drift=0.0):
        self.drift = drift

    def fit(self, X, y):
        """Learn from features X of shape (slides, features) of the classes y; one of them has two slides at least."""
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=2)
        check_classification_targets(y)
        self.classes_, place = np.unique(y, return_inverse=True)
        self._centre = X.mean(0)
        about = X - self._centre
        means = np.stack([about[place == c].mean(0) for c in range(len(self.classes_))])
        freedom = max(len(X) - len(self.classes_), 1)
        within = np.sqrt(((about - means[place]) ** 2).sum(0) / freedom)
        most = np.abs(about).max(0)
        # a feature that hardly scatters would have a distance of its own: then rounding is its scatter
        unit = np.where(within * _FARTHEST < most, most / (_FARTHEST * _ROUNDING), np.maximum(within, most / _MOST))
        self._scale = np.divide(1, unit, out=np.zeros_like(unit), where=unit > 0)
        order = np.argsort(place, kind="stable")
        try:
            self.table_ = Table.learn(self._scaled(X)[order], place[order], drift=(self.drift, 0.0))
        except TableError as why:
            raise ValueError(f"{why} (n_samples = {len(X)} of {len(self.classes_)} classes)") from why
        return self

    def _scaled(self, X):
        return np.clip((X - self._centre) * self._scale, -_MOST, _MOST)

    def predict_proba(self, X):
        """The posterior probability of each class for each slide, of shape (slides, classes)."""
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        probabilities = _posteriors(self.table_, self._scaled(X)).astype(np.float64)
        return probabilities / probabilities.sum(1, keepdims=True)

    def predict(self, X):
        """The most probable class for each slide."""
        place = self.predict_proba(X).argmax(1)
        return self.classes_[place]
