"""Whether recordings can be of a scene at all, asked before anything is inferred from them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granulcal.measured.recording import Recording
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior

__all__ = ["violations"]


def violations(
    scene: "Scene", prior: "Prior", recordings: "Sequence[Recording]", names: Sequence[object]
) -> list[str]:
    """Returns why recordings cannot show the scene, whatever its material, a sentence each.

    Height, volume and extent of the formation and the flatness of its ground are compared with what
    the scene allows over the whole prior, with wide margins; the bounds are those of `infer`.

    Args:
        scene: what was poured, with the camera that looked.
        prior: of its parameters.
        recordings: what was measured.
        names: of the recordings, for the sentences.
    """
    found = []
    text = prior.to_toml()
    for name, recording in zip(names, recordings, strict=True):
        reasons = scene.native.violations(text, recording.native)
        found += [f"{name}: {reason}" for reason in reasons]
    return found
