//! Silhouettes and colours as functions of φ: their values and derivatives, composed of ops whose tables follow φ.

use std::{borrow::Borrow, sync::Arc};

use softrast_raster::{ColourRenderer, HostBackend, SoftRenderer, TConorm};
use softrast_softness::{EdgeSoftness, Softness as _};

use crate::{
    checks::{check_phi, least},
    guard::caught,
    knots::{Drawing, Drawings, Knots, Recent},
    op::{Gradients, Op},
    store::{Store, View},
    taped::Taped,
};

/// Inputs of a function. φ, if there is one, is in float64, and some view has its place.
pub(crate) struct Inputs<'a, S: Store> {
    pub(crate) views: Vec<View<'a, S>>,
    pub(crate) phi: Vec<f64>,
}

/// Directions of the inputs, those of φ apart.
pub(crate) struct Directions<'a, S: Store> {
    pub(crate) views: Vec<Option<&'a S::Slice>>,
    pub(crate) phi: Option<Vec<f64>>,
}

/// Gradients to the inputs and maybe the upstream as they are wanted, that to φ apart.
pub(crate) struct Found<S: Store> {
    pub(crate) views: Gradients<S>,
    pub(crate) phi: Option<Vec<f64>>,
}

/// An op of which one input, at `place`, is a table of φ: as a function that has φ there.
pub(crate) struct Tabled<'a, S: Store> {
    pub(crate) op: Op,
    place: usize,
    drawing: &'a Drawing,
    table: S::Owned,
}

impl<'a, S: Store> Tabled<'a, S> {
    /// The table lies where the numbers `beside` do.
    pub(crate) fn new(op: Op, place: usize, drawing: &'a Drawing, beside: &S::Slice) -> Self {
        Self { op, place, drawing, table: drawing.table::<S>(beside) }
    }

    /// The inputs with the table in its place.
    pub(crate) fn scene<'b>(&'b self, views: &[View<'b, S>]) -> Vec<View<'b, S>> {
        let mut views = views.to_vec();
        views[self.place] =
            View { dims: vec![self.drawing.knots.rows, 4], values: self.table.borrow() };
        views
    }

    fn vjp(
        &self,
        views: &[View<'_, S>],
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        if !wanted.contains(&true) {
            return Ok(Found { views: wanted.iter().map(|_| None).collect(), phi: None });
        }
        let mut views = self.op.vjp(&self.scene(views), upstream, wanted)?;
        let to_table = views[self.place].take();
        let phi = to_table
            .map(|to_table| self.drawing.to_phi(&S::wide(to_table.borrow())))
            .transpose()?;
        Ok(Found { views, phi })
    }

    fn vjp_of_vjp(
        &self,
        views: &[View<'_, S>],
        upstream: &View<'_, S>,
        directions: &Directions<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        let (scene, place) = (self.scene(views), self.place);
        let (mut along, mut bent) = (directions.views.clone(), None);
        let by_table;
        if let Some(direction) = &directions.phi {
            let only: Vec<_> = (0..scene.len()).map(|k| k == place).collect();
            let to_table = self.op.vjp(&scene, upstream, &only)?[place].take().ok_or(MISSING)?;
            let to_table = S::wide(to_table.borrow());
            let Drawing { knots, phi, .. } = self.drawing;
            let [to_phi, moved] = caught(|| knots.tables.vjp_of_vjp(phi, &to_table, direction))?;
            bent = Some(to_phi);
            by_table = S::narrow(&moved, upstream.values);
            along[place] = Some(by_table.borrow());
        }
        let mut views = self.op.vjp_of_vjp(&scene, upstream, &along, wanted)?;
        let to_phi = views[place].take();
        let to_phi =
            to_phi.map(|to_table| self.drawing.to_phi(&S::wide(to_table.borrow()))).transpose()?;
        let phi = to_phi.map(|to_phi| match bent {
            Some(bent) => f64::sum(to_phi, &bent),
            None => to_phi,
        });
        Ok(Found { views, phi })
    }
}

pub(crate) const MISSING: &str = "a gradient is missing";

/// The only gradient of some.
pub(crate) fn only<S: Store>(found: Gradients<S>) -> Result<S::Owned, String> {
    Ok(found.into_iter().flatten().next().ok_or(MISSING)?)
}

/// Vertices `[views, 3, V]` and maybe φ `[P]` to coverage `[views, height, width]`; kept are the sums.
///
/// Where the softness has a surrogate, the derivatives are those of sums that move as the surrogate's do, and φ has none.
pub(crate) struct Silhouettes {
    pub(crate) renderer: SoftRenderer<EdgeSoftness>,
    pub(crate) t_conorm: TConorm,
    pub(crate) least_vertices: usize,
    pub(crate) size: [usize; 2],
    coverage: Op,
    surrogate: Option<Drawing>,
    drawings: Drawings,
    recent: Recent,
}

impl Silhouettes {
    pub(crate) fn new(
        renderer: SoftRenderer<EdgeSoftness>,
        t_conorm: TConorm,
        least_vertices: usize,
        size: [usize; 2],
    ) -> Result<Self, String> {
        let drawing = |of: &SoftRenderer<EdgeSoftness>| {
            Drawing::new(Arc::new(knots(of, of.phi(), least_vertices, size)?), of.phi())
        };
        let surrogate = renderer.surrogate().map(drawing).transpose()?;
        Ok(Self {
            coverage: Op::coverage(t_conorm),
            surrogate,
            drawings: Drawings::default(),
            recent: Recent::default(),
            renderer,
            t_conorm,
            least_vertices,
            size,
        })
    }

    fn drawing(&self, phi: &[f64]) -> Result<Arc<Drawing>, String> {
        let choose = || knots(&self.renderer, phi, self.least_vertices, self.size);
        self.drawings.drawing(phi, &[], choose)
    }

    /// The image, and the sums; if it `keeps`, the passes back find what is known about the vertices.
    pub(crate) fn forward<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        keeps: bool,
    ) -> Result<Vec<S::Owned>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let op = &drawing.knots.op;
        let op = if keeps { self.recent.op(op, &inputs.views[..1]) } else { op.clone() };
        let of = Tabled::<S>::new(op, 1, &drawing, inputs.views[0].values);
        let sums = of.op.forward(&of.scene(&inputs.views))?;
        let dims = self.dims(&inputs.views[0]);
        Ok(vec![self.coverage.forward::<S>(&[View { dims, values: sums.borrow() }])?, sums])
    }

    /// The shape of the image.
    pub(crate) fn dims<S: Store>(&self, vertices: &View<'_, S>) -> Vec<usize> {
        vec![vertices.dims[0], self.size[0], self.size[1]]
    }

    /// Sums as they are differentiated, of a scene with these vertices.
    fn sums<'a, S: Store>(&'a self, drawing: &'a Drawing, views: &[View<'_, S>]) -> Tabled<'a, S> {
        let surrogate = self.surrogate.as_ref().unwrap_or(drawing);
        Tabled::new(self.recent.op(&surrogate.knots.op, &views[..1]), 1, surrogate, views[0].values)
    }

    pub(crate) fn vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        kept: &View<'_, S>,
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let sums = self.sums(&drawing, &inputs.views);
        let to_sums = self.to_sums(kept, upstream)?;
        let to_sums = View { dims: kept.dims.clone(), values: to_sums.borrow() };
        let found = sums.vjp(&inputs.views, &to_sums, &self.learned(wanted))?;
        Ok(self.found(inputs, found, wanted))
    }

    /// Flags of vertices and φ, whose own is taken back where it has no derivative.
    fn learned(&self, flags: &[bool]) -> [bool; 2] {
        [flags[0], flags[1] && self.surrogate.is_none()]
    }

    fn to_sums<S: Store>(
        &self,
        kept: &View<'_, S>,
        upstream: &View<'_, S>,
    ) -> Result<S::Owned, String> {
        only::<S>(self.coverage.vjp(std::slice::from_ref(kept), upstream, &[true])?)
    }

    pub(crate) fn vjp_of_vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        kept: &View<'_, S>,
        upstream: &View<'_, S>,
        mut directions: Directions<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let sums = self.sums(&drawing, &inputs.views);
        let to_sums = self.to_sums(kept, upstream)?;
        let to_sums = View { dims: kept.dims.clone(), values: to_sums.borrow() };
        if self.surrogate.is_some() {
            directions.phi = None;
        }
        let wants = self.learned(wanted);
        let every = [wants[0], wants[1], true];
        let mut first = sums.vjp_of_vjp(&inputs.views, &to_sums, &directions, &every)?;
        let moved = first.views.pop().flatten().ok_or(MISSING)?;
        // The gradient changes with the image as well: by how the sums become coverage.
        let one = std::slice::from_ref(kept);
        let mut of =
            self.coverage.vjp_of_vjp(one, upstream, &[Some(moved.borrow())], &[true, true])?;
        let to_upstream = of.pop().flatten();
        if wants.contains(&true) {
            let by_sums = of.pop().flatten().ok_or(MISSING)?;
            let by_sums = View { dims: kept.dims.clone(), values: by_sums.borrow() };
            let again = sums.vjp(&inputs.views, &by_sums, &wants)?;
            let pairs = first.views.into_iter().zip(again.views);
            first.views = pairs.map(|(a, b)| Some(S::sum(a?, b?.borrow()))).collect();
            first.phi = first.phi.zip(again.phi).map(|(a, b)| f64::sum(a, &b));
        }
        let mut found = self.found(inputs, first, wanted);
        found.views.push(to_upstream.filter(|_| wanted[2]));
        Ok(found)
    }

    /// Gradients with 0 for a φ that has none.
    fn found<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        mut found: Found<S>,
        wanted: &[bool],
    ) -> Found<S> {
        if wanted[1] && found.phi.is_none() {
            found.phi = Some(vec![0.0; inputs.phi.len()]);
        }
        found
    }
}

/// Support and knots of silhouettes for φ.
fn knots(
    renderer: &SoftRenderer<EdgeSoftness>,
    phi: &[f64],
    least_vertices: usize,
    size: [usize; 2],
) -> Result<Knots, String> {
    let softness = renderer.softness();
    check_phi("phi", softness.family.name(), softness.parameters(), phi)?;
    let silhouette = caught(|| renderer.prepared::<HostBackend>(phi))?;
    let op = Op::sum(&silhouette, least_vertices, size);
    let rows = silhouette.profile().knots();
    Ok(Knots { op, rows, tables: Taped::Table(Box::new(silhouette)) })
}

/// Vertices `[views, 3, V]`, attributes `[1 or views, entries, numbers]`, both φ in a row `[P + Q]`, a background with the logarithm of its
/// weight `[channels + 1]` and, if there is one, a texture `[texels, 4]` to an image `[views, channels + 1, height, width]`.
pub(crate) struct Blends {
    renderer: Arc<ColourRenderer>,
    faces: Arc<[[u32; 3]]>,
    entries: Arc<[[u32; 3]]>,
    size: [usize; 2],
    texture: Option<[usize; 2]>,
    drawings: Drawings,
    recent: Recent,
}

impl Blends {
    /// The place of φ among the inputs.
    pub(crate) const PHI: usize = 2;

    /// `entries` say which entry of the attributes each corner has, `texture` are its rows and columns.
    pub(crate) fn new(
        renderer: Arc<ColourRenderer>,
        faces: Arc<[[u32; 3]]>,
        entries: Arc<[[u32; 3]]>,
        size: [usize; 2],
        texture: Option<[usize; 2]>,
    ) -> Self {
        let (drawings, recent) = Default::default();
        Self { renderer, faces, entries, size, texture, drawings, recent }
    }

    /// Whether attributes are places on a texture.
    pub(crate) fn has_texture(&self) -> bool {
        self.texture.is_some()
    }

    fn drawing<S: Store>(&self, inputs: &Inputs<'_, S>) -> Result<Arc<Drawing>, String> {
        let log_weight = S::wide(inputs.views[3].values).last().copied().unwrap_or(f64::NAN);
        self.drawings.drawing(&inputs.phi, &[log_weight], || {
            let weighting = self.renderer.weighting();
            let split = weighting.edge.parameters().min(inputs.phi.len());
            let phi = [&inputs.phi[..split], &inputs.phi[split..]].map(<[f64]>::to_vec);
            let (edge, depth) = (weighting.edge, weighting.depth);
            check_phi("phi", edge.family.name(), edge.parameters(), &phi[0])?;
            check_phi("phi_depth", depth.name(), depth.parameters(), &phi[1])?;
            if !log_weight.is_finite() {
                return Err(format!("log_weight is {log_weight}, expected a finite number"));
            }
            let entries = self.entries.clone();
            let made = || self.renderer.op(&phi, log_weight, entries, self.texture);
            let (op, tables) = caught(made)?;
            let (rows, sizes) = (tables.rows(), [least(&self.faces), least(&self.entries)]);
            let op = Op::blend(op, rows, sizes, self.size, self.texture);
            Ok(Knots { op, rows, tables: Taped::Weights(Box::new(tables), split) })
        })
    }

    /// The op as a function of φ.
    fn of<'a, S: Store>(&self, drawing: &'a Drawing, inputs: &Inputs<'_, S>) -> Tabled<'a, S> {
        let beside = inputs.views[0].values;
        let mut of = Tabled::new(drawing.knots.op.clone(), Self::PHI, drawing, beside);
        let op = self.recent.op(&of.op, &of.scene(&inputs.views));
        of.op = op;
        of
    }

    /// The shape of the image.
    pub(crate) fn dims<S: Store>(&self, views: &[View<'_, S>]) -> Vec<usize> {
        vec![views[0].dims[0], views[3].dims[0], self.size[0], self.size[1]]
    }

    pub(crate) fn forward<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        keeps: bool,
    ) -> Result<Vec<S::Owned>, String> {
        let views = &inputs.views;
        let behind = S::wide(views[3].values);
        let colour = behind.split_last().is_none_or(|(_, colour)| f64::finite(colour));
        let texture = views.get(4).is_none_or(|texture| S::finite(texture.values));
        let shown = S::finite(views[1].values);
        for (finite, name) in [(shown, "attributes"), (colour, "background"), (texture, "texture")]
        {
            if !finite {
                return Err(format!("{name} must be finite, found a number that is not"));
            }
        }
        let drawing = self.drawing(inputs)?;
        let of = match keeps {
            true => self.of(&drawing, inputs),
            false => Tabled::new(drawing.knots.op.clone(), Self::PHI, &drawing, views[0].values),
        };
        Ok(vec![of.op.forward(&of.scene(views))?])
    }

    pub(crate) fn vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        self.of(&*self.drawing(inputs)?, inputs).vjp(&inputs.views, upstream, wanted)
    }

    pub(crate) fn vjp_of_vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        upstream: &View<'_, S>,
        directions: &Directions<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
        let drawing = self.drawing(inputs)?;
        self.of(&drawing, inputs).vjp_of_vjp(&inputs.views, upstream, directions, wanted)
    }
}
