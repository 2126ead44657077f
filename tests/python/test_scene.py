import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import granulcal as gc


def test_built_in_scenes_survive_toml():
    for scene in (gc.Scene.funnel(height=0.12), gc.Scene.drop(0.05)):
        assert gc.Scene.from_toml(scene.to_toml()) == scene
        assert pickle.loads(pickle.dumps(scene)) == scene
        assert hash(scene) == hash(gc.Scene.from_toml(scene.to_toml()))


@given(
    height=st.floats(0.01, 1.0),
    friction=st.floats(0.0, 10.0),
    restitution=st.floats(0.0, 1.0),
    count=st.integers(1, 2000),
)
def test_numbers_survive_by_path(height, friction, restitution, count):
    scene = gc.Scene.funnel(height=height, count=count).with_(
        {"material.sliding_friction": friction, "material.restitution": restitution}
    )
    assert scene.get("funnel.height") == height
    assert scene.get("scene.funnel.height") == height
    assert scene.get("grains.count") == count
    assert scene.material.sliding_friction == friction
    assert gc.Scene.from_toml(scene.to_toml()) == scene


def test_changes_leave_the_original_alone():
    scene = gc.Scene.funnel()
    assert scene.with_(preset="fast", name="other").preset == "fast"
    assert (scene.preset, scene.name) == ("default", "funnel")
    assert scene.with_(preset="fast") != scene


def test_load_reads_what_to_toml_wrote(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(gc.Scene.drop(0.03).to_toml())
    assert gc.Scene.load(path) == gc.Scene.load(str(path)) == gc.Scene.drop(0.03)


def test_errors_name_the_number(tmp_path):
    scene = gc.Scene.funnel()
    for change, message in (
        ({"material.sliding_friction": -1.0}, "material.sliding_friction must be in"),
        ({"material.friction": 0.5}, "material.friction"),
        ({"grains.count": 1.5}, "must be a whole number, got 1.5"),
        ({"preset": "slow"}, "preset must be one of"),
    ):
        with pytest.raises(ValueError, match=message):
            scene.with_(change)
    with pytest.raises(TypeError, match="funnel.height must be a number, got 'high'"):
        scene.with_({"funnel.height": "high"})
    with pytest.raises(TypeError, match="preset must be a word, got 3"):
        scene.with_(preset=3)
    with pytest.raises(ValueError, match="funnel.height"):
        gc.Scene.funnel(height=-0.1)
    with pytest.raises(FileNotFoundError, match="missing.toml"):
        gc.Scene.load(tmp_path / "missing.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text(scene.to_toml().replace("diameter", "diametre"))
    with pytest.raises(ValueError, match=r"(?s)bad\.toml.*diametre"):
        gc.Scene.load(bad)


def test_material_is_the_scenes():
    material = gc.Material(sliding_friction=0.3, rolling_friction=0.02, restitution=0.7)
    assert gc.Scene.drop(0.1, material=material).material == material
    assert gc.Scene.drop(0.1).with_material(material).material == material


@pytest.mark.parametrize(
    "count",
    [10**30, 1e308, 2**63, 10**400, -(10**400), float("inf")],
    ids=["1e30", "1e308", "2^63", "1e400", "-1e400", "inf"],
)
def test_a_count_that_no_scene_can_hold_is_refused(count):
    """They had become 2^63 grains, or an OverflowError."""
    with pytest.raises(
        ValueError, match=r"grains\.count.* must be (a (whole )?number|below 2\^53)"
    ):
        gc.Scene.drop(0.1, count=count)
    with pytest.raises(
        ValueError, match=r"grains\.count.* must be (a (whole )?number|below 2\^53)"
    ):
        gc.Scene.drop(0.1).with_({"grains.count": count})


def test_a_start_takes_the_seeds_that_a_pour_takes():
    scene = gc.Scene.drop(0.1, count=5)
    with pytest.raises(ValueError, match="seed must be at least 0, got -1"):
        scene.start(-1)
    with pytest.raises(ValueError, match="seed must be at most 18446744073709551615, got 1844674"):
        scene.start(2**64)
    with pytest.raises(TypeError, match=r"seed must be a whole number, got 1\.5"):
        scene.start(1.5)  # pyright: ignore[reportArgumentType]
    for seed in (0, np.int64(3), 2**64 - 1):
        assert scene.start(seed)[0].shape == (5, 3)  # pyright: ignore[reportArgumentType]
