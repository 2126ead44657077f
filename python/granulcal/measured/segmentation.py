"""How the points of a formation are found in a recording, as keywords."""

from typing import TypedDict

__all__ = ["SegmentationSettings"]


class SegmentationSettings(TypedDict, total=False):
    """Keywords of `Recording.formation` and `Recording.level`.

    What is left out, or None, is as the camera's file says, else the default.

    Attributes:
        height_threshold: height from which a pixel counts as grain [m]; the default is
            automatic, three robust standard deviations of the ground; a patch of
            grains must reach six of them somewhere.
        threshold_floor: least automatic threshold [m]; the default is 1 mm.
        scene_threshold: the same where neither these nor the camera's file state a threshold: the
            `camera.height_threshold` of the scene to compare with; see `Scene.reading`.
        border_px: frame at the edge of the full image that is ignored [px]; default 0.
        region: part of the full image that is looked at, (x, y, width, height) [px]: the floor of a
            tray, without its rim and the table around it; default all.
        downsample: keep one pixel of every block of this side; the default matches
            `ground_resolution`, or is 1 without.
        ground_resolution: width on the ground that a pixel should have [m], as in the
            simulated images to compare with; see `Scene.reading`. It comes before a `downsample` of
            the camera's file.
        field_width: side of the square of ground about the formation that is kept of an image that
            shows more [m], as in those images; default none.
        inlier_distance: distance within which a pixel can be ground [m]; the default is
            automatic, from 3 mm on.
        max_tilt_deg: tilt beyond which a plane is a wall and not the ground [deg]; default 45.
        flying_deg: incidence beyond which two steps in a row are a pixel between two surfaces
            and no surface [deg]; default 80, 90 keeps all.
        max_height: height above which a pixel is a fault and not data [m]; default none.
        min_component_px: least number of connected pixels of grain; default 1.
        plane_seed: seed of the search for the ground; default 0.
    """

    height_threshold: float | None
    threshold_floor: float | None
    scene_threshold: float | None
    border_px: int | None
    region: tuple[int, int, int, int] | None
    downsample: int | None
    ground_resolution: float | None
    field_width: float | None
    inlier_distance: float | None
    max_tilt_deg: float | None
    flying_deg: float | None
    max_height: float | None
    min_component_px: int | None
    plane_seed: int | None
