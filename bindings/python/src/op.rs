//! Ops over arrays: the values, the gradient, and the gradient of that.

use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use softrast_raster::{
    TConorm,
    low_level::{ElementaryOp, FusedOp, Numbers, Pass, Silhouette, WeightTables},
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Shape, TensorData};

use crate::{
    guard::{guarded, refused},
    taped::Taped,
};

/// An array that came from Python, of any kind yet.
type Given<'py> = Bound<'py, PyAny>;

/// A differentiable function of arrays. All arrays of a call are C-contiguous and of one float type, float32 or float64; they
/// are borrowed, not copied.
#[pyclass(frozen, module = "softrast._native")]
#[derive(Clone)]
pub(crate) struct Op(Kind);

#[derive(Clone)]
enum Kind {
    /// Vertices `[views, 3, V]` and a table to sums `[views, height, width]`.
    Sum { op: Box<FusedOp>, rows: usize, least_vertices: usize, size: [usize; 2] },
    /// Vertices, attributes, tables, a background and maybe a texture to an image in colours.
    Blend(Box<Blend>),
    /// Orbits `[views, 4]` to matrices `[views, 3, 4]`.
    OrbitMatrix,
    /// Points `[1 or views, V, 3]` and matrices `[views, 3, 4]` to `[views, 3, V]`.
    Perspective,
    /// Sums to coverage of the same shape, under the probabilistic sum.
    Coverage,
    /// Images `[views, height, width]` and targets `[1 or views, height, width]` to losses `[views]`.
    Loss(ElementaryOp),
    /// φ `[P]` to a table `[rows, 4]`.
    Table { of: Taped, parameters: usize, rows: usize },
    /// Sums to coverage of the same shape, under any T-conorm.
    AnyCoverage(Taped),
}

#[derive(Clone)]
struct Blend {
    op: FusedOp,
    rows: usize,
    least_vertices: usize,
    least_entries: usize,
    size: [usize; 2],
    texture: Option<[usize; 2]>,
}

impl Op {
    pub(crate) fn sum(
        silhouette: &Silhouette<EdgeSoftness>,
        least_vertices: usize,
        size: [usize; 2],
    ) -> Self {
        let rows = silhouette.profile().knots();
        Self(Kind::Sum { op: Box::new(silhouette.op()), rows, least_vertices, size })
    }

    pub(crate) fn table(silhouette: &Silhouette<EdgeSoftness>, parameters: usize) -> Self {
        let rows = silhouette.profile().knots();
        Self(Kind::Table { of: Taped::Table(Box::new(silhouette.clone())), parameters, rows })
    }

    /// `least` are the numbers of vertices and of entries that faces ask for.
    pub(crate) fn blend(
        op: FusedOp,
        rows: usize,
        least: [usize; 2],
        size: [usize; 2],
        texture: Option<[usize; 2]>,
    ) -> Self {
        let [least_vertices, least_entries] = least;
        Self(Kind::Blend(Box::new(Blend {
            op,
            rows,
            least_vertices,
            least_entries,
            size,
            texture,
        })))
    }

    /// `split`: how many of the parameters are of the softness by edge.
    pub(crate) fn weight_tables(tables: WeightTables, split: usize, parameters: usize) -> Self {
        let rows = tables.rows();
        Self(Kind::Table { of: Taped::Weights(Box::new(tables), split), parameters, rows })
    }

    pub(crate) fn coverage(t_conorm: TConorm) -> Self {
        Self(match t_conorm {
            TConorm::Probabilistic => Kind::Coverage,
            other => Kind::AnyCoverage(Taped::Coverage(other)),
        })
    }
}

/// The op from orbits `[views, 4]` to matrices `[views, 3, 4]`.
#[pyfunction]
pub(crate) fn orbit_matrix() -> Op {
    Op(Kind::OrbitMatrix)
}

/// The op from points `[1 or views, V, 3]` and matrices `[views, 3, 4]` to `[views, 3, V]`: x and y in NDC, and depth.
#[pyfunction]
pub(crate) fn perspective() -> Op {
    Op(Kind::Perspective)
}

/// The op from images `[views, height, width]` and targets `[1 or views, height, width]` to mean squared differences `[views]`.
#[pyfunction]
pub(crate) fn mse_loss() -> Op {
    Op(Kind::Loss(ElementaryOp::SquaredError))
}

/// The op from images `[views, height, width]` and targets `[1 or views, height, width]` to one less the overlap over the union, `[views]`.
#[pyfunction]
pub(crate) fn iou_loss() -> Op {
    Op(Kind::Loss(ElementaryOp::Iou))
}

#[pymethods]
impl Op {
    /// The op of one call, whose passes share what they find out about the vertices.
    fn keeping(&self) -> Self {
        Self(match &self.0 {
            Kind::Sum { op, rows, least_vertices, size } => Kind::Sum {
                op: Box::new(op.keeping()),
                rows: *rows,
                least_vertices: *least_vertices,
                size: *size,
            },
            Kind::Blend(blend) => {
                Kind::Blend(Box::new(Blend { op: blend.op.keeping(), ..Blend::clone(blend) }))
            }
            other => other.clone(),
        })
    }

    /// The value.
    fn forward<'py>(&self, py: Python<'py>, inputs: Vec<Given<'py>>) -> PyResult<Given<'py>> {
        self.run(py, &Pass::Forward, &inputs, &[])
    }

    /// The gradients of `Σ upstream · value` to the inputs that are wanted, flat and one after the other.
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        inputs: Vec<Given<'py>>,
        upstream: Given<'py>,
        wanted: Vec<bool>,
    ) -> PyResult<Given<'py>> {
        let inputs: Vec<_> = inputs.into_iter().chain([upstream]).collect();
        self.run(py, &Pass::Vjp { wanted }, &inputs, &[])
    }

    /// The gradients of `Σ direction · vjp` to the inputs and the upstream, as they are wanted; a direction for each input that is `along`.
    fn vjp_of_vjp<'py>(
        &self,
        py: Python<'py>,
        inputs: Vec<Given<'py>>,
        upstream: Given<'py>,
        directions: Vec<Given<'py>>,
        along: Vec<bool>,
        wanted: Vec<bool>,
    ) -> PyResult<Given<'py>> {
        let inputs: Vec<_> = inputs.into_iter().chain([upstream]).collect();
        self.run(py, &Pass::VjpOfVjp { along, wanted }, &inputs, &directions)
    }
}

impl Op {
    fn run<'py>(
        &self,
        py: Python<'py>,
        pass: &Pass,
        inputs: &[Given<'py>],
        directions: &[Given<'py>],
    ) -> PyResult<Given<'py>> {
        let first = inputs.first().ok_or_else(|| refused("an op needs an array"))?;
        if first.cast::<PyArrayDyn<f32>>().is_ok() {
            self.run_in::<f32>(py, pass, inputs, directions)
        } else {
            self.run_in::<f64>(py, pass, inputs, directions)
        }
    }

    fn run_in<'py, F: Float>(
        &self,
        py: Python<'py>,
        pass: &Pass,
        inputs: &[Given<'py>],
        directions: &[Given<'py>],
    ) -> PyResult<Given<'py>> {
        let [inputs, directions] = [read::<F>(inputs)?, read::<F>(directions)?];
        let dims: Vec<_> = inputs.iter().map(|array| array.shape().to_vec()).collect();
        let mut slices = contiguous(&inputs)?;
        let directions = contiguous(&directions)?;
        let lengths: Vec<_> = directions.iter().map(|direction| direction.len()).collect();
        self.0.check(pass, &dims, &lengths).map_err(refused)?;
        let joined;
        match directions[..] {
            [] => {}
            [one] => slices.push(one),
            _ => {
                joined = directions.concat();
                slices.push(&joined);
            }
        }
        let data = guarded(py, || self.0.run(pass, &slices, &dims))?;
        let shape = data.shape.to_vec();
        let values = data.into_vec::<F>().map_err(|error| refused(format!("{error:?}")))?;
        Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any())
    }
}

/// float32 or float64.
trait Float: Numbers + Element {}
impl Float for f32 {}
impl Float for f64 {}

fn read<'py, F: Element>(arrays: &[Given<'py>]) -> PyResult<Vec<PyReadonlyArrayDyn<'py, F>>> {
    let wrong = || {
        refused(
            "the arrays of a call must be of one type, float32 or float64: convert them with astype",
        )
    };
    arrays.iter().map(|array| array.extract().map_err(|_| wrong())).collect()
}

fn contiguous<'a, F: Element>(arrays: &'a [PyReadonlyArrayDyn<'_, F>]) -> PyResult<Vec<&'a [F]>> {
    let slice = |array: &'a PyReadonlyArrayDyn<'_, F>| {
        array.as_slice().map_err(|_| refused("an array is not contiguous"))
    };
    arrays.iter().map(slice).collect()
}

impl Kind {
    fn inputs(&self) -> usize {
        match self {
            Self::Sum { .. } | Self::Perspective | Self::Loss(_) => 2,
            Self::Blend(blend) => 4 + usize::from(blend.texture.is_some()),
            _ => 1,
        }
    }

    /// The shape of the value, if the inputs fit.
    fn shape(&self, dims: &[Vec<usize>]) -> Option<Vec<usize>> {
        Some(match (self, dims) {
            (Self::Sum { rows, least_vertices, size, .. }, [vertices, table]) => {
                let &[views, 3, count] = &vertices[..] else { return None };
                let tables = table == &[*rows, 4] || table == &[views, *rows, 4];
                (views > 0 && count >= *least_vertices && tables)
                    .then(|| vec![views, size[0], size[1]])?
            }
            (Self::Blend(blend), [vertices, attributes, tables, background, texture @ ..]) => {
                let (&[views, 3, _], &[behind]) = (&vertices[..], &background[..]) else {
                    return None;
                };
                let fits = blend.fits([vertices, attributes, tables], behind, texture);
                (views > 0 && fits).then(|| vec![views, behind, blend.size[0], blend.size[1]])?
            }
            (Self::OrbitMatrix, [orbits]) => {
                let &[views @ 1..=usize::MAX, 4] = &orbits[..] else { return None };
                vec![views, 3, 4]
            }
            (Self::Perspective, [points, matrices]) => match (&points[..], &matrices[..]) {
                (&[held @ 1..=usize::MAX, count, 3], &[views @ 1..=usize::MAX, 3, 4])
                    if held == 1 || held == views =>
                {
                    vec![views, 3, count]
                }
                _ => return None,
            },
            (Self::Loss(_), [image, target]) => {
                let (&[views @ 1..=usize::MAX, ..], &[held, ..]) = (&image[..], &target[..]) else {
                    return None;
                };
                let fits = image.len() == 3 && target.get(1..) == image.get(1..);
                (fits && (held == 1 || held == views)).then(|| vec![views])?
            }
            (Self::Table { parameters, rows, .. }, [phi]) => {
                (phi == &[*parameters]).then(|| vec![*rows, 4])?
            }
            (Self::Coverage | Self::AnyCoverage(_), [sums]) => sums.clone(),
            _ => return None,
        })
    }

    /// Checks the shapes of a call.
    fn check(&self, pass: &Pass, dims: &[Vec<usize>], directions: &[usize]) -> Result<(), String> {
        let (inputs, upstream) = dims.split_at(self.inputs().min(dims.len()));
        let wrong = || format!("arrays of these shapes do not fit the op: {dims:?}");
        let shape = self.shape(inputs).ok_or_else(wrong)?;
        let length = |dims: &Vec<usize>| dims.iter().product::<usize>();
        let fits = match pass {
            Pass::Forward => upstream.is_empty(),
            Pass::Vjp { wanted } => upstream == [shape] && wanted.len() == inputs.len(),
            Pass::VjpOfVjp { along, wanted } => {
                let expected = inputs.iter().zip(along).filter(|&(_, &along)| along);
                upstream == [shape]
                    && along.len() == inputs.len()
                    && wanted.len() == inputs.len() + 1
                    && expected.map(|(dims, _)| length(dims)).eq(directions.iter().copied())
            }
        };
        if fits { Ok(()) } else { Err(wrong()) }
    }

    fn run<F: Float>(&self, pass: &Pass, slices: &[&[F]], dims: &[Vec<usize>]) -> TensorData {
        let of = |op| F::run_pass(&FusedOp::Elementary(op), pass, slices, dims);
        match self {
            Self::Sum { op, .. } => F::run_pass(op, pass, slices, dims),
            Self::Blend(blend) => F::run_pass(&blend.op, pass, slices, dims),
            Self::OrbitMatrix => of(ElementaryOp::OrbitMatrix),
            Self::Perspective => of(ElementaryOp::Perspective),
            Self::Coverage => of(ElementaryOp::Coverage),
            Self::Loss(loss) => of(*loss),
            Self::Table { of, .. } | Self::AnyCoverage(of) => {
                let shape = match pass {
                    Pass::Forward => self.shape(&dims[..1]),
                    _ => None,
                };
                taped(of, pass, slices, shape)
            }
        }
    }
}

impl Blend {
    /// Whether vertices `[views, 3, V]`, attributes, tables, the numbers of a background and what there is of a texture go together.
    fn fits(
        &self,
        [vertices, attributes, tables]: [&Vec<usize>; 3],
        behind: usize,
        texture: &[Vec<usize>],
    ) -> bool {
        let &[held, entries, numbers] = &attributes[..] else { return false };
        let shown = match (self.texture, texture) {
            (None, []) => behind > 1 && numbers == behind - 1,
            (Some([height, width]), [texels]) => {
                texels == &[height * width, 4] && numbers == 2 && (2..=5).contains(&behind)
            }
            _ => false,
        };
        shown
            && (held == 1 || held == vertices[0])
            && entries >= self.least_entries
            && vertices[2] >= self.least_vertices
            && tables == &[self.rows, 4]
    }
}

/// A pass of a function that is computed in f64, whatever type its arrays have.
fn taped<F: Float>(
    of: &Taped,
    pass: &Pass,
    slices: &[&[F]],
    shape: Option<Vec<usize>>,
) -> TensorData {
    let wide: Vec<Vec<f64>> =
        slices.iter().map(|slice| slice.iter().map(|x| x.elem()).collect()).collect();
    let values = match pass {
        Pass::Forward => of.forward(&wide[0]),
        Pass::Vjp { wanted } => {
            if wanted[0] {
                of.vjp(&wide[0], &wide[1])
            } else {
                Vec::new()
            }
        }
        // Along nothing, the gradient has no direction to change in.
        Pass::VjpOfVjp { along, wanted } => {
            let still = vec![0.0; wide[0].len()];
            let direction = if along[0] { &wide[2] } else { &still };
            let [to_x, to_upstream] = of.vjp_of_vjp(&wide[0], &wide[1], direction);
            let parts = [to_x, to_upstream].into_iter().zip(wanted);
            parts.filter(|&(_, &wanted)| wanted).flat_map(|(part, _)| part).collect()
        }
    };
    let shape = shape.unwrap_or_else(|| vec![values.len()]);
    TensorData::new(values, Shape::from(shape)).convert::<F>()
}
