//! Losses of silhouettes against targets, each with its gradient to the vertices from one walk over the faces.

use std::sync::{Arc, OnceLock};

use softrast_raster::{
    HostBackend, TConorm,
    low_level::{ElementaryOp, PixelLoss},
};

use crate::{
    arrays::{Float, View},
    guard::caught,
    knots::{Drawing, Knots},
    op::{Gradients, Op},
    passes::{Directions, Inputs, Silhouettes, Tabled, sum},
    taped::Taped,
};

/// Vertices `[views, 3, V]` and targets `[1 or views, height, width]` to losses `[views]`; kept are their gradients `[views, 3, V]`.
pub(crate) struct Losses {
    scene: Arc<Silhouettes>,
    loss: PixelLoss,
    of_images: Op,
    drawing: OnceLock<Drawing>,
}

impl Losses {
    /// The loss of a renderer without a surrogate, under the probabilistic sum: others have none of their own.
    pub(crate) fn new(scene: &Arc<Silhouettes>, loss: PixelLoss) -> Option<Self> {
        let of_images = Op::elementary(ElementaryOp::from(loss));
        let whole =
            scene.t_conorm == TConorm::Probabilistic && scene.renderer.surrogate().is_none();
        whole.then(|| Self { scene: scene.clone(), loss, of_images, drawing: OnceLock::new() })
    }

    /// The op of the loss, with a table of the renderer's φ; if it `keeps`, it computes the gradient too.
    fn tabled<F: Float>(&self, keeps: bool) -> Result<Tabled<'_, F>, String> {
        let drawing = match self.drawing.get() {
            Some(drawing) => drawing,
            None => {
                let Silhouettes { renderer, least_vertices, size, .. } = &*self.scene;
                let silhouette = caught(|| renderer.prepared::<HostBackend>(renderer.phi()))?;
                let op = silhouette.loss_op(self.loss).ok_or("the T-conorm has no loss")?;
                let rows = silhouette.profile().knots();
                let op = Op::loss(op, rows, *least_vertices, *size);
                let knots = Knots { op, rows, tables: Taped::Table(Box::new(silhouette)) };
                let drawing = Drawing::new(Arc::new(knots), renderer.phi())?;
                self.drawing.get_or_init(|| drawing)
            }
        };
        let op = &drawing.knots.op;
        Ok(Tabled::new(if keeps { op.keeping() } else { op.clone() }, 1, drawing))
    }

    /// The losses and, if it `keeps`, their gradients.
    pub(crate) fn forward<F: Float>(
        &self,
        views: &[View<'_, F>],
        keeps: bool,
    ) -> Result<Vec<Vec<F>>, String> {
        let of = self.tabled(keeps)?;
        let scene = of.scene(&[views[0].clone(), views[0].clone(), views[1].clone()]);
        if !keeps {
            return Ok(vec![of.op.forward(&scene)?]);
        }
        let ones = vec![F::from_elem(1.0); views[0].dims[0]];
        let ones = View { dims: vec![ones.len()], values: &ones };
        let losses = of.op.forward(&scene)?;
        let found = of.op.vjp(&scene, &ones, &[true, false, false])?;
        Ok(vec![losses, found.into_iter().flatten().next().unwrap_or_default()])
    }

    /// The shape of the value, if the inputs fit.
    pub(crate) fn dims<F>(&self, views: &[View<'_, F>]) -> Result<Vec<usize>, String> {
        let image = self.scene.dims(&views[0]);
        self.of_images.shape(&[image, views[1].dims.clone()])
    }

    pub(crate) fn vjp<F: Float>(
        &self,
        views: &[View<'_, F>],
        kept: &View<'_, F>,
        upstream: &View<'_, F>,
        wanted: &[bool],
    ) -> Result<Gradients<F>, String> {
        if upstream.dims != self.dims(views)? || kept.dims != views[0].dims {
            return Err("a loss and its gradients are of other views".to_owned());
        }
        let of_view = kept.values.len() / upstream.values.len().max(1);
        let to_vertices = wanted[0].then(|| {
            let mut all = kept.values.to_vec();
            for (part, factor) in all.chunks_mut(of_view.max(1)).zip(upstream.values) {
                part.iter_mut().for_each(|x| *x = *x * *factor);
            }
            all
        });
        if !wanted[1] {
            return Ok(vec![to_vertices, None]);
        }
        let (image, _) = self.image(views)?;
        let pair = self.pair(views, &image);
        let mut found = self.of_images.vjp(&pair, upstream, &[false, true])?;
        Ok(vec![to_vertices, found.pop().flatten()])
    }

    /// By the chain rule over the image and its loss: the second derivative of the image, and that of the loss along its motion.
    pub(crate) fn vjp_of_vjp<F: Float>(
        &self,
        views: &[View<'_, F>],
        upstream: &View<'_, F>,
        directions: &[Option<&[F]>],
        wanted: &[bool],
    ) -> Result<Gradients<F>, String> {
        let (image, sums) = self.image(views)?;
        let pair = self.pair(views, &image);
        let inputs = self.inputs(views);
        let sums = View { dims: pair[0].dims.clone(), values: &sums };
        let (moved, curved);
        let mut along = [None, directions[1]];
        if directions[0].is_some() {
            let by_image = self.of_images.vjp(&pair, upstream, &[true, false])?;
            let by_image = by_image.into_iter().flatten().next().unwrap_or_default();
            let by_image = View { dims: pair[0].dims.clone(), values: &by_image };
            let motion = Directions { views: vec![directions[0], None], phi: None };
            let flags = [wanted[0], false, true];
            let mut found = self.scene.vjp_of_vjp(&inputs, &sums, &by_image, motion, &flags)?;
            moved = found.views.pop().flatten().unwrap_or_default();
            curved = found.views.into_iter().next().flatten();
            along[0] = Some(&moved[..]);
        } else {
            curved = None;
        }
        let flags = [wanted[0], wanted[1], wanted[2]];
        let mut found = self.of_images.vjp_of_vjp(&pair, upstream, &along, &flags)?;
        let to_vertices = found[0].take().map(|bent| {
            let bent = View { dims: pair[0].dims.clone(), values: &bent };
            let found = self.scene.vjp(&inputs, &sums, &bent, &[true, false])?;
            let bent = found.views.into_iter().next().flatten().unwrap_or_default();
            Ok::<_, String>(match curved {
                Some(curved) => sum(bent, &curved),
                None => bent,
            })
        });
        found[0] = to_vertices.transpose()?;
        Ok(found)
    }

    /// The image and its sums.
    fn image<F: Float>(&self, views: &[View<'_, F>]) -> Result<(Vec<F>, Vec<F>), String> {
        let found = self.scene.forward(&self.inputs(views), true)?;
        let [image, sums] = found.try_into().map_err(|_| "an image is missing")?;
        Ok((image, sums))
    }

    /// Inputs of the loss of images.
    fn pair<'a, F: Float>(&self, views: &[View<'a, F>], image: &'a [F]) -> [View<'a, F>; 2] {
        [View { dims: self.scene.dims(&views[0]), values: image }, views[1].clone()]
    }

    /// Inputs of the scene.
    fn inputs<'a, F: Float>(&self, views: &[View<'a, F>]) -> Inputs<'a, F> {
        let none = View { dims: Vec::new(), values: &[] };
        Inputs { views: vec![views[0].clone(), none], phi: self.scene.renderer.phi().to_vec() }
    }
}
