//! NumPy arrays of any layout as rows of three numbers, columns and indices.
//!
//! Arrays of native, aligned `float32` and `float64` are read in place, whatever their strides. Other numbers are converted by
//! NumPy. `float64` is rounded to `float32` once, to nearest, after the origin is subtracted.

use std::borrow::Cow;

use numpy::ndarray::ArrayView2;
use numpy::{PyArrayDescrMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{filled, invalid, of_argument, reserved};

/// The origin that subtracts nothing.
pub(crate) const NO_ORIGIN: [f64; 3] = [0.0; 3];

/// An array of rows of three numbers, kept alive.
pub(crate) struct Table<'py> {
    array: Floats<'py>,
    /// Whether the argument is a row instead of an array of rows.
    pub(crate) is_one: bool,
}

enum Floats<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

/// Rows of three numbers, each less the origin.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    data: Data<'a>,
    origin: [f64; 3],
}

#[derive(Clone, Copy)]
enum Data<'a> {
    Packed(&'a [[f32; 3]]),
    F32(ArrayView2<'a, f32>),
    F64(ArrayView2<'a, f64>),
}

impl<'py> Table<'py> {
    /// The argument `name`, of shape (n, 3); of shape (3,) for one row where `allows_one`.
    pub(crate) fn new(argument: &Bound<'py, PyAny>, name: &str, allows_one: bool) -> PyResult<Self> {
        let array = as_array(argument, name)?;
        let shape = array.shape().to_vec();
        let n_rows = match shape[..] {
            [n, 3] => n,
            [0] => 0,
            [3] if allows_one => 1,
            _ => {
                let wanted = if allows_one { "(n, 3) or (3,)" } else { "(n, 3)" };
                return Err(invalid(format!("{name} has shape {}, not {wanted}", shown(&shape))));
            }
        };
        let array = as_floats(&array, name)?;
        let array = if shape.len() == 2 { array } else { array.call_method1("reshape", ((n_rows, 3),))? };
        let array = match array.extract() {
            Ok(array) => Floats::F32(array),
            Err(_) => Floats::F64(array.extract()?),
        };
        Ok(Self { array, is_one: shape == [3] })
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        match &self.array {
            Floats::F32(array) => array.shape()[0],
            Floats::F64(array) => array.shape()[0],
        }
    }

    /// Its rows less `origin`.
    pub(crate) fn rows(&self, origin: [f64; 3]) -> Rows<'_> {
        let data = match &self.array {
            // `as_slice` alone accepts column-major arrays, too.
            Floats::F32(array) => match array.as_slice() {
                Ok(numbers) if array.is_c_contiguous() => Data::Packed(numbers.as_chunks().0),
                _ => Data::F32(array.as_array()),
            },
            Floats::F64(array) => Data::F64(array.as_array()),
        };
        Rows { data, origin }
    }
}

impl<'a> Rows<'a> {
    pub(crate) fn len(&self) -> usize {
        match self.data {
            Data::Packed(rows) => rows.len(),
            Data::F32(array) => array.nrows(),
            Data::F64(array) => array.nrows(),
        }
    }

    /// A row, rounded to `f32`.
    #[inline]
    pub(crate) fn get(&self, i: usize) -> [f32; 3] {
        let exact = match self.data {
            Data::Packed(rows) if self.origin == NO_ORIGIN => return rows[i],
            Data::Packed(rows) => rows[i].map(f64::from),
            Data::F32(array) => std::array::from_fn(|k| f64::from(array[[i, k]])),
            Data::F64(array) => std::array::from_fn(|k| array[[i, k]]),
        };
        if self.origin == NO_ORIGIN {
            // Without a subtraction, which would make a negative zero positive.
            exact.map(|x| x as f32)
        } else {
            std::array::from_fn(|k| (exact[k] - self.origin[k]) as f32)
        }
    }

    /// All rows, without a copy where they are packed and there is no origin.
    pub(crate) fn all(&self) -> PyResult<Cow<'a, [[f32; 3]]>> {
        if let Data::Packed(rows) = self.data
            && self.origin == NO_ORIGIN
        {
            return Ok(Cow::Borrowed(rows));
        }
        let mut rows = reserved(self.len())?;
        rows.extend((0..self.len()).map(|i| self.get(i)));
        Ok(Cow::Owned(rows))
    }
}

/// One number for all rays, or one for each.
pub(crate) enum Column {
    One(f32),
    Each(Vec<f32>),
}

impl Column {
    /// The argument `name`: a number, or an array of shape (n,).
    pub(crate) fn new(argument: Option<&Bound<'_, PyAny>>, name: &str, n: usize, default: f32) -> PyResult<Self> {
        let Some(argument) = argument else { return Ok(Self::One(default)) };
        let array = as_array(argument, name)?;
        if array.ndim() == 0 {
            let number: f64 = as_floats(&array, name)?.extract()?;
            return Ok(Self::One(number as f32));
        }
        let shape = array.shape();
        if shape != [n] {
            return Err(invalid(format!("{name} has shape {}; it must be one number or ({n},)", shown(shape))));
        }
        let array = as_floats(&array, name)?;
        let mut values = filled(n, 0.0)?;
        if let Ok(array) = array.extract::<PyReadonlyArray1<'_, f32>>() {
            values.iter_mut().zip(array.as_array()).for_each(|(value, &x)| *value = x);
        } else {
            let array: PyReadonlyArray1<'_, f64> = array.extract()?;
            values.iter_mut().zip(array.as_array()).for_each(|(value, &x)| *value = x as f32);
        }
        Ok(Self::Each(values))
    }

    #[inline]
    pub(crate) fn get(&self, i: usize) -> f32 {
        match self {
            Self::One(number) => *number,
            Self::Each(numbers) => numbers[i],
        }
    }
}

/// The argument `origin`: three finite numbers, or `None`.
pub(crate) fn origin(argument: Option<&Bound<'_, PyAny>>) -> PyResult<Option<[f64; 3]>> {
    let Some(argument) = argument else { return Ok(None) };
    let array = as_array(argument, "origin")?;
    if array.shape() != [3] {
        return Err(invalid(format!("origin has shape {}, not (3,)", shown(array.shape()))));
    }
    let array = as_floats(&array, "origin")?;
    let origin: [f64; 3] = array.call_method0("tolist")?.extract()?;
    if origin.iter().all(|x| x.is_finite()) {
        Ok(Some(origin))
    } else {
        Err(invalid(format!("origin {origin:?} is not finite")))
    }
}

/// The argument `triangles`: (m, 3) vertex indices of any integer type.
pub(crate) fn triangles(argument: &Bound<'_, PyAny>, n_vertices: usize) -> PyResult<Vec<[u32; 3]>> {
    const NAME: &str = "triangles";
    let array = as_array(argument, NAME)?;
    let shape = array.shape();
    if shape == [0] || shape == [0, 3] {
        return Ok(vec![]);
    }
    if !matches!(shape, [_, 3]) {
        return Err(invalid(format!("{NAME} has shape {}, not (m, 3)", shown(shape))));
    }
    let kind = kind_of(&array)?;
    let wide = match kind {
        'i' => "int64",
        'u' => "uint64",
        _ => {
            let dtype = array.dtype();
            return Err(invalid(format!("{NAME} has dtype {dtype}; use an integer dtype, such as int32")));
        }
    };
    // Four bytes are read in place, other sizes as eight.
    let narrow = if kind == 'i' { "int32" } else { "uint32" };
    let array = require(&array, if array.dtype().itemsize() == 4 { narrow } else { wide }, NAME)?;
    if let Ok(array) = array.extract::<PyReadonlyArray2<'_, u32>>() {
        indices(array.as_array(), n_vertices)
    } else if let Ok(array) = array.extract::<PyReadonlyArray2<'_, i32>>() {
        indices(array.as_array(), n_vertices)
    } else if let Ok(array) = array.extract::<PyReadonlyArray2<'_, i64>>() {
        indices(array.as_array(), n_vertices)
    } else {
        let array: PyReadonlyArray2<'_, u64> = array.extract()?;
        indices(array.as_array(), n_vertices)
    }
}

/// Indices that are not negative and fit into 32 bits; a build compares them with the number of vertices.
fn indices<T: Copy + TryInto<u32> + Into<i128>>(
    array: ArrayView2<'_, T>,
    n_vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let mut triangles = reserved(array.nrows())?;
    for (t, row) in array.rows().into_iter().enumerate() {
        let mut triangle = [0; 3];
        for (index, &given) in triangle.iter_mut().zip(row) {
            *index = given.try_into().map_err(|_| {
                let given: i128 = given.into();
                let reason = match given {
                    ..0 => "indices start at 0".to_owned(),
                    _ => format!("but there are {n_vertices} vertices"),
                };
                invalid(format!("triangle {t} has vertex index {given}, {reason}"))
            })?;
        }
        triangles.push(triangle);
    }
    Ok(triangles)
}

/// The argument as a plain NumPy array of any type, without a copy where it is one.
pub(crate) fn as_array<'py>(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = argument.py();
    let array = py.import("numpy")?.call_method1("asarray", (argument,));
    Ok(array.map_err(|error| of_argument(py, name, error))?.cast_into()?)
}

/// The array as native `float32` or `float64`, without a copy where it is one of them.
fn as_floats<'py>(array: &Bound<'py, PyUntypedArray>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let is_empty = array.shape().contains(&0);
    match kind_of(array)? {
        'f' | 'i' | 'u' => {}
        _ if is_empty => {}
        _ => return Err(invalid(format!("{name} has dtype {}; use float32 or float64", array.dtype()))),
    }
    let is_f32 = kind_of(array)? == 'f' && array.dtype().itemsize() == 4;
    require(array, if is_f32 { "float32" } else { "float64" }, name)
}

/// The array with this type, in native byte order and aligned.
fn require<'py>(array: &Bound<'py, PyUntypedArray>, dtype: &str, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let py = array.py();
    let arguments = PyDict::new(py);
    arguments.set_item("dtype", dtype)?;
    arguments.set_item("requirements", "A")?;
    let converted = py.import("numpy")?.getattr("require")?.call((array,), Some(&arguments));
    converted.map_err(|error| of_argument(py, name, error))
}

fn kind_of(array: &Bound<'_, PyUntypedArray>) -> PyResult<char> {
    array.dtype().getattr("kind")?.extract()
}

/// A shape as Python writes it.
fn shown(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// A matrix of shape (4, 4), by rows.
pub(crate) fn matrix(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<[[f64; 4]; 4]> {
    let array = as_array(argument, name)?;
    if array.shape() != [4, 4] {
        return Err(invalid(format!("{name} has shape {}, not (4, 4)", shown(array.shape()))));
    }
    as_floats(&array, name)?.call_method0("tolist")?.extract()
}
