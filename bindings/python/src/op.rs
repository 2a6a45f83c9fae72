//! Ops over arrays: the values, the gradient, and the gradient of that.

use std::{borrow::Cow, sync::Arc};

use softrast_raster::{
    TConorm,
    low_level::{ElementaryOp, FusedOp, Pass, Silhouette},
};
use softrast_softness::EdgeSoftness;

use crate::{
    guard::caught,
    store::{Store, View},
    taped::Taped,
};

/// A differentiable function of arrays of one float type.
#[derive(Clone)]
pub(crate) struct Op(Arc<Kind>);

#[derive(Clone)]
enum Kind {
    /// Vertices `[views, 3, V]` and a table to sums `[views, height, width]`.
    Sum(Drawn),
    /// Vertices `[views, 3, V]`, a table and targets `[1 or views, height, width]` to losses `[views]`.
    Loss(Drawn),
    /// Vertices, attributes, tables, a background and maybe a texture to an image in colours.
    Blend(Box<Blend>),
    /// An op that needs no renderer.
    Elementary(ElementaryOp),
    /// Sums to coverage of the same shape, under any T-conorm.
    AnyCoverage(Taped),
}

#[derive(Clone)]
struct Drawn {
    op: Box<FusedOp>,
    rows: usize,
    least_vertices: usize,
    size: [usize; 2],
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

/// Gradients to the arrays that they are wanted for.
pub(crate) type Gradients<S> = Vec<Option<<S as Store>::Owned>>;

impl Op {
    pub(crate) fn sum(
        silhouette: &Silhouette<EdgeSoftness>,
        least_vertices: usize,
        size: [usize; 2],
    ) -> Self {
        let (op, rows) = (Box::new(silhouette.op()), silhouette.profile().knots());
        Self(Arc::new(Kind::Sum(Drawn { op, rows, least_vertices, size })))
    }

    /// The loss of silhouettes, whose table has so many `rows`.
    pub(crate) fn loss(op: FusedOp, rows: usize, least_vertices: usize, size: [usize; 2]) -> Self {
        Self(Arc::new(Kind::Loss(Drawn { op: Box::new(op), rows, least_vertices, size })))
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
        let blend = Blend { op, rows, least_vertices, least_entries, size, texture };
        Self(Arc::new(Kind::Blend(Box::new(blend))))
    }

    pub(crate) fn coverage(t_conorm: TConorm) -> Self {
        Self(Arc::new(match t_conorm {
            TConorm::Probabilistic => Kind::Elementary(ElementaryOp::Coverage),
            other => Kind::AnyCoverage(Taped::Coverage(other)),
        }))
    }

    pub(crate) fn elementary(op: ElementaryOp) -> Self {
        Self(Arc::new(Kind::Elementary(op)))
    }

    /// Whether both are one and the same.
    pub(crate) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// The op of one call, whose passes share what they find out about the vertices.
    pub(crate) fn keeping(&self) -> Self {
        let mut kind = Kind::clone(&self.0);
        match &mut kind {
            Kind::Sum(of) | Kind::Loss(of) => *of.op = of.op.keeping(),
            Kind::Blend(blend) => blend.op = blend.op.keeping(),
            _ => {}
        }
        Self(Arc::new(kind))
    }

    /// The shape of the value.
    pub(crate) fn shape(&self, inputs: &[Vec<usize>]) -> Result<Vec<usize>, String> {
        self.0.shape(inputs).ok_or_else(|| misfit(inputs))
    }

    /// The value.
    pub(crate) fn forward<S: Store>(&self, inputs: &[View<'_, S>]) -> Result<S::Owned, String> {
        self.run::<S>(&Pass::Forward, inputs, &[])
    }

    /// The gradients of `Σ upstream · value` to the inputs that are wanted.
    pub(crate) fn vjp<S: Store>(
        &self,
        inputs: &[View<'_, S>],
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Gradients<S>, String> {
        let every = [inputs, std::slice::from_ref(upstream)].concat();
        let found = self.run(&Pass::Vjp { wanted: wanted.to_vec() }, &every, &[])?;
        Ok(spread::<S>(found, inputs, wanted))
    }

    /// The gradients of `Σ direction · vjp` to the inputs and the upstream, as they are wanted.
    pub(crate) fn vjp_of_vjp<S: Store>(
        &self,
        inputs: &[View<'_, S>],
        upstream: &View<'_, S>,
        directions: &[Option<&S::Slice>],
        wanted: &[bool],
    ) -> Result<Gradients<S>, String> {
        let every = [inputs, std::slice::from_ref(upstream)].concat();
        let along: Vec<_> = directions.iter().map(Option::is_some).collect();
        if !along.contains(&true) {
            let still = |(view, &wanted): (&View<'_, S>, &bool)| {
                wanted.then(|| S::filled(0.0, S::count(view.values), view.values))
            };
            return Ok(every.iter().zip(wanted).map(still).collect());
        }
        let given: Vec<_> = directions.iter().copied().flatten().collect();
        let pass = Pass::VjpOfVjp { along, wanted: wanted.to_vec() };
        let found = self.run(&pass, &every, &given)?;
        Ok(spread::<S>(found, &every, wanted))
    }

    fn run<S: Store>(
        &self,
        pass: &Pass,
        views: &[View<'_, S>],
        directions: &[&S::Slice],
    ) -> Result<S::Owned, String> {
        let dims: Vec<_> = views.iter().map(|view| view.dims.clone()).collect();
        let lengths: Vec<_> = directions.iter().map(|direction| S::count(direction)).collect();
        self.0.check(pass, &dims, &lengths)?;
        let mut slices: Vec<_> = views.iter().map(|view| view.values).collect();
        let concatenated: Option<Cow<'_, S::Slice>> = match *directions {
            [] => None,
            [one] => Some(Cow::Borrowed(one)),
            _ => Some(Cow::Owned(S::concatenated(directions))),
        };
        slices.extend(concatenated.as_deref());
        caught(|| self.0.run::<S>(pass, &slices, &dims))
    }
}

/// The parts of gradients one after the other.
fn spread<S: Store>(flat: S::Owned, views: &[View<'_, S>], wanted: &[bool]) -> Gradients<S> {
    let chosen = views.iter().zip(wanted).filter(|&(_, &wanted)| wanted);
    let counts: Vec<_> = chosen.map(|(view, _)| S::count(view.values)).collect();
    let mut parts = S::split(flat, &counts).into_iter();
    wanted.iter().take(views.len()).map(|&wanted| wanted.then(|| parts.next()).flatten()).collect()
}

fn misfit(dims: &[Vec<usize>]) -> String {
    format!("arrays of these shapes do not fit the op: {dims:?}")
}

impl Kind {
    fn inputs(&self) -> usize {
        match self {
            Self::Sum(_) | Self::Elementary(ElementaryOp::Perspective | ElementaryOp::Loss(_)) => 2,
            Self::Loss(_) => 3,
            Self::Blend(blend) => 4 + usize::from(blend.texture.is_some()),
            _ => 1,
        }
    }

    /// The shape of the value, if the inputs fit.
    fn shape(&self, dims: &[Vec<usize>]) -> Option<Vec<usize>> {
        Some(match (self, dims) {
            (Self::Sum(of), [vertices, table]) => {
                let views = of.views(vertices, table)?;
                vec![views, of.size[0], of.size[1]]
            }
            (Self::Loss(of), [vertices, table, target]) => {
                let views = of.views(vertices, table)?;
                let fits = [1, views].iter().any(|held| target == &[*held, of.size[0], of.size[1]]);
                fits.then(|| vec![views])?
            }
            (Self::Blend(blend), [vertices, attributes, tables, background, texture @ ..]) => {
                let (&[views, 3, _], &[behind]) = (&vertices[..], &background[..]) else {
                    return None;
                };
                let fits = blend.fits([vertices, attributes, tables], behind, texture);
                (views > 0 && fits).then(|| vec![views, behind, blend.size[0], blend.size[1]])?
            }
            (Self::Elementary(ElementaryOp::OrbitMatrix), [orbits]) => {
                let &[views @ 1..=usize::MAX, 4] = &orbits[..] else { return None };
                vec![views, 3, 4]
            }
            (Self::Elementary(ElementaryOp::Perspective), [points, matrices]) => {
                match (&points[..], &matrices[..]) {
                    (&[held @ 1..=usize::MAX, count, 3], &[views @ 1..=usize::MAX, 3, 4])
                        if held == 1 || held == views =>
                    {
                        vec![views, 3, count]
                    }
                    _ => return None,
                }
            }
            (Self::Elementary(ElementaryOp::Loss(_)), [image, target]) => {
                let (&[views @ 1..=usize::MAX, ..], &[held, ..]) = (&image[..], &target[..]) else {
                    return None;
                };
                let fits = image.len() == 3 && target.get(1..) == image.get(1..);
                (fits && (held == 1 || held == views)).then(|| vec![views])?
            }
            (Self::Elementary(ElementaryOp::Coverage) | Self::AnyCoverage(_), [sums]) => {
                sums.clone()
            }
            _ => return None,
        })
    }

    /// Checks the shapes of a call.
    fn check(&self, pass: &Pass, dims: &[Vec<usize>], directions: &[usize]) -> Result<(), String> {
        let (inputs, upstream) = dims.split_at(self.inputs().min(dims.len()));
        let shape = self.shape(inputs).ok_or_else(|| misfit(dims))?;
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
        if fits { Ok(()) } else { Err(misfit(dims)) }
    }

    fn run<S: Store>(&self, pass: &Pass, inputs: &[&S::Slice], dims: &[Vec<usize>]) -> S::Owned {
        match self {
            Self::Sum(of) | Self::Loss(of) => S::run(&of.op, pass, inputs, dims),
            Self::Blend(blend) => S::run(&blend.op, pass, inputs, dims),
            Self::Elementary(op) => S::run(&FusedOp::Elementary(*op), pass, inputs, dims),
            Self::AnyCoverage(of) => S::run_taped(of, pass, inputs),
        }
    }
}

impl Drawn {
    /// The number of views, if vertices and a table fit.
    fn views(&self, vertices: &[usize], table: &[usize]) -> Option<usize> {
        let &[views, 3, count] = vertices else { return None };
        let tables = table == [self.rows, 4] || table == [views, self.rows, 4];
        (views > 0 && count >= self.least_vertices && tables).then_some(views)
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
