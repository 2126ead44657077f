"""Exceptions of the Python side: each says what was found and what is allowed."""

__all__ = [
    "DamagedPartWarning",
    "DoubtfulRecordingWarning",
    "ExtrapolationError",
    "ModelFormatError",
    "NotOfPriorWarning",
    "ObservationError",
    "OtherLawWarning",
    "PriorError",
    "TrainingDataError",
    "UnreachableRingError",
    "UnverifiedDataWarning",
    "UnverifiedModelWarning",
]


class PriorError(ValueError):
    """A prior that cannot be: unknown key or distribution, an empty range, a repeated path."""


class TrainingDataError(ValueError):
    """Pairs of parameters and statistics that no model can be trained on."""


class ObservationError(ValueError):
    """An observation whose shape or values do not fit the trained model."""


class ModelFormatError(ValueError):
    """A saved model that is present but cannot be read: truncated, wrong version, wrong shape."""


class UnverifiedModelWarning(UserWarning):
    """A saved model without hashes, as earlier versions wrote them: damage in it is not found."""


class UnverifiedDataWarning(UserWarning):
    """A data set without hashes of its rows, as earlier versions wrote them."""


class DamagedPartWarning(UserWarning):
    """A part in the store of a cluster that cannot be read; its rows are poured again."""


class DoubtfulRecordingWarning(UserWarning):
    """A recording that can hardly be one of the scene, or of which a part is hidden."""


class NotOfPriorWarning(UserWarning):
    """Parameters of training pairs that do not look drawn from the prior that is stated."""


class OtherLawWarning(UserWarning):
    """Pours, or a model of them, by another contact law of the solver than today's."""


class ExtrapolationError(ValueError):
    """A wanted ring whose height lies outside the heights that a model was trained on."""


class UnreachableRingError(ValueError):
    """A wanted ring whose two radii no height gives together."""
