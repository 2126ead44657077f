"""What a posterior took for known is said with it."""

import granulcal as gc
from granulcal.assumed import assumed
from granulcal.bayessim.storage.model_document import read_model_document
from granulcal.parameter import Parameter
from granulcal.prior import Prior

PRIOR = Prior(
    [
        Parameter(path="material.sliding_friction", distribution="uniform", low=0, high=1),
        Parameter(path="material.restitution", distribution="fixed", value=0.4),
    ]
)


def test_numbers_that_nobody_inferred_are_said():
    funnel = assumed(gc.Scene.funnel(0.1).to_toml(), PRIOR)
    assert funnel == (
        "assumed: material.restitution 0.4 (fixed), material.rolling_friction 0.1, "
        "grains.count 2000, grains.diameter 0.004 m, grains.density 1300 kg/m3, "
        "funnel.height 0.1 m, funnel.stem_radius 0.016 m and the rest of the scene funnel"
    )
    drop = gc.Scene.drop(0.05, count=40)
    changed = assumed(drop.with_({"material.softness": 0.1}).to_toml(), Prior.default())
    assert "material.softness 0.1, grains.count 40" in changed and "start.height 0.05 m" in changed
    assert "friction" not in changed and "restitution" not in changed
    with_shape = drop.to_toml().replace(
        "[grains]", "[grains]\nshape = { kind = 'box', aspect = [1.0, 1.0, 2.0] }"
    )
    assert "grains.shape box" in assumed(with_shape, Prior.default())


def test_a_scene_that_is_not_known_or_damaged_is_no_reason_to_stop():
    assert assumed(None, PRIOR) == "assumed: material.restitution 0.4 (fixed)"
    assert assumed(None, Prior.default()) == ""
    for text in ("name = ", "material = 3\ngrains = 2\n[funnel]\nheight = 'high'"):
        assert assumed(text, PRIOR).startswith("assumed: material.restitution 0.4 (fixed) and the")


def test_a_shipped_model_says_what_it_assumes():
    _, document = read_model_document(f"{gc.__path__[0]}/models/funnel")
    told = assumed(document["scene_toml"], Prior.from_toml(document["prior_toml"]))
    assert told.startswith("assumed: grains.count 2000") and told.endswith("scene funnel")
