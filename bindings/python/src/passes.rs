//! Silhouettes and colours as functions of φ: their values and derivatives, composed of ops whose tables follow φ.

use std::sync::Arc;

use softrast_raster::{ColourRenderer, HostBackend, SoftRenderer, TConorm};
use softrast_softness::{EdgeSoftness, Softness as _};

use crate::{
    arrays::{Float, View, narrow, wide},
    checks::{check_phi, least},
    guard::caught,
    knots::{Drawing, Drawings, Knots, Recent},
    op::{Gradients, Op},
    taped::Taped,
};

/// Inputs of a function. φ, if there is one, is in float64, and an empty view has its place.
pub(crate) struct Inputs<'a, F> {
    pub(crate) views: Vec<View<'a, F>>,
    pub(crate) phi: Vec<f64>,
}

/// Directions of the inputs, those of φ apart.
pub(crate) struct Directions<'a, F> {
    pub(crate) views: Vec<Option<&'a [F]>>,
    pub(crate) phi: Option<Vec<f64>>,
}

/// Gradients to the inputs and maybe the upstream as they are wanted, that to φ apart.
pub(crate) struct Found<F> {
    pub(crate) views: Gradients<F>,
    pub(crate) phi: Option<Vec<f64>>,
}

/// An op of which one input, at `place`, is a table of φ: as a function that has φ there.
pub(crate) struct Tabled<'a, F> {
    pub(crate) op: Op,
    place: usize,
    drawing: &'a Drawing,
    table: Vec<F>,
}

impl<'a, F: Float> Tabled<'a, F> {
    pub(crate) fn new(op: Op, place: usize, drawing: &'a Drawing) -> Self {
        Self { op, place, drawing, table: drawing.table() }
    }

    /// The inputs with the table in its place.
    pub(crate) fn scene<'b>(&'b self, views: &[View<'b, F>]) -> Vec<View<'b, F>> {
        let mut views = views.to_vec();
        views[self.place] = View { dims: vec![self.drawing.knots.rows, 4], values: &self.table };
        views
    }

    fn vjp(
        &self,
        views: &[View<'_, F>],
        upstream: &View<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        if !wanted.contains(&true) {
            return Ok(Found { views: vec![None; wanted.len()], phi: None });
        }
        let mut views = self.op.vjp(&self.scene(views), upstream, wanted)?;
        let to_table = views[self.place].take();
        let phi = to_table.map(|to_table| self.drawing.to_phi(&wide(&to_table))).transpose()?;
        Ok(Found { views, phi })
    }

    fn vjp_of_vjp(
        &self,
        views: &[View<'_, F>],
        upstream: &View<'_, F>,
        directions: &Directions<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        let (scene, place) = (self.scene(views), self.place);
        let (mut along, mut bent) = (directions.views.clone(), None);
        let by_table;
        if let Some(direction) = &directions.phi {
            let only: Vec<_> = (0..scene.len()).map(|k| k == place).collect();
            let to_table = self.op.vjp(&scene, upstream, &only)?[place].take().unwrap_or_default();
            let Drawing { knots, phi, .. } = self.drawing;
            let [to_phi, moved] =
                caught(|| knots.tables.vjp_of_vjp(phi, &wide(&to_table), direction))?;
            bent = Some(to_phi);
            by_table = narrow::<F>(&moved);
            along[place] = Some(&by_table);
        }
        let mut views = self.op.vjp_of_vjp(&scene, upstream, &along, wanted)?;
        let to_phi = views[place].take();
        let to_phi = to_phi.map(|to_table| self.drawing.to_phi(&wide(&to_table))).transpose()?;
        let phi = to_phi.map(|to_phi| match bent {
            Some(bent) => sum(to_phi, &bent),
            None => to_phi,
        });
        Ok(Found { views, phi })
    }
}

pub(crate) fn sum<F: Float>(a: Vec<F>, b: &[F]) -> Vec<F> {
    a.into_iter().zip(b).map(|(a, b)| a + *b).collect()
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
    pub(crate) fn forward<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        keeps: bool,
    ) -> Result<Vec<Vec<F>>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let op = &drawing.knots.op;
        let op = if keeps { self.recent.op(op, &inputs.views[..1]) } else { op.clone() };
        let of = Tabled::new(op, 1, &drawing);
        let sums = of.op.forward(&of.scene(&inputs.views))?;
        let dims = self.dims(&inputs.views[0]);
        Ok(vec![self.coverage.forward(&[View { dims, values: &sums }])?, sums])
    }

    /// The shape of the image.
    pub(crate) fn dims<F>(&self, vertices: &View<'_, F>) -> Vec<usize> {
        vec![vertices.dims[0], self.size[0], self.size[1]]
    }

    /// Sums as they are differentiated, of a scene with these vertices.
    fn sums<'a, F: Float>(&'a self, drawing: &'a Drawing, views: &[View<'_, F>]) -> Tabled<'a, F> {
        let felt = self.surrogate.as_ref().unwrap_or(drawing);
        Tabled::new(self.recent.op(&felt.knots.op, &views[..1]), 1, felt)
    }

    pub(crate) fn vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        kept: &View<'_, F>,
        upstream: &View<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let sums = self.sums(&drawing, &inputs.views);
        let to_sums = self.to_sums(kept, upstream)?;
        let to_sums = View { dims: kept.dims.clone(), values: &to_sums };
        let found = sums.vjp(&inputs.views, &to_sums, &self.learned(wanted))?;
        Ok(self.found(inputs, found, wanted))
    }

    /// Flags of vertices and φ, whose own is taken back where it has no derivative.
    fn learned(&self, flags: &[bool]) -> [bool; 2] {
        [flags[0], flags[1] && self.surrogate.is_none()]
    }

    fn to_sums<F: Float>(
        &self,
        kept: &View<'_, F>,
        upstream: &View<'_, F>,
    ) -> Result<Vec<F>, String> {
        let found = self.coverage.vjp(std::slice::from_ref(kept), upstream, &[true])?;
        Ok(found.into_iter().flatten().next().unwrap_or_default())
    }

    pub(crate) fn vjp_of_vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        kept: &View<'_, F>,
        upstream: &View<'_, F>,
        mut directions: Directions<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        let drawing = self.drawing(&inputs.phi)?;
        let sums = self.sums(&drawing, &inputs.views);
        let to_sums = self.to_sums(kept, upstream)?;
        let to_sums = View { dims: kept.dims.clone(), values: &to_sums };
        if self.surrogate.is_some() {
            directions.phi = None;
        }
        let wants = self.learned(wanted);
        let every = [wants[0], wants[1], true];
        let mut first = sums.vjp_of_vjp(&inputs.views, &to_sums, &directions, &every)?;
        let moved = first.views.pop().flatten().unwrap_or_default();
        // The gradient changes with the image as well: by how the sums become coverage.
        let one = std::slice::from_ref(kept);
        let mut of = self.coverage.vjp_of_vjp(one, upstream, &[Some(&moved)], &[true, true])?;
        let to_upstream = of.pop().flatten();
        if wants.contains(&true) {
            let by_sums = of.pop().flatten().unwrap_or_default();
            let by_sums = View { dims: kept.dims.clone(), values: &by_sums };
            let again = sums.vjp(&inputs.views, &by_sums, &wants)?;
            let pairs = first.views.into_iter().zip(again.views);
            first.views = pairs.map(|(a, b)| Some(sum(a?, &b?))).collect();
            first.phi = first.phi.zip(again.phi).map(|(a, b)| sum(a, &b));
        }
        let mut found = self.found(inputs, first, wanted);
        found.views.push(to_upstream.filter(|_| wanted[2]));
        Ok(found)
    }

    /// Gradients with 0 for a φ that has none.
    fn found<F>(&self, inputs: &Inputs<'_, F>, mut found: Found<F>, wanted: &[bool]) -> Found<F> {
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

    fn drawing<F: Float>(&self, inputs: &Inputs<'_, F>) -> Result<Arc<Drawing>, String> {
        let log_weight = inputs.views[3].values.last().map_or(f64::NAN, |&weight| weight.elem());
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
    fn of<'a, F: Float>(&self, drawing: &'a Drawing, inputs: &Inputs<'_, F>) -> Tabled<'a, F> {
        let mut of = Tabled::new(drawing.knots.op.clone(), Self::PHI, drawing);
        let op = self.recent.op(&of.op, &of.scene(&inputs.views));
        of.op = op;
        of
    }

    /// The shape of the image.
    pub(crate) fn dims<F>(&self, views: &[View<'_, F>]) -> Vec<usize> {
        vec![views[0].dims[0], views[3].dims[0], self.size[0], self.size[1]]
    }

    pub(crate) fn forward<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        keeps: bool,
    ) -> Result<Vec<Vec<F>>, String> {
        let views = &inputs.views;
        let colour = views[3].values.split_last().map_or(&[][..], |(_, colour)| colour);
        let texture = views.get(4).map_or(&[][..], |texture| texture.values);
        let named = [(views[1].values, "attributes"), (colour, "background"), (texture, "texture")];
        for (values, name) in named {
            if !values.iter().all(|x| x.elem::<f64>().is_finite()) {
                return Err(format!("{name} must be finite, found a number that is not"));
            }
        }
        let drawing = self.drawing(inputs)?;
        let of = match keeps {
            true => self.of(&drawing, inputs),
            false => Tabled::new(drawing.knots.op.clone(), Self::PHI, &drawing),
        };
        Ok(vec![of.op.forward(&of.scene(views))?])
    }

    pub(crate) fn vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        upstream: &View<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        self.of(&*self.drawing(inputs)?, inputs).vjp(&inputs.views, upstream, wanted)
    }

    pub(crate) fn vjp_of_vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        upstream: &View<'_, F>,
        directions: &Directions<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        let drawing = self.drawing(inputs)?;
        self.of(&drawing, inputs).vjp_of_vjp(&inputs.views, upstream, directions, wanted)
    }
}
