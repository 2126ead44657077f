import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.export import ENGINES, export_bed, export_material, export_scene
from granulcal.export.law import (
    damping_ratio,
    nominal_restitution,
    pulling_duration,
    restitution_of,
)
from granulcal.export.mesh import triangles
from granulcal.export.mujoco import solref
from granulcal.export.setup import Setup

MATERIAL = gc.Material(sliding_friction=0.4, rolling_friction=0.12, restitution=0.6)
RADIUS = 0.002


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    return gc.Scene.funnel(0.06, count=20, material=MATERIAL, preset="fast")


def rebound(beta: float, *, tension: bool) -> float:
    """Returns e of x'' = -x - 2 beta x' from x = 0 at speed 1, by small steps."""
    x, v, dt = 0.0, 1.0, 1e-3
    while True:
        force = -x - 2 * beta * v
        over = x < 0 if tension else force > 0 and x > 0
        if over:
            return -v
        v += dt * force
        x += dt * v


@pytest.mark.parametrize("e", [0.05, 0.3, 0.6, 0.9])
def test_the_dashpot_gives_the_restitution(e: float) -> None:
    pulling = damping_ratio(e, tension=True)
    assert rebound(pulling, tension=True) == pytest.approx(e, rel=6e-3)
    assert nominal_restitution(pulling) == pytest.approx(e)
    free = damping_ratio(e, tension=False, overdamped=True)
    assert rebound(free, tension=False) == pytest.approx(e, rel=6e-3)
    assert (free > 1) == (e < math.exp(-2))


def test_the_restitution_is_continuous_at_critical_damping() -> None:
    assert restitution_of(1.0) == math.exp(-2)
    assert restitution_of(1 - 1e-6) == pytest.approx(restitution_of(1 + 1e-6), rel=1e-5)


def words(text: str, name: str, count: int) -> list[float]:
    """Returns the numbers that follow a word."""
    found = re.search(rf"{name}((?:\s*[-+.\deE]+){{{count}}})", text)
    assert found is not None, (name, text)
    return [float(word) for word in found.group(1).split()]


def test_lammps_has_the_rolling_ratio_and_the_torsional_length(scene: gc.Scene) -> None:
    text = ENGINES["lammps"].material(Setup.of(scene))
    pair, wall = text.splitlines()[3:5]
    assert words(pair, "rolling sds", 3)[2] == words(wall, "rolling sds", 3)[2] == 0.12
    assert words(pair, "twisting sds", 3)[2] == pytest.approx(0.02 * RADIUS / 2)
    assert words(wall, "twisting sds", 3)[2] == pytest.approx(0.02 * RADIUS)
    young, nominal, _ = words(pair, "hertz/material", 3)
    beta = -math.log(nominal) / math.hypot(math.pi, math.log(nominal))
    assert young == 3e6 and restitution_of(beta) == pytest.approx(0.6)
    assert "limit_damping" in pair
    inelastic = Setup.of(scene.with_({"material.restitution": 0.1}))
    assert "limit_damping" not in ENGINES["lammps"].material(inelastic)


def test_the_other_engines_have_their_own_rolling(scene: gc.Scene) -> None:
    setup = Setup.of(scene)
    text = ENGINES["liggghts"].material(setup)
    assert words(text, "coefficientRollingFriction peratomtypepair", 2)[1] == 0.12
    assert words(text, "coefficientRestitution peratomtypepair", 2)[1] == 0.6
    # The mean of the reference radii is R, ours is R / 2.
    assert "eta=0.06)" in ENGINES["yade"].material(setup)
    slide, twist, roll = words(ENGINES["mujoco"].material(setup), 'friction="', 3)
    assert (slide, twist, roll) == pytest.approx((0.4, 0.02 * RADIUS / 2, 0.12 * RADIUS / 2))
    chrono = ENGINES["chrono"].material(setup)
    assert f"SetRollingFriction({0.12 * RADIUS / 2:.9g})" in chrono
    newton = ENGINES["newton"].scene(setup)["pour.py"]
    # Of two shapes the mean: the ground's 1.5 mu_r R and a grain's 0.5 mu_r R give mu_r R.
    assert f"mu_rolling={1.5 * 0.12 * RADIUS:.9g}" in newton
    gazebo = ENGINES["gazebo"].material(setup)
    twist = float(re.findall("<coefficient>([^<]+)", gazebo)[0])
    assert 3 * math.pi / 16 * RADIUS * twist == pytest.approx(0.02 * RADIUS / 2)


@pytest.mark.parametrize("e", [0.14, 0.3, 0.62, 0.9])
def test_a_contact_that_pulls_lasts_longer_by_the_formula(e: float) -> None:
    # LIGGGHTS' Hertz contact with k = sqrt(d), and ours with k = 1, both until they part.
    h, duration = 2e-4, []
    pulling, ours = damping_ratio(e, tension=True), damping_ratio(e, tension=False)
    for hertz in (True, False):
        d, speed, lasted, force = 0.0, 1.0, 0.0, 0.0
        while lasted == 0.0 or (d > 0.0 if hertz else force > 0.0):
            root = math.sqrt(d) if hertz else 1.0
            dashpot = 2 * math.sqrt(1.25 * root) * pulling if hertz else 2 * ours
            force = root * d + dashpot * speed
            speed -= h * force
            d = max(d + h * speed, 0.0)
            lasted += h * math.sqrt(root)
        duration.append(lasted)
    assert duration[0] / duration[1] == pytest.approx(pulling_duration(e), rel=5e-3)


def test_liggghts_dashpot_is_ours_over_that(scene: gc.Scene) -> None:
    damped = scene.with_({"material.rolling_dashpot": 0.87, "material.restitution": 0.3})
    text = ENGINES["liggghts"].material(Setup.of(damped))
    assert words(text, "coefficientRollingViscousDamping peratomtypepair", 2)[1] == pytest.approx(
        0.7, abs=1e-3
    )


def test_mujocos_contact_is_the_spring_that_rebounds_so() -> None:
    k, b = solref(0.6)
    assert restitution_of(b / (2 * math.sqrt(k))) == pytest.approx(0.6)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_material_says_what_has_no_counterpart(
    engine: str, scene: gc.Scene, tmp_path: Path
) -> None:
    text = export_material(scene, engine, tmp_path).read_text()
    assert "material.rolling_friction = 0.12" in text and "R_eff = 0.001 m" in text
    for note in ENGINES[engine].NOTES:
        assert note in text
    if text.startswith("<!--"):
        ET.fromstring(text)


def _need(engine: str) -> None:
    if engine == "isaac":
        pytest.importorskip("pxr", reason="usd-core is not installed")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_scene_is_a_folder_that_says_how_to_run_it(
    engine: str, scene: gc.Scene, tmp_path: Path
) -> None:
    _need(engine)
    files = {path.name: path.read_text() for path in export_scene(scene, engine, tmp_path, seed=2)}
    assert files["README.txt"].startswith(("Run: ", "Open pour.usda"))
    for name, text in files.items():
        if name.endswith((".xml", ".sdf")):
            ET.fromstring(text)
        elif name.endswith(".py"):
            compile(text, name, "exec")
        elif name.endswith(".json"):
            json.loads(text)
    # Every grain stands where our pour begins.
    x = scene.start(2)[0][7, 0]
    assert any(f"{x:.7g}"[:8] in text for text in files.values())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("engine", ENGINES)
def test_a_scene_replaces_nothing_but_files_of_its_kind(
    engine: str, scene: gc.Scene, tmp_path: Path
) -> None:
    _need(engine)
    names = [path.name for path in export_scene(scene, engine, tmp_path / "first")]
    for name in names:
        place = tmp_path / name
        place.mkdir()
        # A link is followed to what it names, and what it names is a device.
        (place / name).symlink_to("/dev/full")
        with pytest.raises((ValueError, OSError), match=name):
            export_scene(scene, engine, place)
        assert (place / name).is_symlink() and not list(place.glob(".*"))


def test_lammps_data_has_every_grain(scene: gc.Scene, tmp_path: Path) -> None:
    export_scene(scene, "lammps", tmp_path, seed=3)
    rows = (tmp_path / "pour.data").read_text().splitlines()[11:]
    table = np.array([row.split() for row in rows], float)
    centres, radii = scene.start(3)
    assert np.allclose(table[:, 4:], centres, atol=1e-9) and np.allclose(table[:, 2], 2 * radii)
    assert set(table[:, 3]) == {1300.0}


def test_walls_are_triangles_of_the_right_size(scene: gc.Scene) -> None:
    cone = next(body for body in Setup.of(scene).walls if body.name == "cone")
    mesh = triangles(cone.shape)
    corners = mesh.vertices[mesh.faces]
    edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(edges, axis=1).sum()
    # The frustum of the paper's funnel, 64 sides of it.
    slant = math.hypot(0.07, 0.06 - 0.016)
    assert area == pytest.approx(math.pi * (0.06 + 0.016) * slant, rel=6e-3)
    box = {"kind": "box", "min": [0, 0, 0], "max": [1, 2, 3], "open": ["z_max"]}
    assert len(triangles(box).faces) == 10


def test_beds_are_read_by_others(scene: gc.Scene, tmp_path: Path) -> None:
    centres, radii = scene.start(0)
    for kind, mark in {
        "vtk": "POINTS 20 double",
        "ply": "element vertex 20",
        "csv": "x,y,z",
    }.items():
        text = export_bed(scene, centres, radii, kind, tmp_path / f"bed.{kind}").read_text()
        assert mark in text and text.count("\n") > 20
    urdf = ET.parse(export_bed(scene, centres, None, "urdf", tmp_path / "bed.urdf"))
    masses = [float(each.attrib["value"]) for each in urdf.iter("mass")]
    assert masses == pytest.approx([1300 * 4 / 3 * math.pi * RADIUS**3] * 20, rel=1e-5)
    with pytest.raises(ValueError, match="shape"):
        export_bed(scene, centres[:, :2], None, "csv", tmp_path / "bed.csv")


def test_what_cannot_be_exported_is_named(tmp_path: Path) -> None:
    drum = gc.Scene.load(Path(__file__).parents[2] / "examples/drum.toml")
    with pytest.raises(ValueError, match=r"walls\.\d: motion 'spin' is not exported"):
        export_scene(drum, "lammps", tmp_path)
    # Its material is as any other: what is learnt in a drum is carried over.
    for name in ("drum", "drum_periodic", "hopper", "crater", "scoop"):
        scene = gc.Scene.load(Path(__file__).parents[2] / f"examples/{name}.toml")
        text = export_material(scene, "mujoco", tmp_path / f"{name}.xml").read_text()
        assert f"material.sliding_friction = {scene.get('material.sliding_friction'):g}" in text
    shape = (
        gc.Scene.drop(0.02, count=20)
        .to_toml()
        .replace("[grains]", '[grains]\nshape = { kind = "box", aspect = [1.0, 1.0, 2.0] }')
    )
    with pytest.raises(ValueError, match=r"`grains.shape` has no counterpart"):
        export_material(gc.Scene.from_toml(shape), "lammps", tmp_path)
    with pytest.raises(ValueError, match="engines are lammps"):
        export_material(gc.Scene.built_in("drop"), "sandbox", tmp_path)


def test_a_posterior_is_a_mode_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ["material.sliding_friction", "material.restitution"]
    document = {
        "parameters": {name: {"mode": mode} for name, mode in zip(names, (0.3, 0.5), strict=True)},
        "samples": [[0.2, 0.4], [0.25, 0.45], [0.3, 0.5]],
    }
    posterior = tmp_path / "posterior.json"
    posterior.write_text(json.dumps(document))
    out = tmp_path / "materials"
    command = ["export", "posterior", str(posterior), "drop", "--to", "mujoco", "-o", str(out)]
    assert main([*command, "--draws", "2"]) == 0
    capsys.readouterr()
    assert words((out / "mode.xml").read_text(), 'friction="', 1) == [0.3]
    assert words((out / "draw-001.xml").read_text(), 'friction="', 1) == [0.25]
    table = json.loads((out / "draws.json").read_text())
    assert table[1] == {"file": "draw-001.xml", names[0]: 0.25, names[1]: 0.45}
    assert main([*command, "--draws", "4"]) == 2
    assert "at most 3" in capsys.readouterr().err


ROUND = {"kind": "cylinder", "from": [0, 0, 0.0], "to": [0, 0, 0.04], "radius": 0.08}
BOX = {"kind": "box", "min": [-0.1, -0.1, 0.0], "max": [0.1, 0.1, 0.03]}


def with_wall(scene: gc.Scene, **shape: object) -> gc.Scene:
    """Returns the scene with one wall more."""
    words = ", ".join(f"{key} = {json.dumps(value)}" for key, value in shape.items())
    return gc.Scene.from_toml(f"{scene.to_toml()}\n[[walls]]\nshape = {{ {words} }}\n")


def shaped(scene: gc.Scene) -> gc.Scene:
    """Returns the scene with grains that are boxes."""
    box = '[grains]\nshape = { kind = "box", aspect = [1.0, 1.0, 1.0] }\n'
    return gc.Scene.from_toml(scene.to_toml().replace("[grains]\n", box))


def test_grains_that_are_not_round_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They had become balls without a word."""
    from granulcal.engines import ExportedEngine
    from granulcal.pours.film import _outlines

    scene = shaped(gc.Scene.drop(0.02, count=4, preset="fast"))
    with pytest.raises(ValueError, match="`grains.shape` has no counterpart"):
        export_material(scene, "mujoco", tmp_path)
    with pytest.raises(ValueError, match="`grains.shape` has no counterpart"):
        ExportedEngine("mujoco", python="python")(scene, 0)
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml())
    words = ["export", "bed", str(path), "--to", "csv", "-o", str(tmp_path / "bed.csv")]
    assert main(words) == 2
    assert "`grains.shape`" in capsys.readouterr().err
    # A film draws their walls all the same.
    assert _outlines(shaped(gc.Scene.funnel(0.06, count=4)))


@pytest.mark.parametrize(
    ("shape", "sides"),
    [
        (BOX, 2),
        ({**BOX, "open": ["z_max"]}, 1),
        ({**ROUND, "closed": "both"}, 2),
        ({**ROUND, "closed": "to"}, 1),
        (ROUND, 1),
    ],
)
def test_a_closed_wall_of_lammps_is_felt_from_both_sides(
    scene: gc.Scene, shape: dict[str, object], sides: int
) -> None:
    text = ENGINES["lammps"].scene(Setup.of(with_wall(scene, **shape)))["in.pour"]
    regions = [line for line in text.splitlines() if line.startswith("region        wall_0")]
    assert len(regions) == sides == text.count("all wall/gran/region") - 2
    assert [line.endswith(" side out") for line in regions] == [False, True][:sides]


def test_grains_stay_on_a_closed_box_in_lammps(scene: gc.Scene) -> None:
    from granulcal.engines import ExportedEngine, installed

    if not installed("lammps"):
        pytest.skip("lammps is not installed")
    wide = {**BOX, "min": [-0.5, -0.5, 0.0], "max": [0.5, 0.5, 0.03]}
    pour = gc.simulate(with_wall(scene, **wide), seed=1, engine=ExportedEngine("lammps"))
    assert pour.positions[:, 2].min() > 0.03 + 0.9 * RADIUS


def test_the_space_of_a_pour_is_as_wide_as_its_grains_roll(scene: gc.Scene) -> None:
    usual = Setup.of(scene).half_width
    assert Setup.of(scene.with_({"material.rolling_friction": 10.0})).half_width == 0.8
    # Rolling from h stops after h / (5/7 mu_r).
    top = Setup.of(scene).centres[:, 2].max()
    start = np.abs(scene.start(0)[0][:, :2]).max()
    assert usual == pytest.approx(start + top / (5 / 7 * 0.12) + 2 * RADIUS)
    smooth = Setup.of(scene.with_({"material.rolling_friction": 0.0}))
    assert smooth.half_width == pytest.approx(start + 4.0 + 2 * RADIUS)
    brief = Setup.of(scene.with_({"material.rolling_friction": 0.0, "end.horizon": 1.0}))
    assert brief.half_width < smooth.half_width
    far = with_wall(scene, kind="disc", centre=[5.0, 0.0, 0.0], normal=[0, 0, 1], radius=0.5)
    assert Setup.of(far).half_width == pytest.approx(5.5 + 2 * RADIUS, rel=1e-3)
    # No engine has bins of neighbours without end.
    assert "binsize" in ENGINES["liggghts"].scene(smooth)["in.pour"]


def test_radii_that_differ_are_written_and_not_called_left_out(
    scene: gc.Scene, tmp_path: Path
) -> None:
    mixed = scene.with_({"effects.polydispersity.cv": 0.2})
    assert Setup.of(mixed).left_out == ()
    centres, radii = mixed.start(3)
    rows = export_bed(mixed, centres, None, "csv", tmp_path / "bed.csv", seed=3).read_text()
    found = np.loadtxt(rows.splitlines(), delimiter=",", skiprows=1)[:, 3]
    assert np.allclose(found, radii, rtol=1e-8) and np.ptp(found) > 0
    with pytest.raises(ValueError, match=r"radii of their own.*must be 20"):
        export_bed(mixed, centres[:7], None, "csv", tmp_path / "bed.csv")
    # Grains of one size may be any of them.
    assert export_bed(scene, centres[:7], None, "csv", tmp_path / "few.csv").exists()


def test_older_draws_are_removed_and_what_others_wrote_is_not(
    scene: gc.Scene, tmp_path: Path
) -> None:
    from granulcal.export import export_posterior

    def write(to: str, count: int) -> None:
        draws = np.linspace(0.2, 0.4, count)[:, None]
        export_posterior(["material.sliding_friction"], [0.3], draws, scene, to, tmp_path)

    write("mujoco", 5)
    (tmp_path / "draw-mine.xml").write_text("mine")
    write("lammps", 2)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "mode.in",
        "draw-mine.xml",
        "draw-000.in",
        "draw-001.in",
        "draws.json",
    }
    write("lammps", 0)
    assert not list(tmp_path.glob("draw-0*")) and not (tmp_path / "draws.json").exists()


def test_mujocos_walls_lie_behind_themselves(scene: gc.Scene) -> None:
    walls = with_wall(with_wall(scene, **BOX), kind="plane", point=[0, 0, 0.1], normal=[0, 0, 1])
    text = ENGINES["mujoco"].mjcf(Setup.of(walls))
    boxes = [geom for geom in ET.fromstring(text).iter("geom") if geom.get("type") == "box"][-7:]
    places = np.array([str(box.get("pos")).split() for box in boxes], float)
    # Half as thick as 4 mm: the inner faces are at 0.1, 0, 0.03, and the plane's at 0.1.
    assert np.sort(places[:6, 0])[[0, -1]] == pytest.approx([-0.102, 0.102])
    assert np.sort(places[:6, 2])[[0, -1]] == pytest.approx([-0.002, 0.032])
    assert places[6, 2] == pytest.approx(0.098)


@pytest.mark.parametrize(
    ("number", "at", "counts"),
    [
        ("restitution", 0.8, "1"),
        ("restitution", 0.1, None),
        ("sliding_friction", 0.1, "1"),
        ("sliding_friction", 0.9, None),
        ("rolling_friction", 0.01, "1"),
        # A wall's lever is twice as long, and the larger of two counts.
        ("rolling_friction", 0.07, None),
    ],
)
def test_mujocos_ground_has_the_numbers_that_the_grains_would_hide(
    scene: gc.Scene, number: str, at: float, counts: str | None
) -> None:
    """A ground of restitution 0.8 under grains of 0.2 gave back 0.16 of the speed, now 0.79."""
    there = scene.with_({f"ground.material.{number}": at})
    root = ET.fromstring(ENGINES["mujoco"].mjcf(Setup.of(there)))
    ground = next(geom for geom in root.iter("geom") if geom.get("name") == "ground")
    assert ground.get("priority") == counts
    same = ET.fromstring(ENGINES["mujoco"].mjcf(Setup.of(scene)))
    assert all(geom.get("priority") is None for geom in same.iter("geom"))


def test_mujocos_material_states_its_time_step(scene: gc.Scene, tmp_path: Path) -> None:
    root = ET.parse(export_material(scene, "mujoco", tmp_path)).getroot()
    option, geom = root.find("option"), root.find(".//geom")
    assert root.tag == "mujocoinclude" and option is not None and geom is not None
    k = -float(str(geom.get("solref")).split()[0])
    assert k == pytest.approx((math.pi / (20 * float(option.attrib["timestep"]))) ** 2, rel=1e-5)


def test_mujocos_material_has_the_cones_and_the_ground_of_its_scene(
    scene: gc.Scene, tmp_path: Path
) -> None:
    """Without, a grain slid aslant with 0.67 of its friction, on a plane with 2.3 times."""
    there = gc.Scene.from_toml(f"{scene.to_toml()}\n[ground.material]\nsliding_friction = 0.1\n")
    root = ET.parse(export_material(there, "mujoco", tmp_path)).getroot()
    whole = ET.fromstring(ENGINES["mujoco"].mjcf(Setup.of(there)))
    own, option = whole.find("option"), root.find("option")
    assert own is not None and option is not None
    for name in ("timestep", "cone", "impratio"):
        assert option.get(name) == own.get(name) is not None
    laid = root.find(".//default[@class='grain_ground']/geom")
    ground = next(geom for geom in whole.iter("geom") if geom.get("name") == "ground")
    assert laid is not None and laid.get("priority") == "1"
    assert laid.attrib.items() <= ground.attrib.items()
    assert "grain_ground" in (tmp_path / "material-mujoco.xml").read_text().split("-->")[0]


def test_gazebos_material_has_the_ground_on_which_nothing_would_bounce(scene: gc.Scene) -> None:
    there = Setup.of(
        gc.Scene.from_toml(f"{scene.to_toml()}\n[ground.material]\nsliding_friction = 0.3\n")
    )
    grain, ground = ENGINES["gazebo"].material(there).split("<!-- of the ground:")
    sdf = ENGINES["gazebo"].scene(there)["pour.sdf"]
    for text, mu in ((grain, "0.4"), (ground.split("-->")[0], "0.3")):
        assert text.strip() in sdf and f"<mu>{mu}</mu>" in text
        assert "<restitution_coefficient>0<" not in text


@pytest.mark.parametrize("engine", ["newton", "chrono"])
def test_a_material_has_the_ground_without_which_the_grains_is_another(
    scene: gc.Scene, engine: str
) -> None:
    """Both combine two shapes, and what nothing is said of has numbers of its own."""
    there = Setup.of(
        gc.Scene.from_toml(f"{scene.to_toml()}\n[ground.material]\nsliding_friction = 0.3\n")
    )
    material = ENGINES[engine].material(there)
    assert material in ENGINES[engine].scene(there)["pour.py"]
    ground = material[material.index("ground = ") :]
    told = {"newton": ("mu=0.2,", "mu_rolling="), "chrono": ("SetFriction(0.3)", "SetRolling")}
    assert all(word in ground for word in told[engine])


def test_newton_is_said_to_need_restitution_switched_on(scene: gc.Scene, tmp_path: Path) -> None:
    head = export_material(scene, "newton", tmp_path).read_text().split("grain = ")[0]
    assert "enable_restitution=True" in head


def test_newton_says_where_a_mean_cannot_be_met(scene: gc.Scene, tmp_path: Path) -> None:
    smooth = gc.Scene.from_toml(f"{scene.to_toml()}\n[ground.material]\nsliding_friction = 0.1\n")
    told = "ground: sliding_friction is half of the grains' own"
    for each, is_told in ((scene, False), (smooth, True)):
        files = export_scene(each, "newton", tmp_path / each.name)
        texts = {path.name: path.read_text() for path in files}
        assert (told in texts["pour.py"], told in texts["README.txt"]) == (is_told, is_told)
