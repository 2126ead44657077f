"""The boundary: dtypes, shapes, strides, errors, Ctrl-C, released interpreter, stubs."""

import ast
import inspect
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native
from granulcal.bayessim.check.toys import LinearGaussian


def test_points_of_other_types_are_coerced_once(points):
    expected = gc.statistics(points).paper16
    wide = np.zeros((len(points), 6))
    wide[:, ::2] = points
    assert np.array_equal(gc.statistics(wide[:, ::2]).paper16, expected)
    assert np.array_equal(gc.statistics(np.asfortranarray(points)).paper16, expected)
    assert np.array_equal(gc.statistics(points.tolist()).paper16, expected)
    assert np.allclose(gc.statistics(points.astype(np.float32)).paper16, expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("array", "error", "message"),
    [
        (np.zeros((3, 3), dtype=np.float32), TypeError, "points must have dtype float64, got flo"),
        (np.zeros((3, 3), dtype=np.int64), TypeError, "points must have dtype float64, got int64"),
        (np.zeros((3, 2)), ValueError, r"points must have shape \(n, 3\), got \(3, 2\)"),
        (np.zeros(3), ValueError, r"points must have shape \(n, 3\), got \(3\)"),
        (np.zeros((3, 6))[:, ::2], ValueError, "points must be C-contiguous"),
        ([[0.0, 0.0, 0.0]], TypeError, "points must be a NumPy array, got list"),
    ],
)
def test_native_refuses_arrays_by_name(array, error, message):
    with pytest.raises(error, match=message):
        _native.paper16(array)


def test_python_refuses_what_is_no_number():
    with pytest.raises(TypeError, match="points must hold real numbers, got dtype"):
        gc.statistics([["a", "b", "c"]])
    with pytest.raises(TypeError, match="got dtype complex128"):
        gc.statistics(np.zeros((4, 3), dtype=complex))


def test_what_a_mask_hides_is_not_taken_for_data(points, tmp_path):
    camera = gc.Camera.overhead(height=0.3, field_width=0.3, pixels=20)
    radii = np.full(len(points), 0.002)
    hidden = np.ma.array(points, mask=False)
    hidden[7, 2] = np.ma.masked
    for value in (np.ma.array(points, mask=True), hidden, list(hidden)):
        with pytest.raises(
            ValueError, match="points must have no masked .*: fill them, .* or drop"
        ):
            gc.statistics(value)
        with pytest.raises(ValueError, match="points must have no masked entries"):
            gc.diagnostic_statistics(value, grain_diameter=0.004, spacing=0.001)
        with pytest.raises(ValueError, match="positions must have no masked entries"):
            camera.render(value, radii)
    image = np.ma.masked_equal(camera.render(points, radii), 0.0)
    image[0, 0] = np.ma.masked
    with pytest.raises(ValueError, match="image must have no masked entries"):
        camera.save(image, tmp_path / "a.png", tmp_path / "a.toml")  # pyright: ignore
    narrow = camera.render(points, radii)[:, :-1].copy()
    with pytest.raises(ValueError, match=r"the image of this camera must be \d+x\d+ pixels, got"):
        camera.save(narrow, tmp_path / "a.png", tmp_path / "a.toml")
    engine = gc.engines.CallableEngine(lambda scene, seed: (hidden, 0.002), name="masked")
    with pytest.raises(ValueError, match="positions must have no masked entries, got 1"):
        gc.simulate(gc.Scene.drop(0.1, count=400), engine=engine)
    # A mask that hides nothing is none.
    whole = gc.statistics(np.ma.array(points))
    assert np.array_equal(whole.paper16, gc.statistics(points).paper16)


def test_empty_and_nan_points_are_refused_with_numbers(points):
    with pytest.raises(ValueError, match="got 0"):
        gc.statistics(np.zeros((0, 3)))
    points[7, 2] = np.nan
    with pytest.raises(ValueError, match="finite"):
        gc.statistics(points)


def test_statistics_know_their_names(points):
    found = gc.statistics(points)
    assert found.names[0] == "max_z"
    assert len(set(found.names)) == 16
    assert found["max_z"] == points[:, 2].max()
    assert found.to_dict() == dict(zip(found.names, found, strict=True))
    assert np.asarray(found).shape == (16,)
    with pytest.raises(KeyError, match="no statistic 'height'"):
        found["height"]


def test_a_pour_repeats_and_seeds_differ(small_scene, small_pour):
    again = gc.simulate(small_scene, seed=3)
    assert np.array_equal(small_pour.positions, again.positions)
    assert not np.array_equal(small_pour.positions, gc.simulate(small_scene, seed=4).positions)


def test_a_pour_has_the_promised_shapes(small_pour):
    assert small_pour.positions.shape == small_pour.velocities.shape == (60, 3)
    assert small_pour.positions.dtype == np.float64
    assert small_pour.radii.shape == (60,)
    assert small_pour.status == "at_rest"
    assert small_pour.health["grains_lost"] == 0
    assert small_pour.positions[:, 2].min() > 0
    image = small_pour.depth_image()
    assert image.dtype == np.float32
    assert image.shape == (96, 96)
    assert small_pour.cpu_seconds > 0
    assert np.array_equal(
        small_pour.statistics().paper16, gc.statistics(small_pour.points()).paper16
    )


def test_a_pour_outside_the_image_has_no_statistics(small_scene):
    far = small_scene.with_({"camera.field_width": 1e-3, "camera.height": 1e-3})
    pour = gc.simulate(far.with_({"camera.height_threshold": 0.5}), seed=1)
    assert pour.points().shape == (0, 3)
    with pytest.raises(ValueError, match="too few grains in view"):
        pour.statistics()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"seed": -1}, ValueError, "seed must be at least 0, got -1"),
        ({"seed": 1.5}, TypeError, "seed must be a whole number, got 1.5"),
        (
            {"seed": 2**64},
            ValueError,
            "seed must be at most 18446744073709551615, got 184467440737",
        ),
        ({"seed": 10**5000}, ValueError, "seed must be at most .*, got a number of 16610 bits"),
        ({"threads": 0}, ValueError, "threads must be at least 1, got 0"),
        ({"threads": 2**70}, ValueError, "threads must be at most 9223372036854775807, got 1180"),
        ({"preset": "slow"}, ValueError, "preset must be one of fast, default, accurate, paper"),
    ],
)
def test_simulate_refuses_by_name(small_scene, options, error, message):
    with pytest.raises(error, match=message):
        gc.simulate(small_scene, **options)


def test_a_material_and_a_preset_replace_the_scenes(small_scene):
    material = gc.Material(sliding_friction=0.2, rolling_friction=0.0, restitution=0.1)
    pour = gc.simulate(small_scene, material, preset="default")
    assert pour.scene.material == material
    assert pour.scene.preset == "default"
    assert gc.simulate(small_scene).scene.preset == "fast"


def test_the_interpreter_is_released_while_a_pour_runs():
    ticks = 0
    done = threading.Event()

    def pour() -> None:
        gc.simulate(gc.Scene.drop(0.05, count=400), seed=1)
        done.set()

    thread = threading.Thread(target=pour)
    thread.start()
    while not done.is_set():
        ticks += 1
        time.sleep(1e-3)
    thread.join()
    assert ticks > 10


# Jobs in the background start with Ctrl-C ignored, and so would their children.
_INTERRUPTED = """
import signal
import sys
import granulcal as gc
signal.signal(signal.SIGINT, signal.default_int_handler)
print("started", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(7)
"""


def _interrupt(call: str, *, after: float) -> subprocess.CompletedProcess:
    process = subprocess.Popen(
        [sys.executable, "-c", _INTERRUPTED.format(call=call)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    time.sleep(after)
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    try:
        out, _ = process.communicate(timeout=30)
    finally:
        process.kill()
    assert time.monotonic() - sent < 10
    return subprocess.CompletedProcess(process.args, process.returncode, out)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a child process")
@pytest.mark.parametrize(
    "call",
    [
        "gc.simulate(gc.Scene.funnel(preset='accurate'))",
        "gc.simulate(gc.Scene.funnel(preset='accurate'), every=0.5)",
        "gc.Simulation(gc.Scene.funnel(preset='accurate')).advance(10.0)",
        # A minute and more: it had gone on to its end.
        "gc.Camera.overhead(height=0.3, field_width=0.3, pixels=4000)"
        ".render([[0, 0, 0.1]], [0.01], blur_px=300)",
    ],
)
def test_ctrl_c_stops_a_pour(call):
    ended = _interrupt(call, after=0.5)
    assert (ended.returncode, ended.stdout) == (7, "interrupted\n")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a child process")
def test_ctrl_c_stops_draws_of_a_posterior(monkeypatch):
    """They had gone on to the last, a minute for some ten millions."""
    monkeypatch.setenv("GRANULCAL_NO_LIMITS", "1")
    call = (
        "from granulcal.bayessim.check.toys import LinearGaussian; "
        "toy = LinearGaussian.random(bounded=True); "
        "toy.posterior(toy.simulate(1)[1][0]).sample(50_000_000)"
    )
    assert _interrupt(call, after=2.0).returncode == 7


def test_more_draws_than_there_is_memory_for_are_refused():
    """The process had been aborted, and a notebook's kernel with it."""
    toy = LinearGaussian.random(bounded=True)
    posterior = toy.posterior(toy.simulate(1)[1][0])
    with pytest.raises(ValueError, match=r"needs about .* GB of memory, and .* are free"):
        posterior.sample(10**12)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a child process")
def test_ctrl_c_leaves_a_data_set_that_can_be_continued(tmp_path, small_scene):
    out = tmp_path / "pours"
    call = (
        "gc.generate(gc.Scene.drop(0.02, count=60, preset='fast'), gc.Prior.default(), 100000, "
        f"seed=5, out={str(out)!r}, progress=False)"
    )
    assert _interrupt(call, after=1.5).returncode == 7
    stopped = gc.Dataset.load(out)
    assert len(stopped) > 0
    n = len(stopped) + 5
    data = gc.generate(small_scene, gc.Prior.default(), n, seed=5, out=out, progress=False)
    assert len(data) == n
    fresh = gc.generate(small_scene, gc.Prior.default(), 6, seed=5, progress=False)
    assert np.array_equal(data.x[:6], fresh.x)


def test_stubs_list_what_is_there():
    stub = Path(_native.__file__).with_name("_native.pyi")
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    declared: dict[str, set[str]] = {}
    names = set()
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            members = {m.name for m in node.body if isinstance(m, ast.FunctionDef)}
            declared[node.name] = {m for m in members if not m.startswith("__")}
            names.add(node.name)
        elif isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    public = {n for n in dir(_native) if not n.startswith("__")} | {"__version__"}
    assert names == public
    for name, members in declared.items():
        cls = getattr(_native, name)
        assert members == {m for m in vars(cls) if not m.startswith("__")}, name


def test_stubs_have_the_arguments_that_are_there():
    stub = Path(_native.__file__).with_name("_native.pyi")
    for node in ast.walk(ast.parse(stub.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ClassDef):
            continue
        for method in node.body:
            assert isinstance(method, ast.FunctionDef)
            marks = {d.id for d in method.decorator_list if isinstance(d, ast.Name)}
            if "property" in marks or method.name.startswith("__"):
                continue
            real = inspect.signature(getattr(getattr(_native, node.name), method.name))
            arguments = [a.arg for a in method.args.args + method.args.kwonlyargs]
            arguments += [method.args.kwarg.arg] if method.args.kwarg else []
            assert arguments == list(real.parameters), f"{node.name}.{method.name}"


def test_a_view_looks_from_where_it_stands() -> None:
    # So low and narrow that it sees no ground before the grains.
    scene = gc.Scene.from_toml(
        gc.Scene.drop(0.02, count=20).to_toml()
        + '\n[[views]]\nname = "side"\neye = [0, -0.5, 0.004]\ntarget = [0, 0, 0.004]\n'
        "field_width = 0.008\npixels = [50, 30]\n"
    )
    pour = gc.simulate(scene, seed=1)
    seen = pour.look_from("side")
    assert seen.shape == (30, 50) and seen.dtype == np.float32
    x, y, _ = pour.positions[np.abs(pour.positions[:, 0]) < 4e-3].T
    assert len(x) > 1 and abs(seen[seen > 0].min() - (0.5 + y.min() - 2e-3)) < 2e-3
    with pytest.raises(KeyError, match="no view 'top'"):
        pour.look_from("top")
