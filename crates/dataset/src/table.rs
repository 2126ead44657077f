//! Rows to Parquet and back.
//!
//! The columns are listed once, in `columns.rs`; writing, reading and checking walk that list. What a file says beside
//! its rows is in `metadata.rs`.

mod columns;
mod metadata;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use granulcal_dem::Health;
use granulcal_features::stats::DIAGNOSTIC_COUNT;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use xxhash_rust::xxh3::Xxh3;

use crate::contained::contained;
use crate::files::PendingFile;
use crate::header::{FIRST_ARITHMETIC, Header};
use crate::row::{Row, RowStatus};
use crate::{DatasetError, Form, files};
use columns::{Access, Column, columns};
use metadata::Metadata;

/// Rows of a group of a file of several.
const GROUP: usize = if cfg!(test) { 4 } else { 16_384 };
/// Bytes that one byte of a packed column may become: a column of one value packs well.
const MOST_PACKED: i64 = 4096;

/// Writes rows as one complete file, one row group.
///
/// # Errors
/// [`DatasetError::Io`].
pub(crate) fn write(path: &Path, header: &Header, rows: &[Row]) -> Result<(), DatasetError> {
    let bytes = encode(header, rows, &columns(&header.prior.names(), &header.observed()))
        .map_err(unwritten(path))?;
    files::write_file(path, Form::Parquet, &bytes)
}

/// As versions wrote that told no units.
#[cfg(test)]
pub(crate) fn write_without_units(path: &Path, header: &Header, rows: &[Row]) {
    let mut columns = columns(&header.prior.names(), &header.observed());
    for column in &mut columns {
        column.unit = None;
    }
    files::write_file(path, Form::Parquet, &encode(header, rows, &columns).unwrap()).unwrap();
}

/// A file of rows.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) header: Header,
    pub(crate) rows: Vec<Row>,
    /// Whether the file says what its rows hash to; files of before there was a hash do not.
    pub(crate) is_verified: bool,
    /// The rows that the data set was asked to have, if the file says.
    pub(crate) asked: Option<u64>,
}

/// Hash of the header and of every value, column by column.
fn hash(header: &Header, rows: &[Row], columns: &[Column]) -> String {
    let mut hash = Xxh3::new();
    // Each text with its length: what is moved from one to the next is another text.
    let mut take = |bytes: &[u8]| {
        hash.update(&(bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    for text in [&header.scene_toml, &header.prior_toml, &header.version] {
        take(text.as_bytes());
    }
    take(&header.seed.to_le_bytes());
    // Files of before laws had numbers keep their hash.
    if let Some(law) = header.law {
        take(&law.to_le_bytes());
    }
    // And so do files of before there was another arithmetic than the first.
    if header.arithmetic != FIRST_ARITHMETIC {
        take(&header.arithmetic.to_le_bytes());
    }
    take(&(rows.len() as u64).to_le_bytes());
    for column in columns {
        take(column.name.as_bytes());
        for row in rows {
            match &column.access {
                Access::Count { get, .. } => take(&get(row).to_le_bytes()),
                // Every NaN is one NaN.
                Access::Number { get, .. } => {
                    let value = get(row);
                    let value = if value.is_nan() { f64::NAN } else { value };
                    take(&value.to_bits().to_le_bytes());
                }
                Access::Status => take(row.status.name().as_bytes()),
            }
        }
    }
    format!("{:032x}", hash.digest128())
}

fn encode(header: &Header, rows: &[Row], columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let mut bytes = Vec::new();
    let hash = hash(header, rows, columns);
    let mut file = writer(&mut bytes, header, Some(hash), columns)?;
    write_group(&mut file, rows, columns)?;
    file.close()?;
    Ok(bytes)
}

/// A writer of files with this header.
fn writer<W: io::Write + Send>(
    out: W,
    header: &Header,
    hash: Option<String>,
    columns: &[Column],
) -> Result<SerializedFileWriter<W>, ParquetError> {
    let fields = columns.iter().map(|c| c.schema().map(Arc::new)).collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("granulcal").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(format!("granulcal {}", header.version))
        .set_key_value_metadata(Some(metadata::entries(header, columns, hash)?))
        .build();
    SerializedFileWriter::new(out, schema, Arc::new(properties))
}

fn write_group<W: io::Write + Send>(
    file: &mut SerializedFileWriter<W>,
    rows: &[Row],
    columns: &[Column],
) -> Result<(), ParquetError> {
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
    Ok(())
}

/// What a writer says: the disk's words, where it is the disk that refused.
fn unwritten(path: &Path) -> impl FnOnce(ParquetError) -> DatasetError {
    let path = path.to_owned();
    move |error| {
        let source = match error {
            ParquetError::External(cause) => {
                cause.downcast().map_or_else(io::Error::other, |cause| *cause)
            }
            other => io::Error::other(other),
        };
        DatasetError::Io { action: "write", path, source }
    }
}

/// A file that takes rows as they come and keeps some thousand of them in memory: row group after row group.
pub(crate) struct GroupWriter {
    file: SerializedFileWriter<PendingFile>,
    header: Header,
    columns: Vec<Column>,
    rows: Vec<Row>,
    hashes: Vec<String>,
    path: PathBuf,
}

impl GroupWriter {
    /// Begins the file, beside its place.
    pub(crate) fn create(path: &Path, header: &Header) -> Result<Self, DatasetError> {
        let columns = columns(&header.prior.names(), &header.observed());
        let pending = PendingFile::create(path, Form::Parquet)?;
        let file = writer(pending, header, None, &columns).map_err(unwritten(path))?;
        let (header, path) = (header.clone(), path.to_owned());
        Ok(Self { file, header, columns, rows: Vec::new(), hashes: Vec::new(), path })
    }

    /// Takes a row, the next after those that it has.
    pub(crate) fn push(&mut self, row: Row) -> Result<(), DatasetError> {
        self.rows.push(row);
        if self.rows.len() < GROUP { Ok(()) } else { self.end_group() }
    }

    fn end_group(&mut self) -> Result<(), DatasetError> {
        self.hashes.push(hash(&self.header, &self.rows, &self.columns));
        write_group(&mut self.file, &self.rows, &self.columns).map_err(unwritten(&self.path))?;
        self.rows.clear();
        Ok(())
    }

    /// Ends the file, which says how many rows were asked for if that is known, and brings it to its place.
    pub(crate) fn commit(mut self, asked: Option<u64>) -> Result<(), DatasetError> {
        if !self.rows.is_empty() || self.hashes.is_empty() {
            self.end_group()?;
        }
        for entry in metadata::last_entries(&self.hashes, asked) {
            self.file.append_key_value_metadata(entry);
        }
        self.file.into_inner().map_err(unwritten(&self.path))?.commit()
    }
}

/// Reads a whole file, every page of it.
///
/// # Errors
/// [`DatasetError::Parquet`] for a truncated or damaged file, [`DatasetError::Damaged`] for one whose numbers are not
/// those that were written, [`DatasetError::Content`] for a Parquet file that is no data set of granulcal.
pub(crate) fn read(path: &Path) -> Result<Table, DatasetError> {
    parse(path, files::read(path)?)
}

/// As [`read`], of the bytes of a file; `path` names it in errors.
pub(crate) fn parse(path: &Path, bytes: Vec<u8>) -> Result<Table, DatasetError> {
    let length = bytes.len();
    let parquet = |source| DatasetError::Parquet { path: path.to_owned(), source };
    let file = contained(|| SerializedFileReader::new(bytes::Bytes::from(bytes)))
        .unwrap_or_else(|| Err(ParquetError::General("the metadata cannot be read".to_owned())))
        .map_err(parquet)?;
    check_ranges(path, &file, length)?;
    let metadata = Metadata::of(path, &file);
    let (header, asked) = (metadata.header()?, metadata.asked()?);
    let observed = header.observed();
    let mut columns = columns(&header.prior.names(), &observed);
    // Files without the diagnostic statistics end before them; they stay NaN.
    let found = file.metadata().file_metadata().schema_descr().num_columns();
    if observed.is_empty() && found + DIAGNOSTIC_COUNT == columns.len() {
        columns.truncate(found);
    }
    check_columns(path, &file, &columns)?;

    let count = usize::try_from(file.metadata().file_metadata().num_rows()).unwrap_or(0);
    let in_groups: i64 = file.metadata().row_groups().iter().map(RowGroupMetaData::num_rows).sum();
    // A row has an index of its own, which takes a byte at the very least.
    if count > length || in_groups != count as i64 {
        let found = format!("{count}, and {in_groups} in its groups");
        let allowed = "the same twice, and less than the bytes of the file";
        return Err(DatasetError::content(path, "the number of rows", found, allowed));
    }
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
    let stated = metadata.hashes();
    if let Some(stated) = stated {
        let groups = file.metadata().row_groups();
        let mut rest = &rows[..];
        let mut found = Vec::new();
        for group in groups {
            let count = usize::try_from(group.num_rows()).unwrap_or(usize::MAX);
            // What is no number of rows hashes to nothing.
            let Some((rows, after)) = rest.split_at_checked(count) else { break };
            rest = after;
            found.push(hash(&header, rows, &columns));
        }
        let found = found.join(" ");
        if stated != found {
            let (path, stated) = (path.to_owned(), stated.to_owned());
            return Err(DatasetError::Damaged { path, what: "the rows", found, stated });
        }
    }
    Ok(Table { header, rows, is_verified: stated.is_some(), asked })
}

/// A row that says nothing.
pub(crate) fn blank(parameters: usize, observed: usize) -> Row {
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

/// The values of a column. What the reader itself stumbles over in a damaged file is an error like any other.
fn read_column<T: parquet::data_type::DataType>(
    file: &SerializedFileReader<bytes::Bytes>,
    index: usize,
) -> Result<Vec<T::T>, ParquetError> {
    contained(|| read_values::<T>(file, index))
        .unwrap_or_else(|| Err(ParquetError::General(format!("column {index} cannot be unpacked"))))
}

fn read_values<T: parquet::data_type::DataType>(
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

/// Refuses columns that lie outside of the file: the reader takes their places for granted, and panics.
fn check_ranges(
    path: &Path,
    file: &SerializedFileReader<bytes::Bytes>,
    length: usize,
) -> Result<(), DatasetError> {
    let length = i64::try_from(length).unwrap_or(i64::MAX);
    for column in file.metadata().row_groups().iter().flat_map(RowGroupMetaData::columns) {
        let first = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
        let sizes = [first, column.data_page_offset(), column.compressed_size()];
        let is_inside = sizes.iter().all(|&size| (0..=length).contains(&size))
            && first.checked_add(column.compressed_size()).is_some_and(|end| end <= length)
            && (0..=length.saturating_mul(MOST_PACKED)).contains(&column.uncompressed_size())
            && column.num_values() >= 0;
        if !is_inside {
            let what = format!("the place of column {}", column.column_path());
            let found = format!("{} bytes at {first}", column.compressed_size());
            return Err(DatasetError::content(path, what, found, format!("within {length} bytes")));
        }
    }
    Ok(())
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
    use granulcal_scene::Scene;

    use super::*;
    use granulcal_scene::Prior;

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
            Form::Parquet,
            &encode(&header, std::slice::from_ref(&written), &listed).unwrap(),
        )
        .unwrap();
        let Table { rows, .. } = read(&path).unwrap();
        assert_eq!(rows[0].statistics, written.statistics);
        assert!(rows[0].diagnostics.iter().all(|value| value.is_nan()));
        // One column less is a column too few.
        listed.pop();
        files::write_file(&path, Form::Parquet, &encode(&header, &[written], &listed).unwrap())
            .unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("chi_scale"));
    }
}
