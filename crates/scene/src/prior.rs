//! A prior: which numbers of a scene are unknown, and how they are distributed.
//!
//! ```
//! use granulcal_scene::Prior;
//! let prior = Prior::from_toml(r#"
//!     [[parameter]]
//!     path = "material.sliding_friction"
//!     distribution = "uniform"
//!     low = 0.1
//!     high = 1.0
//! "#)?;
//! assert_eq!(prior.names(), ["material.sliding_friction"]);
//! // A draw depends on the seed and the row only.
//! assert_eq!(prior.sample(1, 17), prior.sample(1, 17));
//! # Ok::<(), granulcal_scene::SceneError>(())
//! ```

mod entry;
mod parameter;

use crate::distribution::Distribution;
use crate::error::SceneError;
use crate::scene::Scene;
use crate::uniforms::Uniforms;
use entry::{Entry, File};
use parameter::refuse;
pub use parameter::{Keys, Parameter};

/// Rows of a batch whose draws are checked before its first pour, at most.
const MOST_CHECKED: u64 = 1 << 20;
/// Rows whose values are tried together, at most: each takes a tenth of a millisecond.
const MOST_CHECKED_TOGETHER: u64 = 1 << 14;

/// Independent parameters, each named by its path in the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    parameters: Vec<Parameter>,
}

impl Default for Prior {
    /// The paper's three coefficients: sliding friction and restitution uniform, rolling friction uniform in
    /// its logarithm, from where a pile no longer notices it to where rolling is locked.
    fn default() -> Self {
        let of = |path: &str, distribution| Parameter { path: path.to_owned(), distribution };
        let uniform = |low, high| Distribution::Uniform { low, high };
        Self {
            parameters: vec![
                of("material.sliding_friction", uniform(0.0, 1.0)),
                of("material.rolling_friction", Distribution::LogUniform { low: 1e-3, high: 1.0 }),
                of("material.restitution", uniform(0.0, 1.0)),
            ],
        }
    }
}

impl Parameter {
    /// A parameter of the words and numbers that a file has of it.
    ///
    /// # Errors
    /// [`SceneError::Prior`] names the parameter and what cannot be.
    pub fn of_keys(path: &str, distribution: &str, keys: Keys) -> Result<Self, SceneError> {
        let parameter = Entry::with(path, distribution, keys).into_parameter()?;
        parameter.check()?;
        Ok(parameter)
    }
}

impl Prior {
    /// A prior of these parameters, in this order.
    ///
    /// # Errors
    /// [`SceneError::Prior`] names the parameter and the number that cannot be.
    pub fn new(parameters: Vec<Parameter>) -> Result<Self, SceneError> {
        if parameters.is_empty() {
            return Err(refuse("", "parameter", "none".to_owned(), "given at least once"));
        }
        for (index, parameter) in parameters.iter().enumerate() {
            parameter.check()?;
            if parameters[..index].iter().any(|p| plain(&p.path) == plain(&parameter.path)) {
                let got = "the same path twice".to_owned();
                return Err(refuse(&parameter.path, "path", got, "given once"));
            }
        }
        Ok(Self { parameters })
    }

    /// Reads a prior.
    ///
    /// # Errors
    /// [`SceneError::PriorToml`] for what is not TOML of a prior (unknown keys included), else as [`Prior::new`].
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        let file: File =
            toml::from_str(text).map_err(|e| SceneError::PriorToml(Box::new(e.into())))?;
        let parameters = file.parameter.into_iter().map(Entry::into_parameter);
        Self::new(parameters.collect::<Result<_, _>>()?)
    }

    /// The prior as TOML; [`Prior::from_toml`] reads it back unchanged.
    ///
    /// # Errors
    /// [`SceneError::PriorTomlWrite`] if it cannot be written.
    pub fn to_toml(&self) -> Result<String, SceneError> {
        let file = File { parameter: self.parameters.iter().map(Entry::of).collect() };
        toml::to_string(&file).map_err(|e| SceneError::PriorTomlWrite(Box::new(e)))
    }

    /// Checks that every parameter has a place in the scene over its whole range.
    ///
    /// # Errors
    /// [`SceneError::PriorDoesNotFit`] names the parameter and the value that does not fit,
    /// [`SceneError::PriorOfWhole`] one that draws what the scene has whole numbers for.
    pub fn check(&self, scene: &Scene) -> Result<(), SceneError> {
        for parameter in &self.parameters {
            parameter.check_whole(scene)?;
            for value in parameter.distribution.extremes() {
                scene.with(&parameter.path, value).map_err(|source| {
                    let parameter = parameter.path.clone();
                    SceneError::PriorDoesNotFit { parameter, value, source: Box::new(source) }
                })?;
            }
        }
        Ok(())
    }

    /// Checks what the first `rows` rows of a seed draw where [`Self::check`] cannot tell: values of a normal that is
    /// not cut off, and numbers of the scene that hang together, such as a diameter and a spacing.
    ///
    /// # Errors
    /// [`SceneError::PriorDoesNotFit`] names the first parameter and value that does not fit,
    /// [`SceneError::DrawDoesNotFit`] the first row whose values do not fit together.
    pub fn check_draws(&self, scene: &Scene, seed: u64, rows: u64) -> Result<(), SceneError> {
        let unbounded: Vec<_> = (0..self.parameters.len())
            .filter(|&number| self.parameters[number].distribution.is_unbounded())
            .collect();
        let together = self.free_beside_material().len() > 1;
        let together = if together { rows.min(MOST_CHECKED_TOGETHER) } else { 0 };
        let alone = if unbounded.is_empty() { 0 } else { rows.min(MOST_CHECKED) };
        for row in 0..alone.max(together) {
            let values = self.sample(seed, row);
            for &number in unbounded.iter().filter(|_| row < alone) {
                let (path, value) = (&self.parameters[number].path, values[number]);
                scene.with(path, value).map_err(|source| SceneError::PriorDoesNotFit {
                    parameter: path.clone(),
                    value,
                    source: Box::new(source),
                })?;
            }
            if row < together {
                self.apply(scene, &values).map_err(|source| SceneError::DrawDoesNotFit {
                    row,
                    source: Box::new(source),
                })?;
            }
        }
        Ok(())
    }

    /// All parameters, fixed ones included.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The paths of all parameters, fixed ones included.
    pub fn names(&self) -> Vec<&str> {
        self.parameters.iter().map(|p| p.path.as_str()).collect()
    }

    /// Indices of the parameters that vary.
    pub fn free(&self) -> Vec<usize> {
        let varies = |p: &Parameter| !matches!(p.distribution, Distribution::Fixed { .. });
        (0..self.parameters.len()).filter(|&i| varies(&self.parameters[i])).collect()
    }

    /// Indices of the parameters that vary and are of no material, whose numbers bound each other and the start
    /// nowhere.
    pub fn free_beside_material(&self) -> Vec<usize> {
        let is_beside = |&n: &usize| !plain(&self.parameters[n].path).starts_with("material.");
        self.free().into_iter().filter(is_beside).collect()
    }

    /// The values of a row, one each parameter. They depend on the seed and the row only; fixing
    /// one parameter leaves the draws of the others as they were.
    pub fn sample(&self, seed: u64, row: u64) -> Vec<f64> {
        let mut uniforms = Uniforms::of_row(seed, row);
        self.parameters.iter().map(|p| p.distribution.quantile(uniforms.next())).collect()
    }

    /// The scene with these values of the parameters.
    ///
    /// # Errors
    /// [`SceneError`] if the scene refuses them; [`SceneError::Values`] for another number of them than of parameters.
    pub fn apply(&self, scene: &Scene, values: &[f64]) -> Result<Scene, SceneError> {
        let (got, expected) = (values.len(), self.parameters.len());
        if got != expected {
            return Err(SceneError::Values { got, expected });
        }
        let changes: Vec<_> = self.names().into_iter().zip(values.iter().copied()).collect();
        let mut scene = scene.clone();
        scene.set(&changes)?;
        Ok(scene)
    }
}

/// The path without the optional `scene.` in front.
fn plain(path: &str) -> &str {
    path.strip_prefix("scene.").unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        [[parameter]]
        path = "material.sliding_friction"
        distribution = "uniform"
        low = 0.1
        high = 1.0
        [[parameter]]
        path = "scene.funnel.height"
        distribution = "normal"
        mean = 0.1
        sd = 0.02
        low = 0.05
        [[parameter]]
        path = "material.rolling_friction"
        distribution = "log_uniform"
        low = 0.001
        high = 0.5
        [[parameter]]
        path = "material.restitution"
        distribution = "fixed"
        value = 0.4
    "#;

    #[test]
    fn a_normal_that_is_not_cut_off_is_checked_draw_by_draw() {
        let text = |cut: &str| {
            format!(
                "[[parameter]]\npath = \"material.sliding_friction\"\ndistribution = \"normal\"\nmean = 0.3\nsd = 0.12{cut}\n"
            )
        };
        let (scene, open) = (Scene::drop(0.1), Prior::from_toml(&text("")).unwrap());
        open.check(&scene).unwrap();
        open.check_draws(&scene, 0, 20).unwrap();
        let error = open.check_draws(&scene, 0, 2000).unwrap_err();
        assert!(
            matches!(error, SceneError::PriorDoesNotFit { value, .. } if value < 0.0),
            "{error}"
        );
        let cut = Prior::from_toml(&text("\nlow = 0.0")).unwrap();
        cut.check_draws(&scene, 0, 2000).unwrap();
    }

    #[test]
    fn numbers_that_hang_together_are_checked_row_by_row() {
        let text = |low: f64| {
            format!(
                "[[parameter]]\npath = \"grains.diameter\"\ndistribution = \"uniform\"\nlow = 0.003\nhigh = 0.006\n\
                 [[parameter]]\npath = \"start.spacing\"\ndistribution = \"uniform\"\nlow = {low}\nhigh = 0.02\n"
            )
        };
        let mut scene = Scene::funnel(0.12);
        scene.set(&[("start.spacing", 0.01), ("start.jitter", 1e-5)]).unwrap();
        let prior = Prior::from_toml(&text(0.0045)).unwrap();
        let error = prior.check_draws(&scene, 0, 2000).unwrap_err();
        let SceneError::DrawDoesNotFit { row, .. } = error else { panic!("{error}") };
        assert!(prior.apply(&scene, &prior.sample(0, row)).is_err());
        assert!((0..row).all(|row| prior.apply(&scene, &prior.sample(0, row)).is_ok()));
        Prior::from_toml(&text(0.0065)).unwrap().check_draws(&scene, 0, 2000).unwrap();
    }

    #[test]
    fn survives_toml_and_fits_the_scene() {
        let prior = Prior::from_toml(TEXT).unwrap();
        assert_eq!(Prior::from_toml(&prior.to_toml().unwrap()).unwrap(), prior);
        prior.check(&Scene::funnel(0.12)).unwrap();
        assert_eq!(prior.free(), [0, 1, 2]);
        let values = prior.sample(5, 9);
        let scene = prior.apply(&Scene::funnel(0.12), &values).unwrap();
        for wrong in [&values[1..], &[&values[..], &[0.5]].concat()] {
            let error = prior.apply(&Scene::funnel(0.12), wrong).unwrap_err();
            assert!(error.to_string().contains("of 4 parameters needs"), "{error}");
        }
        assert_eq!(scene.material.sliding_friction, values[0]);
        assert_eq!(scene.funnel.unwrap().height, values[1]);
        assert_eq!(scene.material.restitution, 0.4);
    }

    #[test]
    fn fixing_one_parameter_leaves_the_others() {
        let prior = Prior::from_toml(TEXT).unwrap();
        let fixed = TEXT.replace(
            "distribution = \"uniform\"\n        low = 0.1\n        high = 1.0",
            "distribution = \"fixed\"\n        value = 0.3",
        );
        let fixed = Prior::from_toml(&fixed).unwrap();
        assert_eq!(prior.sample(1, 2)[1..], fixed.sample(1, 2)[1..]);
    }

    #[test]
    fn slips_are_named() {
        let cases = [
            ("low = 0.001", "low = -0.001", "positive for log_uniform"),
            ("high = 1.0", "high = 0.1", "above low"),
            ("high = 1.0", "", "high must be given"),
            ("value = 0.4", "value = 0.4\nlow = 0.1", "low must be absent"),
            ("sd = 0.02", "sd = 0.0", "sd must be positive"),
            ("\"fixed\"", "\"constant\"", "one of uniform"),
            ("\"material.restitution\"", "\"material.sliding_friction\"", "given once"),
            ("value = 0.4", "value = nan", "finite"),
            (
                "low = 0.1\n        high = 1.0",
                "low = -1e308\n        high = 1e308",
                "high less low",
            ),
            ("low = 0.05", "low = 0.25", "of the normal's mass"),
            ("\"material.restitution\"", "\"material restitution\"", "words joined by dots"),
        ];
        for (from, to, expected) in cases {
            assert!(TEXT.contains(from), "{from}");
            let error = Prior::from_toml(&TEXT.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(expected), "{from} -> {to}: {error}");
        }
        let unknown = Prior::from_toml(&TEXT.replace("sd =", "sigma =")).unwrap_err();
        let source = std::error::Error::source(&unknown).unwrap().to_string();
        assert!(source.contains("sigma"), "{source}");
    }

    #[test]
    fn whole_numbers_are_not_drawn() {
        let text = |rest: &str| format!("[[parameter]]\npath = \"grains.count\"\n{rest}");
        let drawn = Prior::from_toml(&text("distribution = \"uniform\"\nlow = 100\nhigh = 200"));
        let error = drawn.unwrap().check(&Scene::drop(0.1)).unwrap_err().to_string();
        assert!(error.contains("grains.count") && error.contains("grains.volume"), "{error}");
        let fixed = Prior::from_toml(&text("distribution = \"fixed\"\nvalue = 100"));
        fixed.unwrap().check(&Scene::drop(0.1)).unwrap();
    }

    #[test]
    fn values_that_the_scene_refuses_are_named() {
        let prior = Prior::from_toml(&TEXT.replace("high = 1.0", "high = 11.0")).unwrap();
        let error = prior.check(&Scene::funnel(0.12)).unwrap_err();
        assert!(error.to_string().contains("11"), "{error}");
        // A ball that is dropped has no funnel.
        assert!(Prior::from_toml(TEXT).unwrap().check(&Scene::drop(0.1)).is_err());
    }
}
