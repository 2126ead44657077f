//! The arrays of a model by name, every shape checked.

use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors};

use crate::ModelError;
use crate::matrix::Matrix;

/// Arrays read from a file.
pub struct Tensors<'a> {
    arrays: SafeTensors<'a>,
    path: PathBuf,
}

impl<'a> Tensors<'a> {
    pub fn of(bytes: &'a [u8], path: &Path) -> Result<Self, ModelError> {
        let arrays = SafeTensors::deserialize(bytes).map_err(|error| ModelError::Tensors {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self { arrays, path: path.to_owned() })
    }

    /// The numbers of a tensor of this shape.
    pub fn take(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>, ModelError> {
        let shape: Vec<_> = shape.iter().map(|&n| Some(n)).collect();
        Ok(self.any(name, &shape)?.0)
    }

    /// A matrix of this shape, or `None` where there is no such tensor.
    pub fn matrix_if_there(
        &self,
        name: &str,
        rows: usize,
        columns: usize,
    ) -> Result<Option<Matrix>, ModelError> {
        if self.arrays.tensor(name).is_err() {
            return Ok(None);
        }
        self.matrix(name, rows, columns).map(Some)
    }

    /// A matrix of this shape.
    pub fn matrix(&self, name: &str, rows: usize, columns: usize) -> Result<Matrix, ModelError> {
        Ok(Matrix { data: self.take(name, &[rows, columns])?, columns })
    }

    /// A matrix with so many columns (and rows, where given).
    pub fn rows(
        &self,
        name: &str,
        rows: Option<usize>,
        columns: Option<usize>,
    ) -> Result<Matrix, ModelError> {
        let (data, shape) = self.any(name, &[rows, columns])?;
        Ok(Matrix { data, columns: shape[1] })
    }

    /// A tensor that is there and cannot be used.
    pub fn unfit(&self, name: &str, allowed: &str, found: &str) -> ModelError {
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
        let tensor = self
            .arrays
            .tensor(name)
            .map_err(|_| wrong("there".to_owned(), "no such tensor".to_owned()))?;
        let found = tensor.shape().to_vec();
        let fits = found.len() == shape.len()
            && found.iter().zip(shape).all(|(&have, want)| want.is_none_or(|want| want == have));
        if !fits {
            let wanted: Vec<_> =
                shape.iter().map(|n| n.map_or("any".to_owned(), |n| n.to_string())).collect();
            let allowed = format!("of shape ({})", wanted.join(", "));
            return Err(wrong(allowed, format!("{found:?}")));
        }
        let bytes = tensor.data();
        let numbers: Vec<f64> = match tensor.dtype() {
            Dtype::F64 => {
                bytes.as_chunks::<8>().0.iter().map(|&word| f64::from_le_bytes(word)).collect()
            }
            Dtype::F32 => bytes
                .as_chunks::<4>()
                .0
                .iter()
                .map(|&word| f64::from(f32::from_le_bytes(word)))
                .collect(),
            Dtype::U8 => bytes.iter().map(|&byte| f64::from(byte)).collect(),
            other => {
                return Err(wrong("of type F64, F32 or U8".to_owned(), format!("{other:?}")));
            }
        };
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(wrong("finite".to_owned(), "NaN or infinity".to_owned()));
        }
        Ok((numbers, found))
    }
}
