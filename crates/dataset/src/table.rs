//! Rows to Parquet and back.
//!
//! The columns are listed once, in `columns.rs`; writing, reading and checking walk that list.

mod columns;

use std::path::Path;
use std::sync::Arc;

use granulcal_dem::Health;
use granulcal_features::stats::DIAGNOSTIC_COUNT;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::header::Header;
use crate::row::{Row, RowStatus};
use crate::{DatasetError, files};
use columns::{Access, Column, columns};

/// Keys of the file's metadata.
const SCENE_KEY: &str = "granulcal.scene";
const PRIOR_KEY: &str = "granulcal.prior";
const VERSION_KEY: &str = "granulcal.version";
const SEED_KEY: &str = "granulcal.seed";

/// Writes rows as one complete file, one row group.
///
/// # Errors
/// [`DatasetError::Io`] or [`DatasetError::Parquet`].
pub(crate) fn write(path: &Path, header: &Header, rows: &[Row]) -> Result<(), DatasetError> {
    let bytes = encode(header, rows, &columns(&header.prior.names(), &header.observed()))
        .map_err(|source| DatasetError::Parquet { path: path.to_owned(), source })?;
    files::write_file(path, &bytes)
}

fn encode(header: &Header, rows: &[Row], columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(|c| c.schema().map(Arc::new)).collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("granulcal").with_fields(fields).build()?);
    let metadata = [
        (SCENE_KEY, header.scene_toml.clone()),
        (PRIOR_KEY, header.prior_toml.clone()),
        (VERSION_KEY, header.version.clone()),
        (SEED_KEY, header.seed.to_string()),
    ];
    let metadata = metadata.into_iter().map(|(key, value)| KeyValue::new(key.to_owned(), value));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(format!("granulcal {}", header.version))
        .set_key_value_metadata(Some(metadata.collect()))
        .build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for column in columns {
        let Some(mut writer) = group.next_column()? else { break };
        match &column.access {
            Access::Count { get, .. } => {
                let values: Vec<_> = rows.iter().map(|row| get(row) as i64).collect();
                writer.typed::<Int64Type>().write_batch(&values, None, None)?;
            }
            Access::Number { get, .. } => {
                let values: Vec<_> = rows.iter().map(get).collect();
                writer.typed::<DoubleType>().write_batch(&values, None, None)?;
            }
            Access::Status => {
                let values: Vec<_> =
                    rows.iter().map(|r| ByteArray::from(r.status.name())).collect();
                writer.typed::<ByteArrayType>().write_batch(&values, None, None)?;
            }
        }
        writer.close()?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// Reads a whole file, every page of it.
///
/// # Errors
/// [`DatasetError::Parquet`] for a truncated or damaged file, [`DatasetError::Content`] for a
/// Parquet file that is no data set of granulcal.
pub(crate) fn read(path: &Path) -> Result<(Header, Vec<Row>), DatasetError> {
    let bytes = files::read(path)?;
    let parquet = |source| DatasetError::Parquet { path: path.to_owned(), source };
    let file = SerializedFileReader::new(bytes::Bytes::from(bytes)).map_err(parquet)?;
    let header = read_header(path, &file)?;
    let observed = header.observed();
    let mut columns = columns(&header.prior.names(), &observed);
    // Files without the diagnostic statistics end before them; they stay NaN.
    let found = file.metadata().file_metadata().schema_descr().num_columns();
    if observed.is_empty() && found + DIAGNOSTIC_COUNT == columns.len() {
        columns.truncate(found);
    }
    check_columns(path, &file, &columns)?;

    let count = usize::try_from(file.metadata().file_metadata().num_rows()).unwrap_or(0);
    let mut rows = vec![blank(header.prior.parameters().len(), observed.len()); count];
    for (index, column) in columns.iter().enumerate() {
        match &column.access {
            Access::Count { set, .. } => {
                let values = read_column::<Int64Type>(&file, index).map_err(parquet)?;
                fill(path, column, &mut rows, values, |row, v| set(row, v as u64))?;
            }
            Access::Number { set, .. } => {
                let values = read_column::<DoubleType>(&file, index).map_err(parquet)?;
                fill(path, column, &mut rows, values, set)?;
            }
            Access::Status => {
                let values = read_column::<ByteArrayType>(&file, index).map_err(parquet)?;
                let mut statuses = Vec::with_capacity(values.len());
                for value in &values {
                    let word = String::from_utf8_lossy(value.data());
                    let status = RowStatus::from_name(&word).ok_or_else(|| {
                        let found = format!("{word:?}");
                        DatasetError::content(path, "column status", found, RowStatus::names())
                    })?;
                    statuses.push(status);
                }
                fill(path, column, &mut rows, statuses, |row, v| row.status = v)?;
            }
        }
    }
    Ok((header, rows))
}

fn blank(parameters: usize, observed: usize) -> Row {
    Row {
        row: 0,
        parameters: vec![f64::NAN; parameters],
        seed: 0,
        status: RowStatus::NoGrainsInView,
        simulated_s: f64::NAN,
        health: Health::default(),
        cpu_s: f64::NAN,
        statistics: [f64::NAN; 16],
        diagnostics: [f64::NAN; DIAGNOSTIC_COUNT],
        observed: vec![f64::NAN; observed],
    }
}

fn fill<T>(
    path: &Path,
    column: &Column,
    rows: &mut [Row],
    values: Vec<T>,
    set: impl Fn(&mut Row, T),
) -> Result<(), DatasetError> {
    if values.len() != rows.len() {
        let what = format!("the length of column {}", column.name);
        let allowed = rows.len().to_string();
        return Err(DatasetError::content(path, what, values.len().to_string(), allowed));
    }
    rows.iter_mut().zip(values).for_each(|(row, value)| set(row, value));
    Ok(())
}

fn read_column<T: parquet::data_type::DataType>(
    file: &SerializedFileReader<bytes::Bytes>,
    index: usize,
) -> Result<Vec<T::T>, ParquetError> {
    let mut values = Vec::new();
    for group in 0..file.num_row_groups() {
        let group = file.get_row_group(group)?;
        let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let reader = group.get_column_reader(index)?;
        let mut reader = parquet::column::reader::get_typed_column_reader::<T>(reader);
        reader.read_records(count, None, None, &mut values)?;
    }
    Ok(values)
}

fn read_header(
    path: &Path,
    file: &SerializedFileReader<bytes::Bytes>,
) -> Result<Header, DatasetError> {
    let metadata = file.metadata().file_metadata().key_value_metadata();
    let value = |key: &str| {
        let entry = metadata.and_then(|all| all.iter().find(|entry| entry.key == key));
        entry.and_then(|entry| entry.value.clone()).ok_or_else(|| {
            let what = format!("metadata {key}");
            DatasetError::content(path, what, "none", "given, as granulcal-cli generate writes it")
        })
    };
    let seed = value(SEED_KEY)?;
    let seed = seed.parse().map_err(|_| {
        let what = format!("metadata {SEED_KEY}");
        DatasetError::content(path, what, format!("{seed:?}"), "a whole number")
    })?;
    Header::parse(path, &value(SCENE_KEY)?, &value(PRIOR_KEY)?, value(VERSION_KEY)?, seed)
}

/// Refuses a file whose columns are not those of its prior.
fn check_columns(
    path: &Path,
    file: &SerializedFileReader<bytes::Bytes>,
    columns: &[Column],
) -> Result<(), DatasetError> {
    let schema = file.metadata().file_metadata().schema_descr();
    for (index, column) in columns.iter().enumerate() {
        let allowed = format!("{} of {}", column.name, column.physical());
        let what = format!("column {index}");
        if index >= schema.num_columns() {
            return Err(DatasetError::content(path, what, "none", allowed));
        }
        let found = schema.column(index);
        let optional = found.max_def_level() > 0 || found.max_rep_level() > 0;
        if found.path().string() != column.name || found.physical_type() != column.physical() {
            let found = format!("{} of {}", found.path().string(), found.physical_type());
            return Err(DatasetError::content(path, what, found, allowed));
        }
        if optional {
            let what = format!("column {}", column.name);
            return Err(DatasetError::content(path, what, "optional or repeated", "required"));
        }
    }
    if schema.num_columns() > columns.len() {
        let (found, allowed) = (schema.num_columns().to_string(), columns.len().to_string());
        return Err(DatasetError::content(path, "the number of columns", found, allowed));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use granulcal_dem::Scene;

    use super::*;
    use crate::Prior;

    #[test]
    fn files_without_diagnostic_statistics_are_read() {
        let header = Header::new(&Scene::drop(0.1), &Prior::default(), 7).unwrap();
        let parameters = header.prior.parameters().len();
        let written = Row {
            statistics: [0.25; 16],
            diagnostics: [0.5; DIAGNOSTIC_COUNT],
            ..blank(parameters, 0)
        };
        let mut listed = columns(&header.prior.names(), &[]);
        listed.truncate(listed.len() - DIAGNOSTIC_COUNT);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("old.parquet");
        files::write_file(
            &path,
            &encode(&header, std::slice::from_ref(&written), &listed).unwrap(),
        )
        .unwrap();
        let (_, rows) = read(&path).unwrap();
        assert_eq!(rows[0].statistics, written.statistics);
        assert!(rows[0].diagnostics.iter().all(|value| value.is_nan()));
        // One column less is a column too few.
        listed.pop();
        files::write_file(&path, &encode(&header, &[written], &listed).unwrap()).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("chi_scale"));
    }
}
