//! The arrays of a model by name, every shape checked.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::ModelError;
use crate::matrix::Matrix;

/// Numbers row by row, and the shape that they have.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// As many as the product of the shape.
    pub numbers: Vec<f64>,
}

/// Where arrays are.
enum Source<'a> {
    File(SafeTensors<'a>),
    Memory(HashMap<String, Array>),
}

/// The arrays of a model, from a file or from memory.
pub struct Tensors<'a> {
    source: Source<'a>,
    path: PathBuf,
}

// Derived, it would print every number.
impl fmt::Debug for Tensors<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tensors").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Tensors<'static> {
    /// Arrays that are in memory; `name` is theirs in messages.
    pub fn in_memory(arrays: HashMap<String, Array>, name: &str) -> Self {
        Self { source: Source::Memory(arrays), path: PathBuf::from(name) }
    }
}

impl<'a> Tensors<'a> {
    pub(crate) fn of(bytes: &'a [u8], path: &Path) -> Result<Self, ModelError> {
        let arrays = SafeTensors::deserialize(bytes).map_err(|error| ModelError::Tensors {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self { source: Source::File(arrays), path: path.to_owned() })
    }

    /// The numbers of a tensor of this shape.
    pub(crate) fn take(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>, ModelError> {
        let shape: Vec<_> = shape.iter().map(|&n| Some(n)).collect();
        Ok(self.any(name, &shape)?.0)
    }

    /// A matrix of this shape, or `None` where there is no such tensor.
    pub(crate) fn matrix_if_there(
        &self,
        name: &str,
        rows: usize,
        columns: usize,
    ) -> Result<Option<Matrix>, ModelError> {
        let is_there = match &self.source {
            Source::File(file) => file.tensor(name).is_ok(),
            Source::Memory(arrays) => arrays.contains_key(name),
        };
        if !is_there {
            return Ok(None);
        }
        self.matrix(name, rows, columns).map(Some)
    }

    /// A matrix of this shape.
    pub(crate) fn matrix(
        &self,
        name: &str,
        rows: usize,
        columns: usize,
    ) -> Result<Matrix, ModelError> {
        Ok(Matrix { data: self.take(name, &[rows, columns])?, columns })
    }

    /// A matrix with so many columns (and rows, where given).
    pub(crate) fn rows(
        &self,
        name: &str,
        rows: Option<usize>,
        columns: Option<usize>,
    ) -> Result<Matrix, ModelError> {
        let (data, shape) = self.any(name, &[rows, columns])?;
        Ok(Matrix { data, columns: shape[1] })
    }

    /// A tensor that is there and cannot be used.
    pub(crate) fn unfit(&self, name: &str, allowed: &str, found: &str) -> ModelError {
        ModelError::Content {
            path: self.path.clone(),
            what: name.to_owned(),
            allowed: allowed.to_owned(),
            found: found.to_owned(),
        }
    }

    fn any(
        &self,
        name: &str,
        shape: &[Option<usize>],
    ) -> Result<(Vec<f64>, Vec<usize>), ModelError> {
        let wrong = |allowed: String, found: String| ModelError::Content {
            path: self.path.clone(),
            what: name.to_owned(),
            allowed,
            found,
        };
        let missing = || wrong("there".to_owned(), "no such tensor".to_owned());
        let (numbers, found) = match &self.source {
            Source::File(file) => {
                let tensor = file.tensor(name).map_err(|_| missing())?;
                let other =
                    |dtype: Dtype| wrong("of type F64, F32 or U8".to_owned(), format!("{dtype:?}"));
                // The shape is asked first: the numbers may be many.
                fitting(tensor.shape(), shape, &wrong)?;
                (numbers(&tensor).map_err(other)?, tensor.shape().to_vec())
            }
            Source::Memory(arrays) => {
                let array = arrays.get(name).ok_or_else(missing)?;
                fitting(&array.shape, shape, &wrong)?;
                (array.numbers.clone(), array.shape.clone())
            }
        };
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(wrong("finite".to_owned(), "NaN or infinity".to_owned()));
        }
        Ok((numbers, found))
    }
}

/// Refuses a shape that is not the wanted one.
fn fitting(
    found: &[usize],
    wanted: &[Option<usize>],
    wrong: &dyn Fn(String, String) -> ModelError,
) -> Result<(), ModelError> {
    let fits = found.len() == wanted.len()
        && found.iter().zip(wanted).all(|(&have, want)| want.is_none_or(|want| want == have));
    if fits {
        return Ok(());
    }
    let wanted: Vec<_> =
        wanted.iter().map(|n| n.map_or("any".to_owned(), |n| n.to_string())).collect();
    Err(wrong(format!("of shape ({})", wanted.join(", ")), format!("{found:?}")))
}

/// The numbers of a file's tensor, or its type where that is another.
fn numbers(tensor: &TensorView<'_>) -> Result<Vec<f64>, Dtype> {
    let bytes = tensor.data();
    match tensor.dtype() {
        Dtype::F64 => Ok(bytes.as_chunks::<8>().0.iter().map(|&w| f64::from_le_bytes(w)).collect()),
        Dtype::F32 => {
            let words = bytes.as_chunks::<4>().0.iter();
            Ok(words.map(|&word| f64::from(f32::from_le_bytes(word))).collect())
        }
        Dtype::U8 => Ok(bytes.iter().map(|&byte| f64::from(byte)).collect()),
        other => Err(other),
    }
}
