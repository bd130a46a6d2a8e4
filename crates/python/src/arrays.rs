//! NumPy arrays of any layout as rows of three numbers, columns and indices.
//!
//! Arrays of native, aligned `float32` and `float64` are read in place, whatever their strides. Other numbers are converted by
//! NumPy. `float64` is rounded to `float32` once, to nearest, after the origin is subtracted.
//!
//! Other threads may write into arrays while the global lock is released. What a build checks and uses is copied before; a ray or a point of a
//! query is read once, so writing changes the answer of that row at most.

use numpy::ndarray::ArrayView2;
use numpy::{
    Element, PyArray1, PyArrayDescrMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::error::{filled, invalid, of_argument, reserved};

/// The origin that subtracts nothing.
pub(crate) const NO_ORIGIN: [f64; 3] = [0.0; 3];

/// An array of rows of three numbers, kept alive.
pub(crate) struct Table<'py> {
    array: Floats<'py>,
    /// The shape of the argument without its last axis; (1,) for a row.
    pub(crate) shape: Vec<usize>,
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
    /// The argument `name`, of shape (n, 3).
    pub(crate) fn new(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        let array = as_array(argument, name)?;
        let shape = match *array.shape() {
            [n, 3] => vec![n],
            [0] => vec![0],
            _ => return Err(invalid(format!("{name} has shape {}, not (n, 3)", shown(array.shape())))),
        };
        Self::of(&array, name, shape, false)
    }

    /// The argument `name`, of shape (..., 3), that of a row included.
    pub(crate) fn of_any_shape(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        Self::of_rows(argument, name, &[3], "(n, 3) or (3,) or (..., 3)")
    }

    /// The argument `name`, of shape (..., 4, 3), as rows: four for each item.
    pub(crate) fn of_faces(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        Self::of_rows(argument, name, &[4, 3], "(..., 4, 3)")
    }

    /// The argument `name`, of shape (..., k, 3), as rows: `k` for each item; and `k`.
    pub(crate) fn of_groups(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<(Self, usize)> {
        let k = match as_array(argument, name)?.shape() {
            [.., k, 3] => *k,
            shape => return Err(invalid(format!("{name} has shape {}, not (..., k, 3)", shown(shape)))),
        };
        Ok((Self::of_rows(argument, name, &[k, 3], "(..., k, 3)")?, k))
    }

    fn of_rows(argument: &Bound<'py, PyAny>, name: &str, last: &[usize], wanted: &str) -> PyResult<Self> {
        let array = as_array(argument, name)?;
        let is_one = array.shape() == last;
        let shape = match array.shape().strip_suffix(last) {
            Some([]) => vec![1],
            Some(shape) => shape.to_vec(),
            None if array.shape() == [0] => vec![0],
            None => return Err(invalid(format!("{name} has shape {}, not {wanted}", shown(array.shape())))),
        };
        Self::of(&array, name, shape, is_one)
    }

    fn of(array: &Bound<'py, PyUntypedArray>, name: &str, shape: Vec<usize>, is_one: bool) -> PyResult<Self> {
        let floats = as_floats(array, name)?;
        let n_rows = array.len() / 3;
        let floats =
            if array.shape() == [n_rows, 3] { floats } else { floats.call_method1("reshape", ((n_rows, 3),))? };
        let array = match floats.extract() {
            Ok(array) => Floats::F32(array),
            Err(_) => Floats::F64(floats.extract()?),
        };
        Ok(Self { array, shape, is_one })
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        match &self.array {
            Floats::F32(array) => array.shape()[0],
            Floats::F64(array) => array.shape()[0],
        }
    }

    /// Whether its numbers are `float32`, so that nothing is rounded without an origin.
    pub(crate) fn is_f32(&self) -> bool {
        matches!(self.array, Floats::F32(_))
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

impl Rows<'_> {
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
        match self.data {
            Data::Packed(rows) if self.origin == NO_ORIGIN => rows[i],
            _ => self.exact(i).map(|x| x as f32),
        }
    }

    /// A row.
    #[inline]
    pub(crate) fn exact(&self, i: usize) -> [f64; 3] {
        let given = match self.data {
            Data::Packed(rows) => rows[i].map(f64::from),
            Data::F32(array) => std::array::from_fn(|k| f64::from(array[[i, k]])),
            Data::F64(array) => std::array::from_fn(|k| array[[i, k]]),
        };
        if self.origin == NO_ORIGIN {
            // Without a subtraction, which would make a negative zero positive.
            given
        } else {
            std::array::from_fn(|k| given[k] - self.origin[k])
        }
    }

    /// A copy of all rows, rounded to `f32`.
    pub(crate) fn all(&self) -> PyResult<Vec<[f32; 3]>> {
        let mut rows = reserved(self.len())?;
        rows.extend((0..self.len()).map(|i| self.get(i)));
        Ok(rows)
    }

    /// A copy of all rows.
    pub(crate) fn all_exact(&self) -> PyResult<Vec<[f64; 3]>> {
        let mut rows = reserved(self.len())?;
        rows.extend((0..self.len()).map(|i| self.exact(i)));
        Ok(rows)
    }
}

/// The numbers as an array of this shape, with the axes of `inner` last.
pub(crate) fn shaped<T: Element>(
    py: Python<'_>,
    numbers: Vec<T>,
    shape: &[usize],
    inner: &[usize],
) -> PyResult<Py<PyAny>> {
    let array = PyArray1::from_vec(py, numbers);
    if shape.len() == 1 && inner.is_empty() {
        return Ok(array.into_any().unbind());
    }
    let shape = PyTuple::new(py, [shape, inner].concat())?;
    Ok(array.call_method1("reshape", (shape,))?.unbind())
}

/// One number for all rays, or one for each.
pub(crate) enum Column {
    One(f64),
    Each(Vec<f64>),
}

impl Column {
    /// The argument `name`: a number, or an array of this shape.
    pub(crate) fn new(
        argument: Option<&Bound<'_, PyAny>>,
        name: &str,
        shape: &[usize],
        default: f64,
    ) -> PyResult<Self> {
        let Some(argument) = argument else { return Ok(Self::One(default)) };
        let array = as_array(argument, name)?;
        if array.ndim() == 0 {
            return Ok(Self::One(as_floats(&array, name)?.extract()?));
        }
        if array.shape() != shape {
            let given = shown(array.shape());
            return Err(invalid(format!("{name} has shape {given}; it must be one number or {}", shown(shape))));
        }
        let floats = as_floats(&array, name)?.call_method1("reshape", (array.len(),))?;
        let mut values = filled(array.len(), 0.0)?;
        if let Ok(array) = floats.extract::<PyReadonlyArray1<'_, f32>>() {
            values.iter_mut().zip(array.as_array()).for_each(|(value, &x)| *value = f64::from(x));
        } else {
            let array: PyReadonlyArray1<'_, f64> = floats.extract()?;
            values.iter_mut().zip(array.as_array()).for_each(|(value, &x)| *value = x);
        }
        Ok(Self::Each(values))
    }

    #[inline]
    pub(crate) fn get(&self, i: usize) -> f64 {
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

/// The argument as a plain NumPy array of any type, without a copy where it is one, or shares its memory by DLPack.
pub(crate) fn as_array<'py>(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = argument.py();
    let array = if argument.hasattr("__dlpack__")? || argument.hasattr("numpy")? {
        py.import("canted.mesh")?.call_method1("array_of", (argument,))
    } else {
        py.import("numpy")?.call_method1("asarray", (argument,))
    };
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
pub(crate) fn shown(shape: &[usize]) -> String {
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
