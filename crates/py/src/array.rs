//! NumPy arrays as slices and back; errors name the argument, what was found and what is allowed.

use bytemuck::cast_slice;
use granulcal_dem::ConvexGrains;
use nalgebra::Vector3;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
    dtype,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A borrowed array of vectors, shape (n, 3), float64.
pub(crate) struct Vectors<'py>(PyReadonlyArray2<'py, f64>);

impl<'py> Vectors<'py> {
    /// Borrows `value` without copying it.
    pub(crate) fn borrow(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = untyped::<f64>(name, value)?;
        if array.ndim() != 2 || array.shape()[1] != 3 {
            return Err(bad_shape(name, "(n, 3)", array));
        }
        Ok(Self(value.cast::<PyArray2<f64>>()?.try_readonly()?))
    }

    /// The vectors, one a row.
    pub(crate) fn as_slice(&self) -> PyResult<&[Vector3<f64>]> {
        Ok(cast_slice(self.0.as_slice()?))
    }
}

/// A borrowed array of numbers, shape (n,), float64.
pub(crate) struct Numbers<'py>(PyReadonlyArray1<'py, f64>);

impl<'py> Numbers<'py> {
    /// Borrows `value` without copying it.
    pub(crate) fn borrow(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = untyped::<f64>(name, value)?;
        if array.ndim() != 1 {
            return Err(bad_shape(name, "(n,)", array));
        }
        Ok(Self(value.cast::<PyArray1<f64>>()?.try_readonly()?))
    }

    /// The numbers.
    pub(crate) fn as_slice(&self) -> PyResult<&[f64]> {
        Ok(self.0.as_slice()?)
    }
}

/// A borrowed image, shape (h, w), float32.
pub(crate) struct Image<'py>(PyReadonlyArray2<'py, f32>);

impl<'py> Image<'py> {
    /// Borrows `value` without copying it.
    pub(crate) fn borrow(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = untyped::<f32>(name, value)?;
        if array.ndim() != 2 {
            return Err(bad_shape(name, "(h, w)", array));
        }
        Ok(Self(value.cast::<PyArray2<f32>>()?.try_readonly()?))
    }

    /// Width, height and the pixels row by row.
    pub(crate) fn parts(&self) -> PyResult<(usize, usize, &[f32])> {
        Ok((self.0.shape()[1], self.0.shape()[0], self.0.as_slice()?))
    }
}

/// Borrowed images, shape (k, h, w), float32.
pub(crate) struct Images<'py>(PyReadonlyArray3<'py, f32>);

impl<'py> Images<'py> {
    /// Borrows `value` without copying it.
    pub(crate) fn borrow(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = untyped::<f32>(name, value)?;
        if array.ndim() != 3 {
            return Err(bad_shape(name, "(k, h, w)", array));
        }
        Ok(Self(value.cast::<PyArray3<f32>>()?.try_readonly()?))
    }

    /// Rows, columns and the pixels, image by image.
    pub(crate) fn parts(&self) -> PyResult<(usize, usize, &[f32])> {
        Ok((self.0.shape()[1], self.0.shape()[2], self.0.as_slice()?))
    }
}

/// Rows of numbers, copied from an array of shape (n, columns), float64.
pub(crate) struct Rows(pub(crate) Vec<Vec<f64>>);

impl Rows {
    /// Copies the rows; `columns` are asked for if they are known.
    pub(crate) fn read(
        name: &str,
        value: &Bound<'_, PyAny>,
        columns: Option<usize>,
    ) -> PyResult<Self> {
        let array = untyped::<f64>(name, value)?;
        let shape = array.shape();
        if shape.len() != 2 || columns.is_some_and(|columns| shape[1] != columns) {
            let allowed =
                columns.map_or("(n, columns)".to_owned(), |columns| format!("(n, {columns})"));
            return Err(bad_shape(name, &allowed, array));
        }
        let (rows, columns) = (shape[0], shape[1]);
        let array = value.cast::<PyArray2<f64>>()?.try_readonly()?;
        let numbers = array.as_slice()?;
        Ok(Self((0..rows).map(|i| numbers[i * columns..(i + 1) * columns].to_vec()).collect()))
    }
}

/// Shape and numbers of an array of any shape, float64.
pub(crate) fn any_shape(name: &str, value: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let shape = untyped::<f64>(name, value)?.shape().to_vec();
    let array = value.cast::<PyArrayDyn<f64>>()?.try_readonly()?;
    Ok((shape, array.as_slice()?.to_vec()))
}

/// A contiguous array of the right dtype, of any shape.
fn untyped<'a, 'py, T: Element>(
    name: &str,
    value: &'a Bound<'py, PyAny>,
) -> PyResult<&'a Bound<'py, PyUntypedArray>> {
    let Ok(array) = value.cast::<PyUntypedArray>() else {
        let found = value.get_type().name()?;
        return Err(PyTypeError::new_err(format!("{name} must be a NumPy array, got {found}")));
    };
    let expected = dtype::<T>(value.py());
    if !array.dtype().is_equiv_to(&expected) {
        let message = format!("{name} must have dtype {expected}, got {}", array.dtype());
        return Err(PyTypeError::new_err(message));
    }
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("{name} must be C-contiguous")));
    }
    Ok(array)
}

fn bad_shape(name: &str, allowed: &str, array: &Bound<'_, PyUntypedArray>) -> PyErr {
    let found = array.shape().iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    PyValueError::new_err(format!("{name} must have shape {allowed}, got ({found})"))
}

/// A new array, shape (n, 3).
pub(crate) fn from_vectors<'py>(
    py: Python<'py>,
    vectors: &[Vector3<f64>],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, cast_slice::<_, f64>(vectors)).reshape([vectors.len(), 3])
}

/// Turns of grains that are not round, quaternions i, j, k, w, shape (n, 4); (0, 4) of others.
pub(crate) fn from_turns<'py>(
    py: Python<'py>,
    convex: Option<&ConvexGrains>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let turned = convex.map_or(&[][..], |convex| &convex.orientations);
    let numbers = turned.iter().flat_map(|turn| <[f64; 4]>::from(turn.coords)).collect();
    matrix(py, numbers, turned.len(), 4)
}

/// A new array, shape (rows, columns), from its values row by row.
pub(crate) fn matrix<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    rows: usize,
    columns: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    PyArray1::from_vec(py, values).reshape([rows, columns])
}
