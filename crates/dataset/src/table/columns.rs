//! The columns of a data set, listed once.

use granulcal_features::{DIAGNOSTICS, PAPER16};
use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::errors::ParquetError;
use parquet::schema::types::Type;

use crate::observer::ObservedStatistic;
use crate::row::Row;

/// Takes a number from a row.
type Getter = Box<dyn Fn(&Row) -> f64>;
/// Puts a number into a row.
type Setter = Box<dyn Fn(&mut Row, f64)>;

/// How one column is taken from a row and put back.
pub(super) enum Access {
    Count { get: fn(&Row) -> u64, set: fn(&mut Row, u64) },
    Number { get: Getter, set: Setter },
    Status,
}

/// A column of the table.
pub(super) struct Column {
    pub(super) name: String,
    /// `-` where it is dimensionless; none of counts, words, and parameters, whose units scenes do not state.
    pub(super) unit: Option<&'static str>,
    pub(super) access: Access,
}

impl Column {
    fn count(name: &str, get: fn(&Row) -> u64, set: fn(&mut Row, u64)) -> Self {
        Self { name: name.to_owned(), unit: None, access: Access::Count { get, set } }
    }

    fn number(
        name: &str,
        unit: Option<&'static str>,
        get: impl Fn(&Row) -> f64 + 'static,
        set: impl Fn(&mut Row, f64) + 'static,
    ) -> Self {
        let access = Access::Number { get: Box::new(get), set: Box::new(set) };
        Self { name: name.to_owned(), unit, access }
    }

    pub(super) fn physical(&self) -> Physical {
        match self.access {
            Access::Count { .. } => Physical::INT64,
            Access::Number { .. } => Physical::DOUBLE,
            Access::Status => Physical::BYTE_ARRAY,
        }
    }

    pub(super) fn schema(&self) -> Result<Type, ParquetError> {
        let builder = Type::primitive_type_builder(&self.name, self.physical())
            .with_repetition(Repetition::REQUIRED);
        match self.access {
            Access::Count { .. } => builder
                .with_logical_type(Some(LogicalType::integer(64, false)))
                .with_converted_type(ConvertedType::UINT_64),
            Access::Number { .. } => builder,
            Access::Status => builder
                .with_logical_type(Some(LogicalType::String))
                .with_converted_type(ConvertedType::UTF8),
        }
        .build()
    }
}

/// Every column of a data set with these parameters whose scene observes these statistics, in the order of the file.
pub(super) fn columns(parameters: &[&str], observed: &[ObservedStatistic]) -> Vec<Column> {
    let mut columns = vec![Column::count("row", |r| r.row, |r, v| r.row = v)];
    for (i, path) in parameters.iter().enumerate() {
        columns.push(Column::number(
            path,
            None,
            move |r| r.parameters[i],
            move |r, v| r.parameters[i] = v,
        ));
    }
    columns.extend([
        Column::count("seed", |r| r.seed, |r, v| r.seed = v),
        Column { name: "status".to_owned(), unit: None, access: Access::Status },
        Column::number("simulated_s", Some("s"), |r| r.simulated_s, |r, v| r.simulated_s = v),
        Column::count(
            "substeps",
            |r| r.health.substeps as u64,
            |r, v| r.health.substeps = v as usize,
        ),
        Column::number(
            "worst_penetration",
            Some("-"),
            |r| r.health.worst_penetration,
            |r, v| r.health.worst_penetration = v,
        ),
        Column::number(
            "mean_residual",
            Some("-"),
            |r| r.health.mean_residual,
            |r, v| r.health.mean_residual = v,
        ),
        Column::number(
            "worst_residual",
            Some("-"),
            |r| r.health.worst_residual,
            |r, v| r.health.worst_residual = v,
        ),
        Column::number(
            "energy_created",
            Some("-"),
            |r| r.health.energy_created,
            |r, v| r.health.energy_created = v,
        ),
        Column::count(
            "grains_lost",
            |r| r.health.grains_lost as u64,
            |r, v| r.health.grains_lost = v as usize,
        ),
        Column::count("sweeps", |r| r.health.sweeps as u64, |r, v| r.health.sweeps = v as usize),
        Column::count(
            "unconverged",
            |r| r.health.unconverged as u64,
            |r, v| r.health.unconverged = v as usize,
        ),
        Column::count("guarded", |r| r.health.guarded as u64, |r, v| r.health.guarded = v as usize),
        Column::number(
            "mean_contacts",
            Some("-"),
            |r| r.health.mean_contacts,
            |r, v| r.health.mean_contacts = v,
        ),
        Column::number("cpu_s", Some("s"), |r| r.cpu_s, |r, v| r.cpu_s = v),
    ]);
    for (i, statistic) in PAPER16.iter().enumerate() {
        columns.push(Column::number(
            statistic.name,
            Some(statistic.unit),
            move |r| r.statistics[i],
            move |r, v| r.statistics[i] = v,
        ));
    }
    for (i, statistic) in DIAGNOSTICS.iter().enumerate() {
        columns.push(Column::number(
            statistic.name,
            Some(statistic.unit),
            move |r| r.diagnostics[i],
            move |r, v| r.diagnostics[i] = v,
        ));
    }
    for (i, statistic) in observed.iter().enumerate() {
        columns.push(Column::number(
            &statistic.name,
            Some(statistic.unit),
            move |r| r.observed[i],
            move |r, v| r.observed[i] = v,
        ));
    }
    columns
}
