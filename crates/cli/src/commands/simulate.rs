//! `simulate`: one pour.

mod args;

use std::path::Path;
use std::time::Instant;

use anyhow::Context as _;
use cpu_time::ProcessTime;
use granulcal_dataset::{
    DatasetError, ObservedStatistic, Observer, Room, RowStatus, npy, observe, observed_statistics,
};
use granulcal_dem::{Breach, Health, Pour, Status};
use granulcal_features::{DIAGNOSTICS, PAPER16, Statistic};
use granulcal_scene::Scene;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::render::{check_name, write_view};
use crate::context::{Context, print_json, print_line};
use crate::outcome::Outcome;
use crate::run::{Run, Setting};
use crate::scene::{self, Keep};
use crate::sides::SideFiles;
pub use args::SimulateArgs;

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    scene: String,
    seed: u64,
    status: &'static str,
    health: Health,
    cpu_s: f64,
    wall_s: f64,
    simulated_s: f64,
    grains_in_funnel: usize,
    /// Grains that have left through the scene's outflow; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    grains_out: Option<usize>,
    /// Hash of every bit of the final state, in hexadecimal digits.
    state_hash: String,
    /// Null with too few grains in view.
    statistics: Option<Map<String, Value>>,
    /// Absent unless asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    diagnostics: Option<Map<String, Value>>,
    /// What the scene observes; absent if nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    observed: Option<Map<String, Value>>,
    /// Name to unit, times and values of what was sampled.
    #[serde(skip_serializing_if = "Map::is_empty")]
    series: Map<String, Value>,
}

impl Run for SimulateArgs {
    fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(setting.context, self)
    }
}

fn run(context: &Context, args: &SimulateArgs) -> anyhow::Result<Outcome> {
    scene::refuse_elsewhere("--engine", args.engine.as_deref())?;
    let scene = scene::load(&args.scene)?;
    if let Some(path) = &args.depth {
        check_name(path, &scene)?;
    }
    let (clock, start) = (ProcessTime::now(), Instant::now());
    let keep = match (&args.mcap, &args.checkpoint) {
        (Some(path), _) => Keep::Film { path, fps: args.fps },
        (None, Some(path)) => Keep::Checkpoint { path, every: args.checkpoint_every },
        (None, None) => Keep::Nothing,
    };
    if let Keep::Film { path, fps } = keep {
        Room::of_pour(&scene, Some(fps)).require(Some(path))?;
    }
    let simulation = scene::start(&scene, args.seed, args.threads, resumed(args))?;
    let (mut observer, mut sides) = (Observer::new(&scene), SideFiles::default());
    let pour =
        scene::pour(context, &scene, args.seed, simulation, &keep, &mut observer, &mut sides)?;
    let Some(pour) = pour else {
        if let Keep::Checkpoint { path, .. } = keep {
            let path = path.display();
            tracing::warn!("stopped; the same command with --resume {path} goes on");
        } else {
            tracing::warn!("stopped; nothing was written");
        }
        return Ok(Outcome::Stopped);
    };
    let mut report = Report {
        scene: scene.name.clone(),
        seed: args.seed,
        status: pour.status.name(),
        health: pour.health,
        cpu_s: 0.0,
        wall_s: 0.0,
        simulated_s: pour.simulated_s,
        grains_in_funnel: pour.grains_in_funnel,
        grains_out: scene.outflow.map(|_| pour.radii_out.len()),
        state_hash: format!("{:032x}", pour.state_hash),
        statistics: None,
        diagnostics: None,
        observed: None,
        series: Map::new(),
    };
    let status = describe(&scene, &pour, &observer, args, &mut report, &mut sides)?;
    report.cpu_s = clock.elapsed().as_secs_f64();
    report.wall_s = start.elapsed().as_secs_f64();
    if let Some(path) = &args.positions {
        sides.keep(npy::write_points(path, &pour.positions).context("writing --positions"));
    }
    print(&report, &scene, args.json)?;
    if pour.status == Status::Unhealthy {
        tracing::warn!("{}", why_unhealthy(&pour.health, &scene));
    }
    Ok(sides.finish(Outcome::healthy_if(status.is_healthy())))
}

/// The checkpoint to go on from: none yet where it is the one that this pour writes, so that one line begins and goes
/// on.
fn resumed(args: &SimulateArgs) -> Option<&Path> {
    let path = args.resume.as_deref()?;
    let is_own = args.checkpoint.as_deref() == Some(path);
    if is_own && !path.exists() {
        tracing::info!("no {} yet: the pour begins", path.display());
        return None;
    }
    Some(path)
}

/// Which bounds a pour has broken, and what may help.
fn why_unhealthy(health: &Health, scene: &Scene) -> String {
    let breaches: Vec<_> = health.breaches(scene).iter().map(Breach::to_string).collect();
    let why = if breaches.is_empty() {
        "a number is infinite or none".to_owned()
    } else {
        breaches.join("; ")
    };
    let dt = scene.settings().dt;
    let enters = if scene.intruder.is_some() {
        "; a ball that enters inside of grains or walls needs another place"
    } else {
        ""
    };
    format!(
        "unhealthy: {why}. Small, thin or fast grains need a finer step: `substep = {}` in the scene (now {dt} s){enters}",
        0.5 * dt
    )
}

/// Looks at the pour and fills in the statistics; writes the image if asked.
fn describe(
    scene: &Scene,
    pour: &Pour,
    observer: &Observer,
    args: &SimulateArgs,
    report: &mut Report,
    sides: &mut SideFiles,
) -> anyhow::Result<RowStatus> {
    let status = observer.status(pour);
    report.status = status.name();
    tell_observed(scene, pour, observer, report);
    let seen = match observe(&scene.camera, pour, args.seed) {
        // The grains of an unhealthy pour can be anywhere: the status says enough.
        Err(DatasetError::Features(reason)) if !status.is_healthy() => {
            tracing::warn!("no statistics: {reason}");
            return Ok(status);
        }
        other => other?.with_grain_diameter(scene.grains.diameter),
    };
    if let Some(path) = &args.depth {
        sides.keep(
            write_view(path, &seen.view, args.depth_unit, &scene.camera).context("writing --depth"),
        );
    }
    match &seen.statistics {
        Ok(values) => {
            report.statistics = Some(by_name(&PAPER16, values));
            if args.diagnostics {
                report.diagnostics = Some(by_name(&DIAGNOSTICS, &seen.diagnostics()?));
            }
            Ok(status)
        }
        Err(reason) => {
            tracing::warn!("{reason}");
            let says_enough = !status.is_healthy() || status.is_jammed() || !observer.is_idle();
            let status = if says_enough { status } else { RowStatus::NoGrainsInView };
            report.status = status.name();
            Ok(status)
        }
    }
}

/// Fills in what the scene observes.
fn tell_observed(scene: &Scene, pour: &Pour, observer: &Observer, report: &mut Report) {
    if observer.is_idle() {
        return;
    }
    let observed = observer.observed(pour);
    let names = observed_statistics(scene).into_iter().map(|statistic| statistic.name);
    report.observed = Some(names.zip(observed.statistics.into_iter().map(Value::from)).collect());
    let entry = |s: granulcal_dataset::Series| {
        (s.name, json!({ "unit": s.unit, "times": s.times, "values": s.values }))
    };
    report.series = observed.series.into_iter().map(entry).collect();
}

fn by_name<P>(registry: &[Statistic<P>], values: &[f64]) -> Map<String, Value> {
    registry.iter().zip(values).map(|(s, &value)| (s.name.to_owned(), value.into())).collect()
}

fn print(report: &Report, scene: &Scene, json: bool) -> anyhow::Result<()> {
    if json {
        return print_json(report);
    }
    let Report { health, .. } = report;
    print_line(&format!("scene              {} (seed {})", report.scene, report.seed))?;
    print_line(&format!("status             {}", report.status))?;
    print_line(&format!("simulated          {:.3} s", report.simulated_s))?;
    print_line(&format!("wall, cpu          {:.2} s, {:.2} s", report.wall_s, report.cpu_s))?;
    print_line(&format!("worst penetration  {:.4} radii", health.worst_penetration))?;
    print_line(&format!("energy created     {:.2e}", health.energy_created))?;
    print_line(&format!("grains lost        {}", health.grains_lost))?;
    if let Some(out) = report.grains_out {
        print_line(&format!("grains out         {out}"))?;
    }
    if report.grains_in_funnel > 0 {
        print_line(&format!("grains in funnel   {}", report.grains_in_funnel))?;
    }
    print_line(&format!("state              {}", report.state_hash))?;
    for ObservedStatistic { name, unit, .. } in observed_statistics(scene) {
        let value = report.observed.as_ref().and_then(|all| all.get(&name)?.as_f64());
        print_line(&format!("{name:<18} {:<12.6} {unit}", value.unwrap_or(f64::NAN)))?;
    }
    print_family(&PAPER16, report.statistics.as_ref())?;
    print_family(&DIAGNOSTICS, report.diagnostics.as_ref())
}

fn print_family<P>(
    registry: &[Statistic<P>],
    values: Option<&Map<String, Value>>,
) -> anyhow::Result<()> {
    let Some(values) = values else { return Ok(()) };
    for statistic in registry {
        let value = values.get(statistic.name).and_then(Value::as_f64).unwrap_or(f64::NAN);
        print_line(&format!("{:<18} {value:<12.6} {}", statistic.name, statistic.unit))?;
    }
    Ok(())
}
