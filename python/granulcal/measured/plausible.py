"""Whether recordings can be of a scene at all, asked before anything is inferred from them."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granulcal.measured.recording import Recording
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior

__all__ = ["doubts", "doubts_of_frames", "violations"]


def violations(
    scene: "Scene",
    prior: "Prior",
    recordings: "Sequence[Recording]",
    names: Sequence[object],
    reading: Mapping[str, Any] | None = None,
) -> list[str]:
    """Returns why recordings cannot show the scene, whatever its material, a sentence each.

    Height, volume and extent of the formation and the flatness of its ground are compared with what
    the scene allows over the whole prior, with wide margins; the bounds are those of `infer`.

    Args:
        scene: what was poured, with the camera that looked.
        prior: of its parameters.
        recordings: what was measured.
        names: of the recordings, for the sentences.
        reading: arguments of `Recording.formation`, if the formation is read with any.
    """
    return _told(scene.native.violations, prior, recordings, names, reading)


def doubts(
    scene: "Scene",
    prior: "Prior",
    recordings: "Sequence[Recording]",
    names: Sequence[object],
    reading: Mapping[str, Any] | None = None,
) -> list[str]:
    """Returns what makes recordings doubtful that may show the scene, a sentence each.

    A formation that the image's edge cuts off, that is longer than wide or takes less room than the
    scene's grains, a bent ground, an image without much data, a second heap; the bounds are those
    of `infer`, the arguments those of `violations`. Of several what `doubts_of_frames` says, too.
    """
    of_each = _told(scene.native.doubts, prior, recordings, names, reading)
    return [*of_each, *doubts_of_frames(scene, prior, recordings, names)]


def doubts_of_frames(
    scene: "Scene",
    prior: "Prior",
    recordings: "Sequence[Recording]",
    names: Sequence[object],
) -> list[str]:
    """Returns which neighbours in a list of recordings are frames of one pour, a sentence each.

    Each recording counts as a pour of its own. Where grains lie at the same places in two of them,
    pixel by pixel, they are none; a camera that was moved between its frames hides that.

    Args:
        scene: what was poured.
        prior: of its parameters.
        recordings: what was measured, given as pours of their own.
        names: of the recordings, for the sentences.
    """
    if len(recordings) < 2:
        return []
    told, images = [str(name) for name in names], [each.native for each in recordings]
    return scene.native.doubts_of_frames(prior.to_toml(), told, images)


def _told(
    judge: Callable[..., list[str]],
    prior: "Prior",
    recordings: "Sequence[Recording]",
    names: Sequence[object],
    reading: Mapping[str, Any] | None,
) -> list[str]:
    """What is said of each recording, under its name."""
    text, settings = prior.to_toml(), reading or {}
    return [
        f"{name}: {reason}"
        for name, recording in zip(names, recordings, strict=True)
        for reason in judge(text, recording.native, **settings)
    ]
