"""Command line `granulcal`: what needs Python here, every other word by granulcal-cli."""

import argparse
import contextlib
import importlib.util
import io
import json
import os
import shlex
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from granulcal import _native, demo_command, design_command, loop_command, paths, predict_command
from granulcal.commands import engine_command, export, film, init, model, record
from granulcal.commands.program import Parser, describe
from granulcal.files import write_beside
from granulcal.one_thread import one_thread
from granulcal.paths import READS, RECORDING, writes

__all__ = ["main"]

_DONE, _FAILED, _BAD_INPUT, _INTERRUPTED = 0, 1, 2, 130
_UNHEALTHY = 3
_SAMPLES = 1000
_TRACEBACK = "GRANULCAL_TRACEBACK"
_TRAINING = "training.parquet"

_EPILOG = """\
From a recording to a material:
  granulcal init couscous                                     scene, prior, camera and task, commented
  granulcal sample couscous                                   no camera at hand? recordings of a known truth
  granulcal generate scene.toml prior.toml -n 1000 -o pours   simulate a training set
  granulcal train pours -o model                              train BayesSim on it
  granulcal check model                                       may its intervals be trusted?
  granulcal infer model couscous.bag                          posterior of the material
  granulcal calibrate scene.toml prior.toml couscous.bag --budget 100 -o run
                                                              one recording, few pours, no model
  granulcal export posterior posterior.json scene.toml --to lammps -o pour
  granulcal close-loop loop.toml -o loop                      what does the model lack?
  granulcal predict loop --at funnel.height=0.07 --corrected  and where it was not measured?

Exit codes: 0 done, 1 failed, 2 bad arguments or input, 3 done but some pours unhealthy, some frames of a
recording lost, a recording outside the model, or a model that fails its check, 130 stopped."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command line without the program's name; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = _parser()
    word = words[0] if words else ""
    if word in ("simulate", "generate") and engine_command.is_asked(words):
        return _guarded(lambda: engine_command.run(words))
    if word not in _commands(parser):
        return _native.run_cli(["granulcal", *words], describe(parser, after_help=_EPILOG))
    try:
        options = parser.parse_args(words)
    except SystemExit as end:
        # argparse ends the process; here the exit code is returned like every other.
        return end.code if isinstance(end.code, int) else _BAD_INPUT
    options.words = words

    def command() -> int:
        paths.check(parser, options)
        return _run_told(options)

    return _guarded(command)


def _run_told(options: argparse.Namespace) -> int:
    """Runs a command; with --json what it says goes to stderr, and `options.told` to stdout at its end.

    Commands that print a document of their own leave `told` empty.
    """
    options.told = {}
    if not getattr(options, "json", False) or options.run not in (_train, _check, _report):
        return options.run(options)
    with contextlib.redirect_stdout(sys.stderr):
        code = options.run(options)
    print(json.dumps(options.told, indent=1))
    return code


def _guarded(command: Callable[[], int]) -> int:
    """Runs a command; tells what was wrong in one line instead of a traceback."""
    try:
        with _interruptible(), one_thread():
            return command()
    except KeyboardInterrupt:
        print("granulcal: stopped", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:
        return _DONE
    except ModuleNotFoundError as error:
        print(f"granulcal: {error}; pip install 'granulcal[all]'", file=sys.stderr)
        return _FAILED
    except (ValueError, TypeError, FileNotFoundError, NotADirectoryError) as error:
        print(f"granulcal: {error}", file=sys.stderr)
        return _BAD_INPUT
    except OSError as error:
        print(f"granulcal: {error}", file=sys.stderr)
        return _FAILED
    except MemoryError:
        print("granulcal: the memory is full", file=sys.stderr)
        return _FAILED
    except Exception as error:
        if os.environ.get(_TRACEBACK) == "1":
            raise
        text = f"{type(error).__name__}: {error}"
        print(
            f"granulcal: an error of its own, {text}; with {_TRACEBACK}=1 it says where",
            file=sys.stderr,
        )
        return _FAILED


def console() -> int:
    """Runs the command line of the process; threads that still pour do not hold up its end."""
    code = main()
    if code == _INTERRUPTED:
        sys.stdout.flush()
        os._exit(code)
    return code


def _subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Lets Ctrl-C end the process within a second whatever runs, and at once if asked twice."""
    if threading.current_thread() is not threading.main_thread() or not Path("/dev/fd").exists():
        yield
        return
    read, write = os.pipe()
    os.set_blocking(write, False)
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    _native.listen_for_signals(f"/dev/fd/{read}")
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(write)
        os.close(read)


def _commands(parser: argparse.ArgumentParser) -> set[str]:
    return {name for action in parser._actions for name in (action.choices or ())}


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="granulcal")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")
    init.add(commands)
    model.add(commands)
    _add_train(commands)
    _add_check(commands)
    _add_infer(commands)
    _add_calibrate(commands)
    _add_report(commands)
    loop_command.add(commands)
    predict_command.add(commands)
    design_command.add(commands)
    export.add(commands)
    film.add(commands)
    record.add(commands)
    _add_reproduce(commands)
    demo_command.add(commands)
    return parser


def _add_train(commands: Any) -> None:
    text = "train BayesSim on a data set and check its calibration on pours kept aside"
    parser = commands.add_parser("train", help=text, description=text)
    parser.add_argument("data", type=READS, help="folder of `generate`, or one Parquet file")
    parser.add_argument(
        "-o", "--out", type=writes("model"), required=True, help="folder of the model"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the training (default: 0)")
    parser.add_argument(
        "--method",
        choices=("auto", "emulated", "distilled", "mdrff", "plain"),
        default="auto",
        help="emulated: learn the statistics of a material; mdrff: learn the material of "
        "statistics; auto (default): the average of these two that says most about held-out "
        "pours; distilled: a network that imitates the emulator; plain: the paper's recipe",
    )
    parser.add_argument(
        "--components",
        type=int,
        nargs="+",
        metavar="K",
        help="Gaussians in the mixture of each of the network's five members (default: 5); of "
        "several numbers the one of the best validation loss is kept",
    )
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_train)


def _add_check(commands: Any) -> None:
    text = "say what a model was made from and whether its posteriors hold the truth"
    parser = commands.add_parser("check", help=text, description=text)
    parser.add_argument("model", type=READS, help="folder of `train`")
    parser.add_argument(
        "--data", type=READS, help="pours that the model was not trained on, to check it with"
    )
    parser.add_argument(
        "--plots",
        type=writes("plots"),
        help="write coverage.png, sbc.png and training.png to this folder",
    )
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_check)


def _add_recordings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=READS, help="folder of `train`, or a scene of `model`")
    _add_reading(parser)
    parser.add_argument(
        "--scene", type=READS, help="refuse a model of another scene than this TOML"
    )


def _add_reading(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording",
        type=RECORDING,
        nargs="+",
        help=".bag, .mcap, .npz height map, 16-bit depth PNG or folder of PNGs; "
        "several: pours of one material",
    )
    parser.add_argument("--camera", type=READS, help="TOML of the camera; PNGs need it")
    parser.add_argument("--topic", help="topic of the depth images, where several fit")
    parser.add_argument("--camera-topic", help="topic of the lens, where several fit")
    parser.add_argument("--colour-topic", help="topic of the colour images, where several fit")
    parser.add_argument(
        "--frames",
        type=_frames,
        default=10,
        help="frames to average, or all (default: the last 10)",
    )
    parser.add_argument("--first-frame", type=int, help="index of the first of them, from 0")


def _add_infer(commands: Any) -> None:
    text = "infer the parameters from recordings"
    parser = commands.add_parser("infer", help=text, description=text)
    _add_recordings(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "-o", "--out", type=writes("json"), help="write JSON with samples to this file"
    )
    parser.add_argument("--plot", type=writes("figure"), help="write the pair plot to this file")
    parser.set_defaults(run=_infer)


def _add_calibrate(commands: Any) -> None:
    text = "infer the parameters from recordings with few pours, made in rounds for them alone"
    parser = commands.add_parser("calibrate", help=text, description=text)
    parser.add_argument("scene", type=READS, help="scene as TOML, or the word funnel")
    parser.add_argument("prior", type=READS, help="prior as TOML, or the word default")
    _add_reading(parser)
    parser.add_argument("--budget", type=int, default=100, help="pours in all (default: 100)")
    parser.add_argument(
        "-o", "--out", type=writes("calibration"), required=True, help="folder; holds the pours"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the run (default: 0)")
    parser.add_argument("--threads", type=int, help="pours at once (default: all cores)")
    parser.add_argument("--engine", help="another simulator in place of ours: docs/engines.md")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(run=_calibrate)


def _add_report(commands: Any) -> None:
    text = "infer, simulate the result and write one HTML page"
    parser = commands.add_parser("report", help=text, description=text)
    _add_recordings(parser)
    parser.add_argument("-o", "--out", type=writes("html"), required=True, help="the HTML file")
    parser.add_argument("--seeds", type=int, default=3, help="pours to compare (default: 3)")
    parser.add_argument("--threads", type=int, help="pours at once (default: all cores)")
    parser.add_argument(
        "--data", type=READS, help=f"training data (default: {_TRAINING} in the model's folder)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_report)


def _add_reproduce(commands: Any) -> None:
    text = "repeat a study of docs/results; without a name, list them"
    parser = commands.add_parser("reproduce", help=text, description=text)
    parser.add_argument("study", nargs="?", help="name of the study")
    parser.add_argument(
        "experiment", nargs="?", help="of the study `paper`: its name or number (default: all)"
    )
    parser.add_argument(
        "--out", type=writes("folder"), default=Path("out"), help="folder (default: out)"
    )
    parser.add_argument("--data", type=READS, help="measured data (default: $GRANULCAL_DATA)")
    parser.add_argument(
        "--maps", type=READS, help="kinect_mounds: folder of other maps compacted_*.npz"
    )
    parser.add_argument(
        "--json", type=writes("json"), help="kinect_mounds: file for what each map gave"
    )
    paper = parser.add_argument_group("only with the study `paper`")
    paper.add_argument(
        "--quick", action="store_true", help="few grains and few pours; says so, proves nothing"
    )
    paper.add_argument(
        "--report",
        action="store_true",
        help="write one HTML page of all experiments; those that have run are not run again",
    )
    paper.add_argument("--threads", type=int, help="pours at once (default: all cores)")
    parser.set_defaults(run=_reproduce)


def _train(options: argparse.Namespace) -> int:
    from granulcal.bayessim import BayesSim
    from granulcal.dataset import Dataset

    data = Dataset.load(options.data)
    told = options.told
    settings: dict[str, Any] = {}
    if options.components:
        settings["components"] = tuple(options.components)
    model = BayesSim.fit(data, seed=options.seed, method=options.method, **settings)
    model.save(options.out)
    data.save(options.out / _TRAINING)
    print(f"model written to {options.out}")
    checked = None if model.calibration is None else model.calibration.is_calibrated
    told |= {"model": str(options.out), "pours": len(data), "calibrated": checked}
    return _DONE


def _check(options: argparse.Namespace) -> int:
    from granulcal.bayessim import BayesSim
    from granulcal.bayessim.pairs import TrainingPairs
    from granulcal.dataset import Dataset
    from granulcal.starter.models import model_named

    model = BayesSim.load(model_named(options.model))
    print(model.summary)
    calibration = model.calibration
    if options.data is not None:
        pairs = TrainingPairs.gather(Dataset.load(options.data), prior=model.prior, fewest=10)
        if pairs.x_names != model.x_names:
            raise ValueError(
                f"{options.data} has the statistics {pairs.x_names}, the model {model.x_names}"
            )
        print(f"on the {len(pairs.theta)} usable pours of {options.data}:")
        calibration = model.check(pairs.theta, pairs.x)
    options.told["model"] = str(options.model)
    options.told["calibrated"] = None if calibration is None else calibration.is_calibrated
    if calibration is None:
        print("  not checked: too few pours to keep some aside; give some with --data")
        return _UNHEALTHY
    print(calibration)
    if model.identifiability is not None:
        print(model.identifiability)
    if options.plots is not None:
        calibration.plot(options.plots)
        if model.summary.plot(options.plots / "training.png") is None:
            print("no training.png: the posterior is the emulator's alone, no network was kept")
        print(f"plots written to {options.plots}")
    return _DONE if calibration.is_calibrated else _UNHEALTHY


def _infer(options: argparse.Namespace) -> int:
    """Everything but the plot is by granulcal-cli, so that both say the same."""
    from granulcal.starter.models import model_named

    if options.plot is not None and importlib.util.find_spec("torch") is None:
        raise ModuleNotFoundError("--plot needs PyTorch")
    model = model_named(str(options.model))
    words = ["granulcal", "infer", str(model), *map(str, options.recording)]
    for name in ("camera", "topic", "camera_topic", "colour_topic", "first_frame", "scene", "out"):
        value = getattr(options, name)
        if value is not None:
            words.append(f"--{name.replace('_', '-')}={value}")
    words.append(f"--frames={options.frames or 'all'}")
    if options.json:
        words.append("--json")
    code = _native.run_cli(words)
    if options.plot is not None and code in (_DONE, _UNHEALTHY):
        import numpy as np

        model = _model(options)
        matched = {} if model.scene_toml is None else _matched(model.scene_toml)
        with contextlib.redirect_stderr(io.StringIO()):
            # What is lost of the recordings is told already.
            recordings = _recordings(options)
        observed = [recording.formation(**matched).statistics() for recording in recordings]
        model.posterior(np.array([np.asarray(each) for each in observed])).pair_plot(options.plot)
    return code


def _calibrate(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named
    from granulcal.prior import Prior
    from granulcal.progress import ProgressLine
    from granulcal.scene import Scene
    from granulcal.within_budget import calibrate_within

    scene = Scene.named(options.scene)
    prior = Prior.named(options.prior)
    recordings = _recordings(options)
    line, first = ProgressLine(), []

    def poured(kept: int) -> None:
        # What was kept before the first pour of this run is not counted in the time that is left.
        first.append(kept - 1)
        line(options.budget, first[0], kept - first[0], 0)

    found = calibrate_within(
        scene,
        prior,
        recordings,
        budget=options.budget,
        out=options.out,
        seed=options.seed,
        threads=options.threads,
        progress=lambda each: print(each, file=sys.stderr, flush=True),
        poured=poured,
        engine=None if options.engine is None else engine_named(options.engine),
    )
    line.close()
    posterior = found.posterior
    document = {
        "recordings": [str(path) for path in options.recording],
        "parameters": _parameters(posterior),
        "inside_model": {"is_inside": found.misfit.is_inside, "p_value": found.misfit.p_value},
        "pours": len(found.x),
        "usable": found.rounds[-1].usable,
        "warnings": [str(warning) for warning in posterior.warnings],
        "samples": posterior.sample(_SAMPLES).tolist(),
    }
    write_beside(options.out / "posterior.json", json.dumps(document, indent=1) + "\n")
    if options.json:
        del document["samples"]
        print(json.dumps(document, indent=1))
        return _outcome(recordings)
    print(found.misfit)
    _print_parameters(document["parameters"])
    print(f"{found.rounds[-1]}; {found.choice}")
    for warning in document["warnings"]:
        print(f"note: {warning}", file=sys.stderr)
    return _outcome(recordings)


def _parameters(posterior: Any) -> dict[str, dict[str, Any]]:
    mode, mean, region = posterior.mode(), posterior.mean(), posterior.credible_region(0.9)
    return {
        name: {"mode": float(mode[i]), "mean": float(mean[i]), "interval90": list(region[name])}
        for i, name in enumerate(posterior.names)
    }


def _print_parameters(parameters: dict[str, Any]) -> None:
    print(f"{'parameter':<30}{'mode':>10}{'mean':>10}   90 % interval")
    for name, values in parameters.items():
        low, high = values["interval90"]
        print(f"{name:<30}{values['mode']:>10.4g}{values['mean']:>10.4g}   {low:.4g} to {high:.4g}")


def _report(options: argparse.Namespace) -> int:
    from granulcal.calibrate import calibrate
    from granulcal.dataset import Dataset
    from granulcal.recording import FRAMES
    from granulcal.starter.models import model_named

    if options.seeds < 1:
        raise ValueError(f"--seeds must be at least 1, got {options.seeds}")
    model = _model(options)
    folder = model_named(options.model)
    data = Dataset.load(folder / _TRAINING if options.data is None else options.data)
    names = " ".join(str(path) for path in options.recording)
    words = ["granulcal", "report", str(options.model), *map(str, options.recording)]
    for name in ("camera", "topic", "camera_topic", "colour_topic", "first_frame"):
        if getattr(options, name) is not None:
            words += [f"--{name.replace('_', '-')}", str(getattr(options, name))]
    if options.frames != FRAMES:
        words += ["--frames", str(options.frames or "all")]
    words += ["-o", str(options.out), "--seeds", str(options.seeds)]
    recordings = _recordings(options)
    found = calibrate(
        model,
        data,
        recordings,
        report=options.out,
        seeds=options.seeds,
        threads=options.threads,
        title=f"Calibration from {names}",
        summary=f"Parameters of the scene {data.scene.name!r}, inferred from {names} "
        f"with a model trained on {len(data)} pours.",
        command=shlex.join(words),
    )
    print(found.report)
    options.told["report"] = str(found.report)
    is_healthy = all(p.status != "unhealthy" for p in [*found.pours, *found.prior_pours])
    return _outcome(recordings, is_healthy)


def _reproduce(options: argparse.Namespace) -> int:
    import importlib
    import pkgutil

    from granulcal import experiments
    from granulcal.demo import measured_data

    studies = sorted(module.name for module in pkgutil.iter_modules(experiments.__path__))
    if options.study is None:
        print("\n".join(studies))
        return _DONE
    if options.study not in studies:
        raise ValueError(f"no study {options.study!r}; there are {', '.join(studies)}")
    if options.study == "paper":
        return _reproduce_paper(options)
    for name in ("experiment", "quick", "report", "threads"):
        if getattr(options, name):
            raise ValueError(f"{name} belongs to the study 'paper', not to {options.study!r}")
    module = importlib.import_module(f"granulcal.experiments.{options.study}")
    data = options.data or measured_data()
    extra = {"maps_dir": options.maps, "json_path": options.json}
    given = {name: value for name, value in extra.items() if value is not None}
    if given and options.study != "kinect_mounds":
        raise ValueError(f"--maps and --json are of kinect_mounds, not of {options.study}")
    if data is None and options.maps is None:
        raise FileNotFoundError("no measured data: give --data or set $GRANULCAL_DATA")
    module.reproduce(options.out, data, **given)
    return _DONE


def _reproduce_paper(options: argparse.Namespace) -> int:
    from granulcal.experiments.paper import reproduce_paper
    from granulcal.experiments.paper.common.sizes import FULL, QUICK

    reproduce_paper(
        options.out,
        options.experiment,
        size=QUICK if options.quick else FULL,
        report=options.report,
        threads=options.threads,
    )
    return _DONE


def _model(options: argparse.Namespace) -> Any:
    from granulcal.starter.models import model_named

    # Before PyTorch is loaded: a name that leads nowhere is told at once.
    folder = model_named(options.model)
    from granulcal.bayessim import BayesSim
    from granulcal.calibrate import require_own_statistics, require_same_scene
    from granulcal.scene import Scene

    model = BayesSim.load(folder)
    require_own_statistics(model)
    if options.scene is not None:
        require_same_scene(model, Scene.load(options.scene))
    return model


def _matched(scene_toml: str) -> dict[str, float]:
    """Options with which a pixel is as wide on the ground as in the scene's images."""
    from granulcal.scene import Scene

    return {"ground_resolution": Scene.from_toml(scene_toml).ground_resolution}


def _recordings(options: argparse.Namespace) -> list[Any]:
    from granulcal.recording import DamagedRecordingWarning, Recording

    opened: list[Any] = []
    for path in options.recording:
        with warnings.catch_warnings():
            # Told below in the manner of a command line.
            warnings.simplefilter("ignore", DamagedRecordingWarning)
            recording = Recording.open(
                path,
                camera=options.camera,
                topic=options.topic,
                camera_topic=options.camera_topic,
                colour_topic=options.colour_topic,
                frames=options.frames,
                first_frame=options.first_frame,
            )
        for line in recording.damage:
            print(f"warning: {line}", file=sys.stderr)
        if recording.lost is not None:
            print(f"warning: {path}: {recording.lost}", file=sys.stderr)
        opened.append(recording)
    return opened


def _frames(text: str) -> int | None:
    return None if text == "all" else int(text)


def _outcome(recordings: Sequence[Any], is_healthy: bool = True) -> int:
    is_whole = all(recording.lost is None for recording in recordings)
    return _DONE if is_healthy and is_whole else _UNHEALTHY


if __name__ == "__main__":
    raise SystemExit(console())
